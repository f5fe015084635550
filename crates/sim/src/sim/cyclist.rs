//! Bicyclists: legs for an engine, and a balance that must lean before it turns.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::BodyControl;
use super::body_model::{BodyDimensions, BodyModel, InvalidBody, within};

/// Greatest curvature of the path, from twice the balance speed on.
pub(super) const LOCK_PER_M: f64 = 0.6;

/// Limits of a bicycle with its rider.
///
/// Below [`Cyclist::balance_mps`] the path has a radius of 10 m at least. The
/// least radius falls to 1.7 m at twice that speed. A cyclist at rest stands with
/// a foot on the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cyclist {
    /// Distance from the front axle to the rear axle.
    pub wheelbase_m: f64,
    /// Distance from the foremost point to the front axle.
    pub front_overhang_m: f64,
    /// Radius of both wheels.
    pub wheel_radius_m: f64,
    /// Greatest speed.
    pub max_speed_mps: f64,
    /// Greatest acceleration along the heading.
    pub accel_mps2: f64,
    /// Greatest power of the rider, which limits the acceleration at speed.
    pub power_w: f64,
    /// Greatest deceleration.
    pub brake_mps2: f64,
    /// Greatest lateral acceleration, which the lean balances.
    pub max_lateral_mps2: f64,
    /// Greatest rate at which the lateral acceleration changes.
    pub lean_rate_mps3: f64,
    /// Speed below which the rider balances and hardly turns.
    pub balance_mps: f64,
}

impl Cyclist {
    /// Returns the position of the rear axle, ahead of the middle of the length.
    pub(super) fn rear_axle_ahead_m(&self, size: &BodyDimensions) -> f64 {
        0.5 * size.length_m - self.front_overhang_m - self.wheelbase_m
    }

    /// Returns the greatest steering angle, that of the least radius.
    pub fn max_steer_rad(&self) -> f64 {
        // Of the bicycle model: tan δ = κ · L.
        libm::atan(LOCK_PER_M * self.wheelbase_m)
    }

    /// Returns the speed at which a cyclist can start: never backwards.
    pub(super) fn within_limit(&self, speed_mps: f64) -> f64 {
        // A bicycle has no reverse.
        speed_mps.clamp(0.0, self.max_speed_mps)
    }
}

impl BodyModel for Cyclist {
    fn validate(&self, size: &BodyDimensions) -> Result<(), InvalidBody> {
        within("wheelbase_m", self.wheelbase_m, 0.1, size.length_m)?;
        // Within this overhang the rear axle lies inside the body.
        let room_m = size.length_m - self.wheelbase_m;
        within("front_overhang_m", self.front_overhang_m, 0.0, room_m)?;
        within("wheel_radius_m", self.wheel_radius_m, 0.05, size.height_m)?;
        // Wide bounds: they keep the numbers sound, and say nothing about riders.
        within("max_speed_mps", self.max_speed_mps, 0.1, 40.0)?;
        within("accel_mps2", self.accel_mps2, 0.01, 20.0)?;
        within("power_w", self.power_w, 1.0, 1e5)?;
        within("brake_mps2", self.brake_mps2, 0.1, 20.0)?;
        within("max_lateral_mps2", self.max_lateral_mps2, 0.1, 20.0)?;
        within("lean_rate_mps3", self.lean_rate_mps3, 0.1, 1000.0)?;
        within("balance_mps", self.balance_mps, 0.1, 10.0)
    }

    fn control(&self) -> BodyControl {
        BodyControl::Drive
    }

    fn room_m(&self, size: &BodyDimensions) -> (f64, f64) {
        (size.length_m, size.width_m)
    }

    /// Distance from the rear axle, which follows the path, to the front.
    fn lever_m(&self) -> f64 {
        self.wheelbase_m + self.front_overhang_m
    }
}
