//! Weather that an ado changes: friction, visibility and noise of the sensors.

use super::actions::Actions;
use super::range::Range;
use super::weather_rates::WeatherRates;

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
