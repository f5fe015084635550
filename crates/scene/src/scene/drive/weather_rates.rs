//! Rates of change of the weather: the actions of its ado.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Rates of change of the weather.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WeatherRates {
    /// Rate of the coefficient of friction, 1/s.
    pub friction_per_s: f64,
    /// Rate of the visibility, m/s.
    pub visibility_mps: f64,
    /// Rate of the factor on the noise, 1/s.
    pub noise_per_s: f64,
}

impl WeatherRates {
    /// Returns the three rates with their units.
    pub(super) fn parts(&self) -> [(f64, &'static str); 3] {
        [
            (self.friction_per_s, "μ/s"),
            (self.visibility_mps, "m/s visibility"),
            (self.noise_per_s, "noise/s"),
        ]
    }

    /// Returns how much better the weather gets, for a ranking of actions.
    pub fn mildness(&self) -> f64 {
        // A friction of 0.1 and a visibility of 10 m count alike.
        self.friction_per_s + 0.01 * self.visibility_mps - 0.1 * self.noise_per_s
    }

    /// Returns the rates in words.
    pub(super) fn label(&self) -> String {
        let parts = self.parts();
        let changing = parts.iter().filter(|(per_s, _)| *per_s != 0.0);
        let words: Vec<String> = changing
            .map(|(per_s, unit)| format!("{per_s:+} {unit}"))
            .collect();
        if words.is_empty() {
            "constant".to_owned()
        } else {
            words.join(" ")
        }
    }
}
