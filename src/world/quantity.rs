//! What a family of egos varies, and how far.

use rand::{Rng, RngExt};
use serde::Serialize;

use crate::ego::{Actuated, ControllerSpec};
use crate::scene::drive::{DriveSpec, EgoVariant};

/// What a family varies.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum Varied {
    /// A parameter of the ego's controller.
    Ego(String),
    /// Age of what the ego sees.
    Delay,
    /// Noise of what the ego sees of positions.
    PositionNoise,
    /// Noise of what the ego sees of speeds.
    SpeedNoise,
    /// The road surface.
    Friction,
}

impl Varied {
    /// Its name in files.
    pub fn name(&self) -> &str {
        match self {
            Varied::Ego(name) => name,
            Varied::Delay => "delay_s",
            Varied::PositionNoise => "position_sd_m",
            Varied::SpeedNoise => "speed_sd_mps",
            Varied::Friction => "friction",
        }
    }

    /// Its value in a driving scene; `None`: the ego has no such parameter.
    pub(super) fn read(&self, spec: &DriveSpec) -> Option<f64> {
        match self {
            Varied::Ego(name) => parameter(&controller(spec)?, name),
            Varied::Delay => Some(spec.sensors.delay_s),
            Varied::PositionNoise => Some(spec.sensors.position_sd_m),
            Varied::SpeedNoise => Some(spec.sensors.speed_sd_mps),
            Varied::Friction => Some(spec.road.friction()),
        }
    }

    /// Gives it another value in an ego of this controller.
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

    /// Whether it is noise: unseen in what an ego does on average.
    pub fn is_noise(&self) -> bool {
        matches!(self, Varied::PositionNoise | Varied::SpeedNoise)
    }
}

/// One varied quantity and its range.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// What is varied.
    pub varied: Varied,
    /// Least value.
    pub lo: f64,
    /// Greatest value.
    pub hi: f64,
    /// The value of the world's own ego, within the range.
    pub nominal: f64,
    /// Values are whole multiples of this; 0: any value.
    pub step: f64,
}

impl Quantity {
    /// Whether a value lies in the range.
    pub fn contains(&self, value: f64) -> bool {
        (self.lo..=self.hi).contains(&value)
    }

    /// The nearest value that a member can have.
    pub fn fit(&self, value: f64) -> f64 {
        let value = value.clamp(self.lo, self.hi);
        match self.step == 0.0 {
            true => value,
            // 6 · 0.05 is more than 0.3.
            false => ((value / self.step).round() * self.step).clamp(self.lo, self.hi),
        }
    }

    /// A value on the scale from −1 at the least one to 1 at the greatest.
    pub(super) fn scaled(&self, value: f64) -> f64 {
        (2.0 * value - self.lo - self.hi) / (self.hi - self.lo)
    }

    /// The nominal value on that scale.
    pub fn unit(&self) -> f64 {
        self.scaled(self.nominal)
    }

    /// The value at a place on that scale.
    pub fn at(&self, unit: f64) -> f64 {
        self.fit(0.5 * (self.lo + self.hi + unit * (self.hi - self.lo)))
    }

    /// All values on that scale, if there are finitely many.
    pub fn steps(&self) -> Vec<f64> {
        match self.step == 0.0 {
            true => Vec::new(),
            false => {
                let count = ((self.hi - self.lo) / self.step).round() as u64;
                let values = (0..=count).map(|i| self.lo + self.step * i as f64);
                values.map(|value| self.scaled(value)).collect()
            }
        }
    }

    pub(super) fn draw(&self, rng: &mut impl Rng) -> f64 {
        self.fit(match self.step == 0.0 {
            true => self.lo + (self.hi - self.lo) * rng.random::<f64>(),
            // Every multiple in the range is equally likely.
            false => {
                let count = ((self.hi - self.lo) / self.step).round() as u64 + 1;
                self.lo + self.step * rng.random_range(0..count) as f64
            }
        })
    }
}

/// The stock controller of a scene's ego, and its actuator.
pub(super) fn controller(spec: &DriveSpec) -> Option<Actuated<ControllerSpec>> {
    spec.ego.stock()
}

pub(super) fn parameter(controller: &Actuated<ControllerSpec>, name: &str) -> Option<f64> {
    let parameters = controller.parameters();
    let found = parameters.iter().find(|p| p.name == name)?;
    Some(found.value)
}
