//! Keys and pedals of a sample.

use serde::{Deserialize, Serialize};

/// What your keys say at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DriveInput {
    /// Acceleration of the ego, m/s².
    pub accel_mps2: f64,
    /// Speed of the ego across the road, to the left, m/s.
    pub lateral_mps: f64,
    /// Action of your ado. `None`: its neutral one.
    pub action: Option<usize>,
}

/// Strongest commands that keys give. Actuators and tyres limit them further.
const MOST_ACCEL_MPS2: f64 = 9.0;
const MOST_LATERAL_MPS: f64 = 3.0;

impl DriveInput {
    /// Returns the input within what keys may ask. A value that is no number is none.
    pub fn bounded(self) -> DriveInput {
        let within = |value: f64, most: f64| {
            if value.is_finite() {
                value.clamp(-most, most)
            } else {
                0.0
            }
        };
        DriveInput {
            accel_mps2: within(self.accel_mps2, MOST_ACCEL_MPS2),
            lateral_mps: within(self.lateral_mps, MOST_LATERAL_MPS),
            action: self.action,
        }
    }
}
