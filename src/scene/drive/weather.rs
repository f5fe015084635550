//! Weather that an ado changes: friction, visibility and noise of the sensors.

use serde::{Deserialize, Serialize};

use super::actions::Actions;
use super::range::Range;

/// Weather as an ado. It has no body and acts on the whole scene.
///
/// A quantity without bounds never changes.
#[derive(Clone, Debug)]
pub struct Weather {
    /// Name in signals.
    pub name: String,
    /// Bounds of the coefficient of friction μ, which begins at the road's.
    pub friction: Option<Range>,
    /// Bounds of the visibility, in metres.
    pub visibility_m: Option<Range>,
    /// Visibility at the start, infinite without bounds.
    pub first_visibility_m: f64,
    /// Bounds of the factor on the noise of the ego's sensors, which begins at 1.
    pub noise_scale: Option<Range>,
    /// Action set.
    pub actions: Actions,
    /// Action that changes nothing.
    pub neutral: usize,
}

/// Rates of change of the weather.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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
    pub(super) fn mildness(&self) -> f64 {
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

/// Weather at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WeatherState {
    pub friction: f64,
    /// Distance from the ego's front beyond which it sees no road user.
    pub visibility_m: f64,
    pub noise_scale: f64,
    /// Rates of the last action.
    pub rates: WeatherRates,
    /// Mean rates over the last sample, which bounds may have cut.
    pub changes: WeatherRates,
}

impl WeatherState {
    /// Returns the weather at the start, on a road of a friction.
    pub(super) fn first(weather: &Weather, road_friction: f64) -> WeatherState {
        WeatherState {
            friction: road_friction,
            visibility_m: weather.first_visibility_m,
            noise_scale: 1.0,
            rates: WeatherRates::default(),
            changes: WeatherRates::default(),
        }
    }

    /// Changes the weather by its rates for one sample, within its bounds.
    pub(super) fn change(&mut self, weather: &Weather, sample_s: f64) {
        let WeatherRates {
            friction_per_s,
            visibility_mps,
            noise_per_s,
        } = self.rates;
        let change = |value: &mut f64, per_s: f64, bounds: Option<Range>| {
            let before = *value;
            if let Some(Range { lo, hi }) = bounds {
                // A changed road may begin beyond a bound. It then only moves back.
                *value = (before + per_s * sample_s).clamp(lo.min(before), hi.max(before));
                (*value - before) / sample_s
            } else {
                0.0
            }
        };
        self.changes = WeatherRates {
            friction_per_s: change(&mut self.friction, friction_per_s, weather.friction),
            visibility_mps: change(&mut self.visibility_m, visibility_mps, weather.visibility_m),
            noise_per_s: change(&mut self.noise_scale, noise_per_s, weather.noise_scale),
        };
    }
}
