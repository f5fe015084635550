//! Body of the kinematic plant and its motion during one `advance`.

use super::engine::Engine;
use super::kinematic_playback::{Passing, PlaybackPose};
use super::path::{Anchor, AnchorMotion, BodyPath};
use crate::sim::planar::{Extent, Rect, SizedRect};
use crate::sim::{Body, BodyState, Ground, Pose};

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
    #[inline]
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

    /// Puts a carried body at its next pose at once.
    pub(super) fn arrive(&mut self) {
        let Engine::Rails(rails) = &self.engine else {
            return;
        };
        let (sin, cos) = libm::sincos(rails.heading_rad);
        self.at = Anchor {
            x_m: rails.x_m,
            y_m: rails.y_m,
            heading_rad: rails.heading_rad,
            cos,
            sin,
            ..self.at
        };
    }

    #[inline]
    pub(super) fn rect(&self, at: &Anchor) -> Rect {
        let AnchorMotion {
            speed_mps,
            lateral_mps,
            yaw_rate_rad_per_s,
        } = self.engine.motion(at);
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

    /// Returns a body that has just been spawned.
    pub(super) fn spawned(body: &Body, ground: Ground, pose: Pose, speed_mps: f64) -> Mover {
        let (sin, cos) = libm::sincos(pose.heading_rad);
        let velocity_mps = (speed_mps * cos, speed_mps * sin);
        let engine = Engine::new(body, ground, velocity_mps);
        let (anchor_ahead_m, walk_mps) = engine.anchor();
        let back_m = body.half_length_m() - anchor_ahead_m;
        let at = Anchor {
            // Poses are of the front bumper, the model moves its fixed point.
            x_m: pose.x_m - back_m * cos,
            y_m: pose.y_m - back_m * sin,
            heading_rad: pose.heading_rad,
            cos,
            sin,
            speed_mps: engine.starting_mps(speed_mps),
            curvature_per_m: 0.0,
            walk_mps,
            yaw_rate_rad_per_s: 0.0,
        };
        Mover {
            extent: Extent::of(body),
            anchor_ahead_m,
            at,
            accel_mps2: 0.0,
            engine,
        }
    }

    /// Returns the state of the front bumper.
    #[inline]
    pub(super) fn state(&self) -> BodyState {
        let motion = self.engine.motion(&self.at);
        state_of(&self.at, motion, self.front_ahead_m(), self.accel_mps2)
    }

    /// Returns the distance from the fixed point to the front bumper.
    #[inline]
    pub(super) fn front_ahead_m(&self) -> f64 {
        self.extent.half_length_m - self.anchor_ahead_m
    }

    /// Returns the distance of the farthest point of the body from the fixed point.
    #[inline]
    pub(super) fn arm_m(&self) -> f64 {
        self.anchor_ahead_m.abs() + self.extent.radius_m
    }

    #[inline]
    pub(super) fn path(&self, dt_s: f64) -> BodyPath {
        self.engine.path(self.at, self.arm_m(), dt_s)
    }

    #[inline]
    pub(super) fn follow(&mut self, path: &BodyPath, elapsed_s: f64) {
        let before_mps = self.engine.motion(&self.at).speed_mps;
        self.at = path.at(elapsed_s).unwound();
        let after_mps = self.engine.motion(&self.at).speed_mps;
        // Measured and not commanded, because limits may have cut the command.
        self.accel_mps2 = (after_mps - before_mps) / elapsed_s;
    }
}

/// Returns the state of the front bumper, `ahead_m` ahead of the fixed point.
#[inline(always)]
pub(super) fn state_of(
    at: &Anchor,
    motion: AnchorMotion,
    ahead_m: f64,
    accel_mps2: f64,
) -> BodyState {
    BodyState {
        pose: Pose {
            x_m: at.x_m + ahead_m * at.cos,
            y_m: at.y_m + ahead_m * at.sin,
            heading_rad: at.heading_rad,
        },
        speed_mps: motion.speed_mps,
        // The bumper swings sideways in a turn, the fixed point does not.
        lateral_mps: motion.lateral_mps + motion.yaw_rate_rad_per_s * ahead_m,
        yaw_rate_rad_per_s: motion.yaw_rate_rad_per_s,
        accel_mps2,
    }
}
