//! Predictions of one part of the data for the other.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

/// Prediction of one part of the data for the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrationRow {
    /// Part that was predicted.
    pub tested_on: String,
    /// Predicted quantity.
    pub quantity: String,
    /// Predicted rate or share.
    pub predicted: f64,
    /// Observed rate or share.
    pub observed: f64,
    /// Observed events, or unbroken stretches of driving with one.
    pub events: usize,
}

impl CalibrationRow {
    /// Returns the prediction over the observation.
    pub fn ratio(&self) -> f64 {
        self.predicted / self.observed
    }
}

impl Display for CalibrationRow {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (ratio, events) = (self.ratio(), self.events);
        let printed = if ratio.is_finite() {
            format!("{ratio:.2}")
        } else {
            "–".to_owned()
        };
        // Below five events a rate is no count, as in the tails.
        let verdict = if events < 5 {
            ", too few events to judge"
        } else if (0.5..=2.0).contains(&ratio) {
            ""
        } else {
            ", off by more than a factor of two"
        };
        write!(
            f,
            "{printed:4}  {}, {}: {events} events{verdict}",
            self.quantity, self.tested_on
        )
    }
}
