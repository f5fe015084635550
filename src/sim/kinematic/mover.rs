//! Body of the kinematic plant and its motion during one `advance`.

use core::f64::consts::{PI, TAU};

use super::engine::Engine;
use super::kinematic_playback::{Passing, PlaybackPose};
use super::path::{Anchor, BodyPath};
use crate::sim::Pose;
use crate::sim::planar::{Extent, Rect, SizedRect};

/// Body with its size, its state and its motion model.
#[derive(Clone, Debug)]
pub(super) struct Mover {
    pub extent: Extent,
    /// Fixed point of the model (rear axle or centre), ahead of the body's centre.
    pub anchor_ahead_m: f64,
    /// State of the fixed point.
    pub at: Anchor,
    pub accel_mps2: f64,
    pub engine: Engine,
}

impl Mover {
    pub(super) fn shape<'a>(&'a self, rect: &'a Rect) -> SizedRect<'a> {
        SizedRect {
            rect,
            extent: &self.extent,
        }
    }

    /// Returns true if the body passes through other gliding bodies.
    pub(super) fn passes_others(&self) -> bool {
        matches!(&self.engine, Engine::Rails(rails) if rails.passing == Passing::Others)
    }

    /// Carries the body from now on, with its front bumper to `to` next.
    pub(super) fn glide(&mut self, to: &Pose, passing: Passing) {
        let (sin, cos) = libm::sincos(to.heading_rad);
        let back_m = self.extent.half_length_m - self.anchor_ahead_m;
        // Rails read the world-frame velocity, which wheels do not maintain. It is set
        // once, so that the next acceleration is measured from the true speed.
        if let Engine::Wheels(_) | Engine::Bicycle(_) = self.engine {
            let Anchor {
                speed_mps,
                cos,
                sin,
                ..
            } = self.at;
            self.at.walk_mps = (speed_mps * cos, speed_mps * sin);
        }
        self.engine = Engine::Rails(PlaybackPose {
            x_m: to.x_m - back_m * cos,
            y_m: to.y_m - back_m * sin,
            heading_rad: to.heading_rad,
            passing,
        });
    }

    pub(super) fn rect(&self, at: &Anchor) -> Rect {
        let (speed_mps, lateral_mps, yaw_rate_rad_per_s) = self.engine.motion(at);
        let back_m = -self.anchor_ahead_m;
        let left_mps = lateral_mps + yaw_rate_rad_per_s * back_m;
        Rect {
            x_m: at.x_m + back_m * at.cos,
            y_m: at.y_m + back_m * at.sin,
            cos: at.cos,
            sin: at.sin,
            vx_mps: speed_mps * at.cos - left_mps * at.sin,
            vy_mps: speed_mps * at.sin + left_mps * at.cos,
            yaw_rate_rad_per_s,
        }
    }

    pub(super) fn path(&self, dt_s: f64) -> BodyPath {
        // Distance of the farthest point of the body from the fixed point.
        let arm_m = self.anchor_ahead_m.abs() + self.extent.radius_m;
        self.engine.path(self.at, arm_m, dt_s)
    }

    pub(super) fn follow(&mut self, path: &BodyPath, elapsed_s: f64) {
        let (before_mps, ..) = self.engine.motion(&self.at);
        self.at = path.at(elapsed_s);
        // Keeps the heading in −π to π, however long a body turns.
        if PI < self.at.heading_rad.abs() {
            self.at.heading_rad -= TAU * libm::round(self.at.heading_rad / TAU);
        }
        let (after_mps, ..) = self.engine.motion(&self.at);
        self.accel_mps2 = (after_mps - before_mps) / elapsed_s;
    }
}
