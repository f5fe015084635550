//! Quantities that a family of egos varies, with their ranges.

use rand::{Rng, RngExt};
use serde::Serialize;

use crate::ego::{Actuated, ControllerSpec};
use crate::scene::drive::{DriveSpec, EgoVariant, EnvironmentQuantity};

/// Quantity that a family varies.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum Varied {
    /// Parameter of the ego's controller.
    Ego(String),
    /// Delay of the ego's perception.
    Delay,
    /// Noise of perceived positions.
    PositionNoise,
    /// Noise of perceived speeds.
    SpeedNoise,
    /// Friction of the road surface.
    Friction,
}

impl Varied {
    /// Returns the name in files.
    pub fn name(&self) -> &str {
        match self {
            Varied::Ego(name) => name,
            Varied::Delay => "delay_s",
            Varied::PositionNoise => "position_sd_m",
            Varied::SpeedNoise => "speed_sd_mps",
            Varied::Friction => "friction",
        }
    }

    /// Returns the value in a driving scene. `None` if the ego lacks the parameter.
    pub(super) fn read(&self, spec: &DriveSpec) -> Option<f64> {
        match self {
            Varied::Ego(name) => parameter(&spec.ego.stock()?, name),
            Varied::Delay => Some(spec.sensors.delay_s),
            Varied::PositionNoise => Some(spec.sensors.position_sd_m),
            Varied::SpeedNoise => Some(spec.sensors.speed_sd_mps),
            Varied::Friction => Some(spec.road.friction()),
        }
    }

    /// Sets the value in an ego of this controller.
    pub(super) fn set(&self, variant: &mut EgoVariant, value: f64) {
        match self {
            Varied::Ego(name) => {
                let set = variant.controller.set(name, value);
                // Invariant: checked at load against this controller.
                debug_assert!(set.is_ok(), "{name} is a parameter of the ego");
            }
            Varied::Delay => variant.sensors.delay_s = value,
            Varied::PositionNoise => variant.sensors.position_sd_m = value,
            Varied::SpeedNoise => variant.sensors.speed_sd_mps = value,
            Varied::Friction => variant.friction = value,
        }
    }

    /// Returns true if it is a quantity of the environment.
    pub(super) fn is(&self, quantity: EnvironmentQuantity) -> bool {
        matches!(
            (self, quantity),
            (Varied::Delay, EnvironmentQuantity::SensorDelay)
                | (Varied::PositionNoise, EnvironmentQuantity::PositionNoise)
                | (Varied::SpeedNoise, EnvironmentQuantity::SpeedNoise)
                | (Varied::Friction, EnvironmentQuantity::Friction)
        )
    }
}

/// Varied quantity with its range.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// Varied quantity.
    pub varied: Varied,
    /// Least value.
    pub lo: f64,
    /// Greatest value.
    pub hi: f64,
    /// Value of the world's own ego, within the range.
    pub nominal: f64,
    /// Step of the values, which are its multiples. 0 allows any value.
    pub step: f64,
}

impl Quantity {
    /// Returns true if a value is in the range.
    pub fn contains(&self, value: f64) -> bool {
        (self.lo..=self.hi).contains(&value)
    }

    /// Returns the nearest value that a member can have.
    pub(super) fn fit(&self, value: f64) -> f64 {
        let value = value.clamp(self.lo, self.hi);
        if self.step == 0.0 {
            value
        } else {
            // Clamped again: 6 · 0.05 exceeds 0.3 by rounding.
            ((value / self.step).round() * self.step).clamp(self.lo, self.hi)
        }
    }

    pub(super) fn draw(&self, rng: &mut impl Rng) -> f64 {
        self.fit(if self.step == 0.0 {
            self.lo + (self.hi - self.lo) * rng.random::<f64>()
        } else {
            // Every multiple in the range is equally likely.
            let count = ((self.hi - self.lo) / self.step).round() as u64 + 1;
            self.lo + self.step * rng.random_range(0..count) as f64
        })
    }
}

pub(super) fn parameter(controller: &Actuated<ControllerSpec>, name: &str) -> Option<f64> {
    let parameters = controller.parameters();
    let found = parameters.iter().find(|p| p.name == name)?;
    Some(found.value)
}
