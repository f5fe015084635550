//! Height, pitch and roll of bodies.

use serde::Serialize;

use super::world::DriveWorld;
use crate::scene::{Placement, Pose};
use crate::sim::{PlantKind, wrapped};
use nalgebra::Vector3;

/// Height and tilt of a body, in the frame of the world.
///
/// Positive angles lower the front and lift the left side (ISO 8855).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BodyAttitude {
    /// Height of the lower edge of its box, in the middle of the front. 0 on a flat road.
    pub z_m: f64,
    /// Angle about its axis to the left.
    pub pitch_rad: f64,
    /// Angle about its axis to the front.
    pub roll_rad: f64,
}

impl DriveWorld {
    /// Returns the attitude of a body that lies on a road, from its pose on the ground.
    pub fn attitude_on(&self, road: usize, pose: &Pose) -> BodyAttitude {
        let at = self.courses()[road].locate(pose);
        let profile = self.spec().profile_of(road);
        let (rise, bank) = (profile.rise(at.s_m), profile.bank(at.s_m));
        let (sin, cos) = libm::sincos(wrapped(at.heading_rad));
        BodyAttitude {
            z_m: profile.height_m(at.s_m, at.lateral_m),
            // Gradients of the surface along and across the heading. Climbing
            // is a negative pitch.
            pitch_rad: -libm::atan(rise * cos + bank * sin),
            roll_rad: -libm::atan(rise * sin - bank * cos),
        }
    }

    /// Returns the attitude of an agent.
    ///
    /// The rigid plant drives on the surface, so `placement` has it. The kinematic plant
    /// moves in the plane, and its bodies lie on their roads.
    pub fn attitude(&self, agent: usize, pose: &Pose, placement: &Placement) -> BodyAttitude {
        let agent = &self.spec().agents[agent];
        // The kinematic plant knows no height, so its bodies lie on the road.
        if self.spec().plant == PlantKind::Kinematic {
            return self.attitude_on(agent.road, pose);
        }
        let (pitch_rad, roll_rad) = placement.pitch_roll_rad();
        let to_front_m = Vector3::new(agent.body.half_length_m(), 0.0, -0.5 * agent.body.height_m);
        BodyAttitude {
            z_m: placement.centre_m[2] + (placement.rotation * to_front_m).z,
            pitch_rad,
            roll_rad,
        }
    }
}
