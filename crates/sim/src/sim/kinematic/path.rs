//! State of a body and its motion during one `advance`.

use core::f64::consts::{PI, TAU};

use crate::sim::limits::DriveStep;
use crate::sim::riding::RideStep;
use crate::sim::walker::Ramp;

/// Distance from the origin beyond which the plant is unsound.
const BOUND_M: f64 = 1e6;

/// State of the fixed point of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: f64,
    pub cos: f64,
    pub sin: f64,
    /// Speed of a vehicle or cyclist along its heading.
    pub speed_mps: f64,
    pub curvature_per_m: f64,
    /// World-frame velocity of a walker or of a carried body.
    pub walk_mps: (f64, f64),
    /// Yaw rate of a carried body.
    pub yaw_rate_rad_per_s: f64,
}

impl Anchor {
    /// Returns the same state with a heading in −π to π, however long a body turns.
    #[inline]
    pub(super) fn unwound(mut self) -> Anchor {
        if self.heading_rad.abs() > PI {
            // Only beyond half a turn: a heading in range keeps its bits.
            self.heading_rad -= TAU * libm::round(self.heading_rad / TAU);
        }
        self
    }

    /// Returns whether the plant is sound here. NaN is not.
    #[inline]
    pub(super) fn is_bounded(&self) -> bool {
        let Anchor {
            x_m,
            y_m,
            heading_rad,
            speed_mps,
            walk_mps,
            ..
        } = self;
        [x_m, y_m, heading_rad, speed_mps, &walk_mps.0, &walk_mps.1]
            .into_iter()
            // Without branches, because this runs for every body at every step.
            .fold(true, |all, value| all & (value.abs() <= BOUND_M))
    }
}

/// Motion of the fixed point of a body at one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct AnchorMotion {
    /// Speed along the heading.
    pub speed_mps: f64,
    /// Speed to the left.
    pub lateral_mps: f64,
    pub yaw_rate_rad_per_s: f64,
}

/// Motion of a body during one `advance`.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyPath {
    pub start: Anchor,
    pub kind: PathKind,
    /// Bounds over the step, for any point of the body.
    pub speed_bound_mps: f64,
    pub accel_bound_mps2: f64,
}

/// Path, with one kind for each kind of body.
#[derive(Clone, Copy, Debug)]
pub(super) enum PathKind {
    Arc(DriveStep),
    Ride(RideStep),
    Ramp(Ramp),
    /// Constant velocity and yaw rate of the start.
    Even,
}
