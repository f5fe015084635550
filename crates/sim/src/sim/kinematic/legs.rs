//! Walkers of the kinematic plant: the velocity of the centre changes evenly.

use super::path::{Anchor, AnchorMotion, BodyPath, PathKind};
use crate::sim::walker::{Ramp, Stride, length};
use crate::sim::{BodyCommand, Walker};

/// Walker data and the commanded velocity.
#[derive(Clone, Debug)]
pub(super) struct Legs {
    walker: Walker,
    target_mps: (f64, f64),
}

impl Legs {
    /// Creates a walker that keeps its spawn velocity, within its limit.
    pub(super) fn new(walker: &Walker, velocity_mps: (f64, f64)) -> Legs {
        Legs {
            walker: walker.clone(),
            target_mps: walker.within_limit(velocity_mps.0, velocity_mps.1),
        }
    }

    /// Returns the commanded velocity.
    pub(super) fn target_mps(&self) -> (f64, f64) {
        self.target_mps
    }

    /// Sets the command, or returns false if it is not for walkers.
    pub(super) fn command(&mut self, command: BodyCommand) -> bool {
        let BodyCommand::Walk { x_mps, y_mps } = command else {
            return false;
        };
        self.target_mps = self.walker.within_limit(x_mps, y_mps);
        true
    }

    pub(super) fn path(&self, start: Anchor) -> BodyPath {
        let (from_mps, to_mps) = (start.walk_mps, self.target_mps);
        let ramp = self.walker.ramp(from_mps, to_mps);
        BodyPath {
            start,
            kind: PathKind::Ramp(ramp),
            // Along a straight ramp the speed is convex in time, so an end has the largest.
            speed_bound_mps: length(from_mps.0, from_mps.1).max(length(to_mps.0, to_mps.1)),
            accel_bound_mps2: length(ramp.accel_mps2.0, ramp.accel_mps2.1),
        }
    }

    /// Returns the motion of the centre.
    pub(super) fn motion(at: &Anchor) -> AnchorMotion {
        let (vx, vy) = at.walk_mps;
        AnchorMotion {
            speed_mps: vx * at.cos + vy * at.sin,
            lateral_mps: vy * at.cos - vx * at.sin,
            yaw_rate_rad_per_s: 0.0,
        }
    }

    /// Returns the state of the centre after a time.
    pub(super) fn after(start: Anchor, ramp: Ramp, after_s: f64) -> Anchor {
        let stride = Stride {
            at_m: (start.x_m, start.y_m),
            velocity_mps: start.walk_mps,
        };
        // In the world frame, whatever the heading: a walker may go sideways.
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
