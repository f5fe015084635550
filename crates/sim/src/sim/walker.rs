//! Bodies on foot, evenly accelerated to the commanded velocity.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::BodyControl;
use super::body_model::{BodyDimensions, BodyModel, InvalidBody, within};

/// Limits of a body on foot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Walker {
    /// Greatest speed.
    pub max_speed_mps: f64,
    /// Rate of change of the velocity, in any direction.
    pub accel_mps2: f64,
}

impl BodyModel for Walker {
    fn validate(&self, _: &BodyDimensions) -> Result<(), InvalidBody> {
        within("max_speed_mps", self.max_speed_mps, 0.01, 15.0)?;
        within("accel_mps2", self.accel_mps2, 0.01, 100.0)
    }

    fn control(&self) -> BodyControl {
        BodyControl::Walk
    }

    /// Returns the road space, twice as much across as along.
    ///
    /// A walker may be turned across the road and may walk to either side.
    fn room_m(&self, size: &BodyDimensions) -> (f64, f64) {
        let any_way_m = size.length_m.max(size.width_m);
        (any_way_m, 2.0 * any_way_m)
    }

    fn lever_m(&self) -> f64 {
        0.0
    }
}

/// Position and velocity of a walker's centre in the world frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stride {
    pub at_m: (f64, f64),
    pub velocity_mps: (f64, f64),
}

/// Constant acceleration and its duration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ramp {
    pub accel_mps2: (f64, f64),
    pub until_s: f64,
}

impl Stride {
    /// Returns the state after a time on a ramp, in closed form.
    pub(super) fn after(&self, ramp: &Ramp, after_s: f64) -> Stride {
        // Evenly accelerated first, then at constant speed.
        let ramp_s = after_s.min(ramp.until_s);
        let along = |at_m: f64, before_mps: f64, accel_mps2: f64| {
            let after_mps = before_mps + accel_mps2 * ramp_s;
            let ramp_m = 0.5 * (before_mps + after_mps) * ramp_s;
            (at_m + ramp_m + after_mps * (after_s - ramp_s), after_mps)
        };
        let (x_m, vx_mps) = along(self.at_m.0, self.velocity_mps.0, ramp.accel_mps2.0);
        let (y_m, vy_mps) = along(self.at_m.1, self.velocity_mps.1, ramp.accel_mps2.1);
        Stride {
            at_m: (x_m, y_m),
            velocity_mps: (vx_mps, vy_mps),
        }
    }
}

impl Walker {
    /// Limits a velocity to the walker's top speed, keeping its direction.
    pub(super) fn within_limit(&self, x_mps: f64, y_mps: f64) -> (f64, f64) {
        let speed_mps = length(x_mps, y_mps);
        if speed_mps <= self.max_speed_mps {
            return (x_mps, y_mps);
        }
        // Scale both components, so that the direction of the walk is kept.
        let scale = self.max_speed_mps / speed_mps;
        (x_mps * scale, y_mps * scale)
    }

    /// Returns the ramp from one velocity to another.
    pub(super) fn ramp(&self, from_mps: (f64, f64), to_mps: (f64, f64)) -> Ramp {
        let (dx, dy) = (to_mps.0 - from_mps.0, to_mps.1 - from_mps.1);
        let change_mps = length(dx, dy);
        // No direction to accelerate in, and no division by a length of 0.
        if change_mps == 0.0 {
            return Ramp {
                accel_mps2: (0.0, 0.0),
                until_s: 0.0,
            };
        }
        let scale = self.accel_mps2 / change_mps;
        Ramp {
            accel_mps2: (dx * scale, dy * scale),
            until_s: change_mps / self.accel_mps2,
        }
    }
}

/// Returns the Euclidean length of a vector.
pub(super) fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}
