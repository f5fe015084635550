//! Vehicles of the kinematic plant: the rear axle runs along an arc.

use super::path::{Anchor, AnchorMotion, BodyPath, PathKind};
use crate::sim::limits::{DriveStep, VehicleLimits};
use crate::sim::{Body, BodyCommand, Ground, Push, Vehicle};

/// Limits of a vehicle and its current command.
#[derive(Clone, Debug)]
pub(super) struct Wheels {
    limits: VehicleLimits,
    rear_axle_ahead_m: f64,
    accel_mps2: f64,
    curvature_per_m: f64,
}

/// Motion of a vehicle during one `advance`.
#[derive(Clone, Copy, Debug)]
pub(super) struct ArcPath {
    pub start: Anchor,
    pub drive: DriveStep,
    pub speed_bound_mps: f64,
    pub accel_bound_mps2: f64,
}

impl ArcPath {
    /// Returns the same motion as that of any body.
    #[inline(always)]
    pub(super) fn path(self) -> BodyPath {
        BodyPath {
            start: self.start,
            kind: PathKind::Arc(self.drive),
            speed_bound_mps: self.speed_bound_mps,
            accel_bound_mps2: self.accel_bound_mps2,
        }
    }
}

impl Wheels {
    pub(super) fn new(body: &Body, vehicle: &Vehicle, ground: Ground) -> Wheels {
        Wheels {
            limits: VehicleLimits::new(body, vehicle, ground),
            rear_axle_ahead_m: vehicle.rear_axle_ahead_m(&body.dimensions()),
            accel_mps2: 0.0,
            curvature_per_m: 0.0,
        }
    }

    /// Returns the rear axle's position, ahead of the middle of the length.
    pub(super) fn rear_axle_ahead_m(&self) -> f64 {
        self.rear_axle_ahead_m
    }

    /// Sets the command, or returns false if it is not for vehicles.
    pub(super) fn command(&mut self, command: BodyCommand) -> bool {
        let Some(drive) = command.drive() else {
            return false;
        };
        (self.accel_mps2, self.curvature_per_m) = drive;
        true
    }

    pub(super) fn set_ground(&mut self, ground: Ground) {
        self.limits.set_ground(ground);
    }

    pub(super) fn set_push(&mut self, push: Push) {
        self.limits.set_push(push);
    }

    #[inline]
    pub(super) fn path(&self, start: Anchor, arm_m: f64, dt_s: f64) -> BodyPath {
        let (accel_mps2, curvature_per_m) = (self.accel_mps2, self.curvature_per_m);
        self.arc_under(accel_mps2, curvature_per_m, start, arm_m, dt_s)
            .path()
    }

    /// Returns the arc under a commanded acceleration and curvature.
    #[inline(always)]
    pub(super) fn arc_under(
        &self,
        accel_mps2: f64,
        wanted_per_m: f64,
        start: Anchor,
        arm_m: f64,
        dt_s: f64,
    ) -> ArcPath {
        let drive = self.limits.drive(accel_mps2, start.speed_mps, dt_s);
        let end_mps = drive.speed_mps(start.speed_mps, dt_s);
        // The cornering limit must hold at the faster end of the step.
        let top_mps = start.speed_mps.abs().max(end_mps.abs());
        let curvature_per_m = self
            .limits
            .curvature_per_m(wanted_per_m, drive.tyre_mps2, top_mps);
        // Turning adds to the motion of the point farthest from the rear axle.
        let turn = curvature_per_m.abs() * arm_m;
        let centripetal_mps2 = top_mps * top_mps * curvature_per_m.abs() * (1.0 + turn);
        ArcPath {
            start: Anchor {
                curvature_per_m,
                ..start
            },
            drive,
            speed_bound_mps: top_mps * (1.0 + turn),
            // Turning carries the net acceleration of the axle to the farthest
            // point.
            accel_bound_mps2: drive.net_mps2.abs() * (1.0 + turn) + centripetal_mps2,
        }
    }

    /// Returns the motion of the rear axle.
    #[inline]
    pub(super) fn motion(at: &Anchor) -> AnchorMotion {
        AnchorMotion {
            speed_mps: at.speed_mps,
            lateral_mps: 0.0,
            yaw_rate_rad_per_s: at.speed_mps * at.curvature_per_m,
        }
    }

    /// Returns the state of the rear axle after a time on its arc.
    #[inline]
    pub(super) fn after(start: Anchor, drive: DriveStep, after_s: f64) -> Anchor {
        // The arc ends where the vehicle stops, or a brake would drive it
        // backwards.
        let moving_s = after_s.min(drive.rest_after_s);
        let length_m = moving_s * (start.speed_mps + 0.5 * drive.net_mps2 * moving_s);
        let speed_mps = drive.speed_mps(start.speed_mps, after_s);
        let moved = Anchor { speed_mps, ..start };
        // Without curvature the heading keeps its exact bits, and no sine is needed.
        if start.curvature_per_m == 0.0 {
            let (x_m, y_m) = (
                start.x_m + length_m * start.cos,
                start.y_m + length_m * start.sin,
            );
            return Anchor { x_m, y_m, ..moved };
        }
        // The chord of an arc of angle 2u is sin(u)/u times its length.
        let half_turn_rad = 0.5 * start.curvature_per_m * length_m;
        let (half_sin, half_cos) = libm::sincos(half_turn_rad);
        // sin(u)/u rounds to 1 there, and u = 0 must not divide.
        let chord_m = if half_turn_rad.abs() < 1e-6 {
            length_m
        } else {
            length_m * half_sin / half_turn_rad
        };
        let middle_cos = start.cos * half_cos - start.sin * half_sin;
        let middle_sin = start.sin * half_cos + start.cos * half_sin;
        let heading_rad = start.heading_rad + 2.0 * half_turn_rad;
        let (sin, cos) = libm::sincos(heading_rad);
        let (x_m, y_m) = (
            start.x_m + chord_m * middle_cos,
            start.y_m + chord_m * middle_sin,
        );
        Anchor {
            x_m,
            y_m,
            heading_rad,
            cos,
            sin,
            ..moved
        }
    }
}
