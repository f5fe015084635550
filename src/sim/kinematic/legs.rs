//! Walkers of the kinematic plant: the velocity of the centre changes evenly.

use super::path::{Anchor, Path, PathKind};
use crate::sim::walker::{Ramp, Stride, length};
use crate::sim::{BodyCommand, Walker};

/// What a walker can do, and the velocity it is asked for.
#[derive(Clone, Debug)]
pub(super) struct Legs {
    walker: Walker,
    target_mps: (f64, f64),
}

impl Legs {
    /// It walks on at the velocity it is spawned with, within its limit.
    pub fn new(walker: &Walker, velocity_mps: (f64, f64)) -> Legs {
        Legs {
            walker: walker.clone(),
            target_mps: walker.within_limit(velocity_mps),
        }
    }

    /// The velocity that is asked for.
    pub fn target_mps(&self) -> (f64, f64) {
        self.target_mps
    }

    /// Whether the command is one for walkers.
    pub fn command(&mut self, command: BodyCommand) -> bool {
        let BodyCommand::Walk { x_mps, y_mps } = command else {
            return false;
        };
        self.target_mps = self.walker.within_limit((x_mps, y_mps));
        true
    }

    pub fn path(&self, start: Anchor) -> Path {
        let ramp = self.walker.ramp(start.walk_mps, self.target_mps);
        Path {
            start,
            kind: PathKind::Ramp(ramp),
            speed_bound_mps: length(start.walk_mps).max(length(self.target_mps)),
            accel_bound_mps2: length(ramp.accel_mps2),
        }
    }

    /// Speed along the heading, speed to the left, and yaw rate.
    pub fn motion(at: &Anchor) -> (f64, f64, f64) {
        let (vx, vy) = at.walk_mps;
        (vx * at.cos + vy * at.sin, vy * at.cos - vx * at.sin, 0.0)
    }

    /// Where the centre is after a time on its way.
    pub fn after(start: Anchor, ramp: Ramp, after_s: f64) -> Anchor {
        let stride = Stride {
            at_m: (start.x_m, start.y_m),
            velocity_mps: start.walk_mps,
        };
        let Stride {
            at_m: (x_m, y_m),
            velocity_mps: walk_mps,
        } = stride.after(&ramp, after_s);
        Anchor {
            x_m,
            y_m,
            walk_mps,
            ..start
        }
    }
}
