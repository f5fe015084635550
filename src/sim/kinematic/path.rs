//! State of a body and its motion during one `advance`.

use crate::sim::limits::DriveStep;
use crate::sim::riding::RideStep;
use crate::sim::walker::Ramp;

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
