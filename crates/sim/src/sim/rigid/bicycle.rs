//! Cyclists of the rigid plant, with the model of the kinematic plant.
//!
//! rapier holds nothing of them until bodies collide.

use parry3d_f64::math::Pose as SurfacePose;

use super::motor::Motor;
use super::world::RapierWorld;
use crate::sim::planar::Rect;
use crate::sim::riding::{CyclistLimits, Ride};
use crate::sim::{Body, BodyCommand, Cyclist, Ground, Placement, Push};

/// Cyclist with the current command.
#[derive(Clone)]
pub(super) struct Bicycle {
    limits: CyclistLimits,
    /// Distance from the middle of the length back to the rear axle.
    behind_m: f64,
    /// State of the rear axle.
    ride: Ride,
    /// State at the beginning of the last step.
    before: Ride,
    /// Net acceleration and curvature.
    command: (f64, f64),
}

impl Bicycle {
    /// Creates a cyclist that keeps the spawn speed, within its limit.
    pub(super) fn new(body: &Body, cyclist: &Cyclist, ground: Ground, rect: &Rect) -> Bicycle {
        let limits = CyclistLimits::new(body, cyclist, ground);
        let behind_m = -cyclist.rear_axle_ahead_m(&body.dimensions());
        let ride = Ride {
            at_m: (
                rect.x_m - behind_m * rect.cos,
                rect.y_m - behind_m * rect.sin,
            ),
            // A footprint keeps no angle, but the model integrates one.
            heading_rad: libm::atan2(rect.sin, rect.cos),
            direction: (rect.cos, rect.sin),
            speed_mps: limits.within_limit(rect.along_mps()),
            curvature_per_m: 0.0,
        };
        Bicycle {
            limits,
            behind_m,
            ride,
            before: ride,
            command: (0.0, 0.0),
        }
    }

    /// Returns the footprint of a state.
    fn rect_of(&self, ride: &Ride) -> Rect {
        let (cos, sin) = ride.direction;
        let yaw_rate_rad_per_s = ride.speed_mps * ride.curvature_per_m;
        // The middle of the length swings outwards of the rear axle's path.
        let left_mps = yaw_rate_rad_per_s * self.behind_m;
        Rect {
            x_m: ride.at_m.0 + self.behind_m * cos,
            y_m: ride.at_m.1 + self.behind_m * sin,
            cos,
            sin,
            vx_mps: ride.speed_mps * cos - left_mps * sin,
            vy_mps: ride.speed_mps * sin + left_mps * cos,
            yaw_rate_rad_per_s,
        }
    }
}

impl Motor for Bicycle {
    fn command(&mut self, command: BodyCommand) -> bool {
        command.drive().map(|drive| self.command = drive).is_some()
    }

    fn set_ground(&mut self, ground: Ground) {
        self.limits.set_ground(ground);
    }

    fn set_push(&mut self, push: Push) {
        self.limits.set_push(push);
    }

    fn act(&mut self, _: &mut RapierWorld, _: &Rect, dt_s: f64) {
        self.before = self.ride;
        let (accel_mps2, curvature_per_m) = self.command;
        let step = self
            .limits
            .step(accel_mps2, curvature_per_m, self.ride.speed_mps, dt_s);
        self.ride = step.after(&step.begin(self.ride), dt_s);
    }

    fn rewind(&mut self, _: &mut RapierWorld, share: f64) {
        // Linear within the step, like the sweep in which the contact was found: the
        // middle of the length moves evenly, and the body turns evenly about it.
        let (from, to) = (self.rect_of(&self.before), self.rect_of(&self.ride));
        let mix = |from: f64, to: f64| from + share * (to - from);
        let turn_rad = share * from.turn_rad_to(&to);
        let Rect { cos, sin, .. } = from.turned(turn_rad);
        self.ride = Ride {
            at_m: (
                mix(from.x_m, to.x_m) - self.behind_m * cos,
                mix(from.y_m, to.y_m) - self.behind_m * sin,
            ),
            heading_rad: self.before.heading_rad + turn_rad,
            direction: (cos, sin),
            speed_mps: mix(self.before.speed_mps, self.ride.speed_mps),
            curvature_per_m: mix(self.before.curvature_per_m, self.ride.curvature_per_m),
        };
    }

    fn rect(&self, _: &RapierWorld) -> Rect {
        self.rect_of(&self.ride)
    }

    fn pose(&self, world: &RapierWorld, rect: &Rect) -> SurfacePose {
        let point = world.surface_at(rect.x_m, rect.y_m);
        point.map_or(SurfacePose::IDENTITY, |point| point.pose(rect))
    }

    fn placement(&self, world: &RapierWorld, height_m: f64) -> Placement {
        let rect = self.rect_of(&self.ride);
        match world.surface_at(rect.x_m, rect.y_m) {
            Some(point) => point.placement(&rect, height_m),
            None => Placement::upright([rect.x_m, rect.y_m, 0.5 * height_m], self.ride.heading_rad),
        }
    }

    fn fork(&self) -> Box<dyn Motor> {
        Box::new(self.clone())
    }
}
