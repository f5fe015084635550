//! Rigid-plant bodies carried along a plan.
//!
//! rapier holds nothing of them, so they reach each commanded pose in f64.

use core::f64::consts::TAU;

use parry3d_f64::math::Pose as SurfacePose;

use super::motor::Motor;
use super::world::RapierWorld;
use crate::sim::planar::{Extent, Rect};
use crate::sim::{BodyCommand, Placement, Pose};

/// Body that moves and turns evenly to a commanded pose.
#[derive(Clone)]
pub(super) struct PlaybackBody {
    extent: Extent,
    rect: Rect,
    before: Rect,
    to: Option<Pose>,
}

impl PlaybackBody {
    /// Creates a carried body at the current pose.
    pub(super) fn new(rect: Rect, extent: Extent) -> PlaybackBody {
        PlaybackBody {
            extent,
            rect,
            before: rect,
            to: None,
        }
    }
}

impl Motor for PlaybackBody {
    fn command(&mut self, command: BodyCommand) -> bool {
        match command {
            BodyCommand::Carry { to } => self.to = Some(to),
            BodyCommand::Jump { to } => {
                let (sin, cos) = libm::sincos(to.heading_rad);
                let back_m = self.extent.half_length_m;
                self.rect = Rect {
                    x_m: to.x_m - back_m * cos,
                    y_m: to.y_m - back_m * sin,
                    cos,
                    sin,
                    ..self.rect
                };
                // Otherwise a rewind would mix the pose with the one before
                // the jump.
                self.before = self.rect;
                // A pose from before the jump no longer counts.
                self.to = None;
            }
            _ => return false,
        }
        true
    }

    fn is_carried(&self) -> bool {
        true
    }

    fn begin(&mut self, dt_s: f64) {
        // Without a new pose the body rests.
        let Some(to) = self.to.take() else {
            (self.rect.vx_mps, self.rect.vy_mps) = (0.0, 0.0);
            self.rect.yaw_rate_rad_per_s = 0.0;
            return;
        };
        let (sin, cos) = libm::sincos(to.heading_rad);
        let back_m = self.extent.half_length_m;
        let (x_m, y_m) = (to.x_m - back_m * cos, to.y_m - back_m * sin);
        let heading_rad = libm::atan2(self.rect.sin, self.rect.cos);
        // The shorter way around.
        let turn_rad = libm::remainder(to.heading_rad - heading_rad, TAU);
        self.rect.vx_mps = (x_m - self.rect.x_m) / dt_s;
        self.rect.vy_mps = (y_m - self.rect.y_m) / dt_s;
        self.rect.yaw_rate_rad_per_s = turn_rad / dt_s;
    }

    fn act(&mut self, _: &mut RapierWorld, _: &Rect, dt_s: f64) {
        self.before = self.rect;
        self.rect = after(self.rect, dt_s);
    }

    fn rewind(&mut self, _: &mut RapierWorld, share: f64) {
        let mix = |from: f64, to: f64| from + share * (to - from);
        let turn_rad = self.before.turn_rad_to(&self.rect);
        // Turn the unit vector instead of mixing it, which would shorten it.
        let Rect { cos, sin, .. } = self.before.turned(share * turn_rad);
        self.rect = Rect {
            x_m: mix(self.before.x_m, self.rect.x_m),
            y_m: mix(self.before.y_m, self.rect.y_m),
            cos,
            sin,
            ..self.rect
        };
    }

    fn rect(&self, _: &RapierWorld) -> Rect {
        self.rect
    }

    fn pose(&self, world: &RapierWorld, rect: &Rect) -> SurfacePose {
        let point = world.surface_at(rect.x_m, rect.y_m);
        point.map_or(SurfacePose::IDENTITY, |point| point.pose(rect))
    }

    fn placement(&self, world: &RapierWorld, height_m: f64) -> Placement {
        if let Some(point) = world.surface_at(self.rect.x_m, self.rect.y_m) {
            return point.placement(&self.rect, height_m);
        }
        let heading_rad = libm::atan2(self.rect.sin, self.rect.cos);
        Placement::upright([self.rect.x_m, self.rect.y_m, 0.5 * height_m], heading_rad)
    }

    fn fork(&self) -> Box<dyn Motor> {
        Box::new(self.clone())
    }
}

/// Returns a rectangle after a time at its velocity and yaw rate.
fn after(rect: Rect, dt_s: f64) -> Rect {
    // Without a turn keep the exact bits, so that a straight motion does not drift.
    let turned = if rect.yaw_rate_rad_per_s == 0.0 {
        rect
    } else {
        rect.turned(rect.yaw_rate_rad_per_s * dt_s)
    };
    Rect {
        x_m: rect.x_m + rect.vx_mps * dt_s,
        y_m: rect.y_m + rect.vy_mps * dt_s,
        ..turned
    }
}
