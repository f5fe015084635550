//! Poses along lines and arcs, and relative to each other.

use crate::pose::{Pose, wrapped};

impl Pose {
    /// Pose ahead and to the left, with the same heading.
    pub fn moved(&self, ahead_m: f64, left_m: f64) -> Pose {
        let at_m = self.frame().to_world(ahead_m, left_m);
        Pose {
            x_m: at_m.x,
            y_m: at_m.y,
            ..*self
        }
    }

    /// Pose along an arc, with the direction of the arc.
    pub(crate) fn bent(&self, along_m: f64, per_m: f64) -> Pose {
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
        Pose {
            heading_rad: wrapped(self.heading_rad + turn_rad),
            ..self.moved(ahead_m, left_m)
        }
    }

    /// Another pose in the frame of this pose: ahead, to the left, turned.
    pub fn sees(&self, other: &Pose) -> Pose {
        let at_m = self.frame().to_local(other.point_m());
        Pose {
            x_m: at_m.x,
            y_m: at_m.y,
            // Wrapped, because the difference of two wrapped angles may exceed
            // half a turn.
            heading_rad: wrapped(other.heading_rad - self.heading_rad),
        }
    }
}
