//! Background traffic: road users that follow a plan.

use serde::{Deserialize, Serialize};

use crate::ego::{Actuated, Idm};

/// Deceleration by which who stands is held.
const HELD_MPS2: f64 = 3.0;

/// A background road user's plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Script {
    /// Keeps its initial speed.
    ConstantSpeed,
    /// Stands with its brakes on, as parked cars do.
    Stand,
    /// Net accelerations, each from its time on: `[(at_s, accel_mps2), …]`.
    Profile(Vec<(f64, f64)>),
    /// Follows whoever is ahead in its lane, by the intelligent driver model.
    /// Traffic has no actuators: the lag that is written is not used.
    Idm(Actuated<Idm>),
    /// On foot: velocities along the road and to the left, each from its time
    /// on: `[(at_s, along_mps, left_mps), …]`.
    Walk(Vec<(f64, f64, f64)>),
}

impl Script {
    /// Whether it is for somebody on foot.
    pub fn is_on_foot(&self) -> bool {
        matches!(self, Script::Walk(_))
    }

    /// Net acceleration at a time; `leader` is the clearance and the speed.
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
                .iter()
                .take_while(|(at_s, _)| *at_s <= time_s + 1e-9)
                .last()
                .map_or(0.0, |(_, accel_mps2)| *accel_mps2),
        }
    }

    /// Velocity along the road and to the left at a time.
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
