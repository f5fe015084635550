//! Where a body is, and how it goes on during one `advance`.

use crate::sim::limits::Drive;
use crate::sim::walker::Ramp;

/// State of the fixed point of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: f64,
    pub cos: f64,
    pub sin: f64,
    /// A vehicle's speed along its heading.
    pub speed_mps: f64,
    pub curvature_per_m: f64,
    /// Velocity in the world frame of a walker, or of who is carried.
    pub walk_mps: (f64, f64),
    /// Turning rate of who is carried.
    pub yaw_rate_rad_per_s: f64,
}

/// A body's motion during one `advance`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    pub start: Anchor,
    pub kind: PathKind,
    /// Bounds over the step, for any point of the body.
    pub speed_bound_mps: f64,
    pub accel_bound_mps2: f64,
}

/// One kind of path per kind of body.
#[derive(Clone, Copy, Debug)]
pub(super) enum PathKind {
    Arc(Drive),
    Ramp(Ramp),
    /// At the velocity and the turning rate of the start.
    Even,
}
