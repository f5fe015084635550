//! Places in the plane.

/// Place in the plane, with its direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Spot {
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: f64,
}

impl Spot {
    /// Place ahead and to the left, with the same direction.
    pub(super) fn moved(&self, ahead_m: f64, left_m: f64) -> Spot {
        let (sin, cos) = libm::sincos(self.heading_rad);
        Spot {
            x_m: self.x_m + ahead_m * cos - left_m * sin,
            y_m: self.y_m + ahead_m * sin + left_m * cos,
            heading_rad: self.heading_rad,
        }
    }

    /// Place along an arc, with the direction of the arc.
    pub(super) fn bent(&self, along_m: f64, per_m: f64) -> Spot {
        let turn_rad = per_m * along_m;
        // A line is the limit of an arc, where the division by 0 fails.
        let (ahead_m, left_m) = if per_m == 0.0 {
            (along_m, 0.0)
        } else {
            (
                libm::sin(turn_rad) / per_m,
                (1.0 - libm::cos(turn_rad)) / per_m,
            )
        };
        Spot {
            heading_rad: wrapped(self.heading_rad + turn_rad),
            ..self.moved(ahead_m, left_m)
        }
    }

    /// Another place in the frame of this place: ahead, to the left, turned.
    pub(super) fn sees(&self, other: &Spot) -> Spot {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        let (sin, cos) = libm::sincos(self.heading_rad);
        Spot {
            x_m: dx * cos + dy * sin,
            y_m: dy * cos - dx * sin,
            heading_rad: wrapped(other.heading_rad - self.heading_rad),
        }
    }
}

/// Wraps an angle to −π ..= π.
pub(super) fn wrapped(angle_rad: f64) -> f64 {
    libm::remainder(angle_rad, core::f64::consts::TAU)
}
