//! Kinematic bodies carried along a recorded motion or a plan.

use core::f64::consts::TAU;

use super::path::{Anchor, AnchorMotion, BodyPath, PathKind};
use crate::sim::walker::length;

/// Bodies that a carried body passes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Passing {
    /// Bodies that pass through it as well.
    Others,
    Nothing,
}

/// Pose of the fixed point after the next `advance`.
#[derive(Clone, Debug)]
pub(super) struct PlaybackPose {
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: f64,
    pub passing: Passing,
}

impl PlaybackPose {
    /// Returns the path there, at constant velocity and yaw rate.
    pub(super) fn path(&self, start: Anchor, arm_m: f64, dt_s: f64) -> BodyPath {
        let (vx_mps, vy_mps) = ((self.x_m - start.x_m) / dt_s, (self.y_m - start.y_m) / dt_s);
        // The shorter way around, whatever turns the recorded headings contain.
        let turn_rad = libm::remainder(self.heading_rad - start.heading_rad, TAU);
        let yaw_rate_rad_per_s = turn_rad / dt_s;
        let turning_mps = yaw_rate_rad_per_s.abs() * arm_m;
        BodyPath {
            start: Anchor {
                walk_mps: (vx_mps, vy_mps),
                yaw_rate_rad_per_s,
                ..start
            },
            kind: PathKind::Even,
            speed_bound_mps: length(vx_mps, vy_mps) + turning_mps,
            // The fixed point itself is not accelerated, so only the turn contributes.
            accel_bound_mps2: turning_mps * yaw_rate_rad_per_s.abs(),
        }
    }

    /// Returns the motion of the fixed point.
    pub(super) fn motion(at: &Anchor) -> AnchorMotion {
        let (vx, vy) = at.walk_mps;
        AnchorMotion {
            speed_mps: vx * at.cos + vy * at.sin,
            lateral_mps: vy * at.cos - vx * at.sin,
            yaw_rate_rad_per_s: at.yaw_rate_rad_per_s,
        }
    }

    /// Returns the state of the fixed point after a time.
    pub(super) fn after(start: Anchor, after_s: f64) -> Anchor {
        let heading_rad = start.heading_rad + start.yaw_rate_rad_per_s * after_s;
        // Without a turn keep the exact bits, so that a straight motion does not drift.
        let (sin, cos) = if start.yaw_rate_rad_per_s == 0.0 {
            (start.sin, start.cos)
        } else {
            libm::sincos(heading_rad)
        };
        Anchor {
            x_m: start.x_m + start.walk_mps.0 * after_s,
            y_m: start.y_m + start.walk_mps.1 * after_s,
            heading_rad,
            cos,
            sin,
            ..start
        }
    }
}
