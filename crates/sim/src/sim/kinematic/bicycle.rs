//! Cyclists of the kinematic plant, integrated in small steps.

use super::path::{Anchor, BodyPath, PathKind};
use crate::sim::riding::{CyclistLimits, Ride, RideBounds, RideStep};
use crate::sim::{Body, BodyCommand, Cyclist, Ground, Push};

/// Limits of a cyclist and the current command.
#[derive(Clone, Debug)]
pub(super) struct Bicycle {
    limits: CyclistLimits,
    rear_axle_ahead_m: f64,
    /// Net acceleration and curvature.
    command: (f64, f64),
}

impl Bicycle {
    pub(super) fn new(body: &Body, cyclist: &Cyclist, ground: Ground) -> Bicycle {
        Bicycle {
            limits: CyclistLimits::new(body, cyclist, ground),
            rear_axle_ahead_m: cyclist.rear_axle_ahead_m(&body.dimensions()),
            command: (0.0, 0.0),
        }
    }

    /// Returns the rear axle's position, ahead of the middle of the length.
    pub(super) fn rear_axle_ahead_m(&self) -> f64 {
        self.rear_axle_ahead_m
    }

    /// Returns the speed at which a cyclist can start.
    pub(super) fn within_limit(&self, speed_mps: f64) -> f64 {
        self.limits.within_limit(speed_mps)
    }

    /// Sets the command, or returns false if it is not for vehicles.
    pub(super) fn command(&mut self, command: BodyCommand) -> bool {
        command.drive().map(|drive| self.command = drive).is_some()
    }

    pub(super) fn set_ground(&mut self, ground: Ground) {
        self.limits.set_ground(ground);
    }

    pub(super) fn set_push(&mut self, push: Push) {
        self.limits.set_push(push);
    }

    pub(super) fn path(&self, start: Anchor, arm_m: f64, dt_s: f64) -> BodyPath {
        let (accel_mps2, curvature_per_m) = self.command;
        let step = self
            .limits
            .step(accel_mps2, curvature_per_m, start.speed_mps, dt_s);
        let ride = step.begin(ride_of(&start));
        let RideBounds {
            speed_mps,
            accel_mps2,
        } = step.bounds(&ride, arm_m, dt_s);
        BodyPath {
            start: Anchor {
                // The clamped curvature, from which `after` integrates.
                curvature_per_m: ride.curvature_per_m,
                ..start
            },
            kind: PathKind::Ride(step),
            speed_bound_mps: speed_mps,
            accel_bound_mps2: accel_mps2,
        }
    }

    /// Returns the state of the rear axle after a time.
    pub(super) fn after(start: Anchor, step: &RideStep, after_s: f64) -> Anchor {
        let Ride {
            at_m: (x_m, y_m),
            heading_rad,
            direction: (cos, sin),
            speed_mps,
            curvature_per_m,
        } = step.after(&ride_of(&start), after_s);
        Anchor {
            x_m,
            y_m,
            heading_rad,
            cos,
            sin,
            speed_mps,
            curvature_per_m,
            ..start
        }
    }
}

fn ride_of(at: &Anchor) -> Ride {
    Ride {
        at_m: (at.x_m, at.y_m),
        heading_rad: at.heading_rad,
        direction: (at.cos, at.sin),
        speed_mps: at.speed_mps,
        curvature_per_m: at.curvature_per_m,
    }
}
