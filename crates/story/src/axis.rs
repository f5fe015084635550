//! Intervals of bodies along an axis.

use crate::pose::Pose;
use crate::view::AgentSize;

/// Interval of a body along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisSpan {
    /// Least place of the body.
    pub least_m: f64,
    /// Greatest place of the body.
    pub most_m: f64,
}

impl AxisSpan {
    /// Returns the interval of a body whose front bumper is at a pose.
    ///
    /// Without `freespace` it is that of the reference point alone.
    pub fn of(
        size: AgentSize,
        front: &Pose,
        freespace: bool,
        on_axis: impl Fn(&Pose) -> f64,
    ) -> AxisSpan {
        if !freespace {
            // The reference point has no extent, so both ends are the same.
            let at_m = on_axis(&front.ahead(-size.front_m));
            return AxisSpan {
                least_m: at_m,
                most_m: at_m,
            };
        }
        // The pose is that of the front bumper, so the body lies behind it.
        let half_m = 0.5 * size.width_m;
        let corners = [
            // The axis may be that of a bent road, so every corner is
            // measured.
            (0.0, half_m),
            (0.0, -half_m),
            (-size.length_m, half_m),
            (-size.length_m, -half_m),
        ];
        let places = corners.map(|(ahead_m, left_m)| {
            let at = front.frame().to_world(ahead_m, left_m);
            // The axis measures points, so the heading has no part in it.
            on_axis(&Pose {
                x_m: at.x,
                y_m: at.y,
                ..*front
            })
        });
        AxisSpan {
            least_m: places.into_iter().fold(f64::INFINITY, f64::min),
            most_m: places.into_iter().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// Returns the distance to another span, 0 if they overlap.
    pub fn distance_m(&self, other: &AxisSpan) -> f64 {
        // Only one of both is positive if there is a gap, and none if they
        // overlap.
        let ahead_m = other.least_m - self.most_m;
        let behind_m = self.least_m - other.most_m;
        ahead_m.max(behind_m).max(0.0)
    }

    /// Returns its middle.
    pub fn middle_m(&self) -> f64 {
        0.5 * (self.least_m + self.most_m)
    }

    /// Returns the same interval along the opposite axis.
    pub fn reversed(&self) -> AxisSpan {
        AxisSpan {
            // A mirrored axis swaps the ends, or the least place would
            // be above the greatest.
            least_m: -self.most_m,
            most_m: -self.least_m,
        }
    }
}
