//! Walkers of the rigid plant, in the closed form of the kinematic plant.
//!
//! Their dynamics do not justify a rigid body.

use parry3d_f64::math::Pose as SurfacePose;

use super::motor::Motor;
use super::world::RapierWorld;
use crate::sim::planar::Rect;
use crate::sim::walker::Stride;
use crate::sim::{BodyCommand, Placement, Walker};

/// Walker with its commanded velocity.
#[derive(Clone)]
pub(super) struct Foot {
    walker: Walker,
    stride: Stride,
    /// State at the beginning of the last step.
    before: Stride,
    target_mps: (f64, f64),
    /// Heading at the spawn, which a walker keeps.
    heading: (f64, f64),
}

impl Foot {
    /// Creates a walker that keeps its spawn velocity, within its limit.
    pub(super) fn new(walker: &Walker, rect: &Rect) -> Foot {
        let velocity_mps = walker.within_limit(rect.vx_mps, rect.vy_mps);
        let stride = Stride {
            at_m: (rect.x_m, rect.y_m),
            velocity_mps,
        };
        let heading = (rect.cos, rect.sin);
        Foot {
            walker: walker.clone(),
            stride,
            before: stride,
            target_mps: velocity_mps,
            heading,
        }
    }
}

impl Motor for Foot {
    fn command(&mut self, command: BodyCommand) -> bool {
        let BodyCommand::Walk { x_mps, y_mps } = command else {
            return false;
        };
        self.target_mps = self.walker.within_limit(x_mps, y_mps);
        true
    }

    fn act(&mut self, _: &mut RapierWorld, _: &Rect, dt_s: f64) {
        self.before = self.stride;
        let ramp = self.walker.ramp(self.stride.velocity_mps, self.target_mps);
        self.stride = self.stride.after(&ramp, dt_s);
    }

    fn rewind(&mut self, _: &mut RapierWorld, share: f64) {
        // Linear within the step, like the sweep in which the contact was found.
        let mix = |from: f64, to: f64| from + share * (to - from);
        let (a, b) = (self.before, self.stride);
        let (from_mps, to_mps) = (a.velocity_mps, b.velocity_mps);
        self.stride = Stride {
            at_m: (mix(a.at_m.0, b.at_m.0), mix(a.at_m.1, b.at_m.1)),
            velocity_mps: (mix(from_mps.0, to_mps.0), mix(from_mps.1, to_mps.1)),
        };
    }

    fn rect(&self, _: &RapierWorld) -> Rect {
        let Stride {
            at_m: (x_m, y_m),
            velocity_mps: (vx_mps, vy_mps),
        } = self.stride;
        let (cos, sin) = self.heading;
        Rect {
            x_m,
            y_m,
            cos,
            sin,
            vx_mps,
            vy_mps,
            // The model has no turn: a walker keeps its heading.
            yaw_rate_rad_per_s: 0.0,
        }
    }

    fn pose(&self, world: &RapierWorld, rect: &Rect) -> SurfacePose {
        let point = world.surface_at(rect.x_m, rect.y_m);
        point.map_or(SurfacePose::IDENTITY, |point| point.upright(rect))
    }

    fn placement(&self, world: &RapierWorld, height_m: f64) -> Placement {
        let (x_m, y_m) = self.stride.at_m;
        let heading_rad = libm::atan2(self.heading.1, self.heading.0);
        let z_m = world.height_m(x_m, y_m) + 0.5 * height_m;
        Placement::upright([x_m, y_m, z_m], heading_rad)
    }

    fn fork(&self) -> Box<dyn Motor> {
        Box::new(self.clone())
    }
}
