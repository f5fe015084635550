//! Wheeled bodies: chassis, engine and tyres. Their limits are in `limits`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::body_model::{BodyDimensions, BodyModel, InvalidBody, within};
use super::handling::{Brakes, Tyres};
use super::{BodyControl, GRAVITY_MPS2};

/// Chassis, engine and tyres of a wheeled vehicle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Vehicle {
    /// Distance from the front axle to the rear axle.
    pub wheelbase_m: f64,
    /// Distance from the left wheels to the right wheels.
    pub track_m: f64,
    /// Distance from the front bumper to the front axle.
    pub front_overhang_m: f64,
    /// Radius of every wheel.
    pub wheel_radius_m: f64,
    /// Greatest engine power at the wheels.
    pub power_w: f64,
    /// Factor on the road's friction, 1 for tyres that use all of it.
    #[serde(default = "one")]
    pub grip: f64,
    /// Greatest steering angle of the front wheels.
    #[serde(default = "max_steer")]
    pub max_steer_rad: f64,
    /// Natural frequency of the body on its springs.
    #[serde(default = "suspension_hz")]
    pub suspension_hz: f64,
    /// Damping of the suspension, as a share of critical damping.
    #[serde(default = "suspension_damping")]
    pub suspension_damping: f64,
    /// Length of the unloaded suspension.
    #[serde(default = "suspension_rest")]
    pub suspension_rest_m: f64,
    /// Travel of the suspension from its unloaded length, in both directions.
    #[serde(default = "suspension_travel")]
    pub suspension_travel_m: f64,
    /// Drag coefficient times frontal area, 0 for no air drag.
    #[serde(default)]
    pub drag_area_m2: f64,
    /// Rolling resistance as a share of the weight, 0 for none.
    #[serde(default)]
    pub rolling_resistance: f64,
    /// Greatest rate of the steering angle on the rigid plant, unlimited by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steer_rate_rad_per_s: Option<f64>,
    /// Moment of inertia about the vertical on the rigid plant.
    ///
    /// By default that of a uniform box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yaw_inertia_kg_m2: Option<f64>,
    /// Brakes that need time on the rigid plant, without lag by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brakes: Option<Brakes>,
    /// Tyres that slip on the rigid plant, by default those of rapier.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tyres: Option<Tyres>,
}

impl Vehicle {
    /// Returns the position of the front axle, ahead of the middle of the length.
    pub fn front_axle_ahead_m(&self, size: &BodyDimensions) -> f64 {
        0.5 * size.length_m - self.front_overhang_m
    }

    /// Returns the position of the rear axle, usually negative.
    ///
    /// The position is measured ahead of the middle of the length.
    pub fn rear_axle_ahead_m(&self, size: &BodyDimensions) -> f64 {
        self.front_axle_ahead_m(size) - self.wheelbase_m
    }

    /// Returns the share of the weight on the front axle.
    pub fn front_load_share(&self, size: &BodyDimensions) -> f64 {
        (size.com_ahead_m - self.rear_axle_ahead_m(size)) / self.wheelbase_m
    }

    /// Returns the compression of the suspension under the body's own weight.
    pub fn sag_m(&self) -> f64 {
        // A linear spring of frequency f compresses by g / (2πf)² under its
        // load.
        let omega_per_s = core::f64::consts::TAU * self.suspension_hz;
        GRAVITY_MPS2 / (omega_per_s * omega_per_s)
    }
}

impl BodyModel for Vehicle {
    fn validate(&self, size: &BodyDimensions) -> Result<(), InvalidBody> {
        within("wheelbase_m", self.wheelbase_m, 0.1, size.length_m)?;
        within("track_m", self.track_m, 0.05, size.width_m)?;
        let room_m = size.length_m - self.wheelbase_m;
        within("front_overhang_m", self.front_overhang_m, 0.0, room_m)?;
        within("wheel_radius_m", self.wheel_radius_m, 0.05, size.height_m)?;
        within("power_w", self.power_w, 1.0, 1e7)?;
        within("grip", self.grip, 0.01, 3.0)?;
        // At a larger angle the turn's centre would lie under the inner wheel.
        let most_rad = libm::atan(1.6 * self.wheelbase_m / self.track_m).min(1.4);
        within("max_steer_rad", self.max_steer_rad, 0.01, most_rad)?;
        within("suspension_hz", self.suspension_hz, 0.5, 4.0)?;
        within("suspension_damping", self.suspension_damping, 0.05, 2.0)?;
        within("suspension_rest_m", self.suspension_rest_m, 0.01, 2.0)?;
        // 20 % beyond the static sag, so that the springs carry the weight.
        let least_m = 1.2 * self.sag_m();
        within(
            "suspension_travel_m",
            self.suspension_travel_m,
            least_m,
            2.0,
        )?;
        within("drag_area_m2", self.drag_area_m2, 0.0, 50.0)?;
        within("rolling_resistance", self.rolling_resistance, 0.0, 0.5)?;
        if let Some(rate_rad_per_s) = self.steer_rate_rad_per_s {
            within("steer_rate_rad_per_s", rate_rad_per_s, 0.01, 20.0)?;
        }
        if let Some(inertia_kg_m2) = self.yaw_inertia_kg_m2 {
            within("yaw_inertia_kg_m2", inertia_kg_m2, 0.01, 1e8)?;
        }
        self.brakes.as_ref().map_or(Ok(()), Brakes::validate)?;
        self.tyres.as_ref().map_or(Ok(()), Tyres::validate)?;
        // A narrow, tall body on soft springs would fall over sideways.
        let (omega_per_s, half_m) = (
            core::f64::consts::TAU * self.suspension_hz,
            0.5 * self.track_m,
        );
        let most_m = 0.5 * (omega_per_s * half_m).powi(2) / GRAVITY_MPS2;
        within("com_height_m", size.com_height_m, 0.01, most_m)?;
        // Both axles must carry weight, or the vehicle would tip over its bumper.
        let (rear_m, span_m) = (self.rear_axle_ahead_m(size), self.wheelbase_m);
        let (low_m, high_m) = (rear_m + 0.1 * span_m, rear_m + 0.9 * span_m);
        within("com_ahead_m", size.com_ahead_m, low_m, high_m)
    }

    fn control(&self) -> BodyControl {
        BodyControl::Drive
    }

    fn room_m(&self, size: &BodyDimensions) -> (f64, f64) {
        (size.length_m, size.width_m)
    }

    /// Distance from the rear axle, which follows the path, to the front bumper.
    fn lever_m(&self) -> f64 {
        self.wheelbase_m + self.front_overhang_m
    }
}

fn one() -> f64 {
    1.0
}
fn max_steer() -> f64 {
    0.6
}
fn suspension_hz() -> f64 {
    1.56
}
fn suspension_damping() -> f64 {
    0.5
}
fn suspension_rest() -> f64 {
    0.35
}
fn suspension_travel() -> f64 {
    0.2
}
