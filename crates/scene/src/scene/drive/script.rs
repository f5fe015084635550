//! Background traffic that follows a script.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::ego::{Actuated, Idm};

/// Deceleration that keeps a standing road user in place.
const HELD_MPS2: f64 = 3.0;

/// Script of a background road user.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum Script {
    /// Keeps its initial speed.
    ConstantSpeed,
    /// Stands with its brakes on, like a parked car.
    Stand,
    /// Net accelerations with their start times: `[(at_s, accel_mps2), …]`.
    Profile(Vec<(f64, f64)>),
    /// Follows the leader in its lane by the intelligent driver model.
    ///
    /// Traffic has no actuators, so the written lag has no effect.
    Idm(Actuated<Idm>),
    /// Velocities of a pedestrian with their start times.
    ///
    /// Along the road and to the left: `[(at_s, along_mps, left_mps), …]`.
    Walk(Vec<(f64, f64, f64)>),
}

impl Script {
    /// Returns whether it is for pedestrians.
    pub fn is_on_foot(&self) -> bool {
        matches!(self, Script::Walk(_))
    }

    /// Returns the net acceleration at a time.
    ///
    /// `leader` returns the clearance and the speed of the leader.
    pub(super) fn accel_mps2(
        &self,
        time_s: f64,
        speed_mps: f64,
        leader: impl FnOnce() -> Option<(f64, f64)>,
    ) -> f64 {
        match self {
            Script::ConstantSpeed | Script::Walk(_) => 0.0,
            Script::Stand => -HELD_MPS2,
            Script::Idm(idm) => idm.controller.accel_mps2(speed_mps, leader()),
            Script::Profile(points) => points
                // Times of samples are products and may lie just below the
                // written value.
                .iter()
                .take_while(|(at_s, _)| *at_s <= time_s + 1e-9)
                .last()
                .map_or(0.0, |(_, accel_mps2)| *accel_mps2),
        }
    }

    /// Returns the velocity along the road and to the left at a time.
    pub(super) fn walk_mps(&self, time_s: f64) -> (f64, f64) {
        let Script::Walk(points) = self else {
            return (0.0, 0.0);
        };
        points
            .iter()
            .take_while(|(at_s, ..)| *at_s <= time_s + 1e-9)
            .last()
            .map_or((0.0, 0.0), |&(_, along_mps, left_mps)| {
                (along_mps, left_mps)
            })
    }
}
