//! Violations of ψ_ego that count as counterexamples.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ego::reference::ReferenceDriver;

/// Violations of ψ_ego that count as counterexamples.
///
/// The others become [`super::Verdict::Uncounted`].
///
/// A contact of the ego with any road user counts, trained or not. The ego must
/// move faster than 0.5 m/s and must not be struck from behind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum Counts {
    /// Every violation.
    #[default]
    Violation,
    /// Contacts with at least this closing speed.
    Contact {
        /// Lower bound of the approach speed along the contact normal.
        closing_mps: f64,
    },
    /// Contacts that a named reference driver avoids in the ego's place.
    Preventable {
        /// Reference drivers. A single driver that avoids the contact suffices.
        by: Vec<ReferenceDriver>,
        /// Lower bound of the approach speed along the contact normal.
        #[serde(default)]
        closing_mps: f64,
    },
}

impl Counts {
    /// Returns true if every violation counts.
    pub fn is_violation(&self) -> bool {
        *self == Counts::Violation
    }

    /// Returns the violations that count, in words. `None`: every violation.
    pub fn in_words(&self) -> Option<String> {
        let closing_mps = self.closing_mps()?;
        let mut text = "only a contact of the moving ego, not struck from behind".to_owned();
        if closing_mps > 0.0 {
            text.push_str(&format!(", closing at {closing_mps} m/s or more"));
        }
        if let Counts::Preventable { by, .. } = self {
            let names: Vec<&str> = by.iter().map(|driver| driver.name()).collect();
            text.push_str(&format!(", that {} avoids", names.join(" or ")));
        }
        Some(text)
    }

    /// Lower bound of the closing speed, `None` if no contact is required.
    pub fn closing_mps(&self) -> Option<f64> {
        match self {
            Counts::Violation => None,
            Counts::Contact { closing_mps } | Counts::Preventable { closing_mps, .. } => {
                Some(*closing_mps)
            }
        }
    }
}
