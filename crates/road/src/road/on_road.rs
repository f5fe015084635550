//! Places relative to a road.

use core::f64::consts::PI;

use nalgebra::Vector2;

use crate::pose::rotation_by;

/// Position and heading of an agent relative to a road.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OnRoad {
    /// Station along the course.
    pub s_m: f64,
    /// Offset to the left of the course.
    pub lateral_m: f64,
    /// Heading relative to the course, counter-clockwise.
    pub heading_rad: f64,
    /// Curvature of the course at that station, positive to the left.
    pub curvature_per_m: f64,
}

impl OnRoad {
    /// Returns the velocity along and across the road of a body with a velocity along
    /// and across its heading.
    #[inline]
    pub fn velocity_mps(&self, speed_mps: f64, lateral_mps: f64) -> Vector2<f64> {
        rotation_by(self.heading_rad) * Vector2::new(speed_mps, lateral_mps)
    }

    /// Returns the same place for an agent that drives against the road.
    pub fn reversed(&self) -> OnRoad {
        OnRoad {
            s_m: -self.s_m,
            lateral_m: -self.lateral_m,
            heading_rad: wrapped(self.heading_rad + PI),
            curvature_per_m: -self.curvature_per_m,
        }
    }
}

/// Returns an angle in −π ..= π.
///
/// Recorded episodes contain its bits, which differ from those of `pose::wrapped`.
pub fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - 2.0 * PI * libm::round(angle_rad / (2.0 * PI))
}
