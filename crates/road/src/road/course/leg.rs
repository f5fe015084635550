//! Placement of a piece in the plane, with coordinates along it.

use super::leg_index::{LegBox, LegDisc};
use crate::pose::{GroundFrame, Pose};
use crate::road::on_road::{OnRoad, wrapped};
use crate::road::piece::Bend;

/// A piece with its placement in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leg {
    pub(super) from_s_m: f64,
    pub(super) length_m: f64,
    pub(super) start: Pose,
    /// Frame of the start.
    frame: GroundFrame,
    pub(super) curvature_per_m: f64,
}

impl Leg {
    pub(super) fn new(from_s_m: f64, start: Pose, bend: Bend) -> Leg {
        Leg {
            from_s_m,
            length_m: bend.length_m,
            start,
            frame: start.frame(),
            curvature_per_m: bend.per_m,
        }
    }

    pub(super) fn end(&self) -> Pose {
        self.pose(self.length_m, 0.0)
    }

    pub(super) fn pose(&self, along_m: f64, lateral_m: f64) -> Pose {
        let k = self.curvature_per_m;
        let turn_rad = k * along_m;
        let (turn_sin, turn_cos) = libm::sincos(turn_rad);
        let (ahead_m, left_m) = if k == 0.0 {
            // A branch and not a limit: k = 0 would divide by zero.
            (along_m, lateral_m)
        } else {
            (
                turn_sin / k - lateral_m * turn_sin,
                (1.0 - turn_cos) / k + lateral_m * turn_cos,
            )
        };
        let at_m = self.frame.to_world(ahead_m, left_m);
        Pose {
            x_m: at_m.x,
            y_m: at_m.y,
            heading_rad: self.heading_rad(along_m),
        }
    }

    /// Returns the heading of the course at a distance from the start of the leg.
    fn heading_rad(&self, along_m: f64) -> f64 {
        wrapped(self.start.heading_rad + self.curvature_per_m * along_m)
    }

    /// Returns the distance to the leg and the coordinates at its nearest point.
    pub(super) fn locate(&self, pose: &Pose) -> (f64, OnRoad) {
        let [ahead_m, left_m] = self.frame.to_local(pose.point_m()).into();
        let k = self.curvature_per_m;
        let (along_m, lateral_m) = if k == 0.0 {
            (ahead_m, left_m)
        } else {
            let (across, towards) = (k * ahead_m, 1.0 - k * left_m);
            let radii = (across * across + towards * towards).sqrt();
            // Coordinates from the circle's centre, scaled by k. The centre
            // itself is far away on slight bends and is never computed.
            (libm::atan2(across, towards) / k, (1.0 - radii) / k)
        };
        // Beyond its ends the leg answers for its nearest end, and its neighbour is nearer.
        let on_m = along_m.clamp(0.0, self.length_m);
        let away_m = if on_m == along_m {
            // Beside the leg the lateral offset is the distance, without
            // rounding.
            lateral_m.abs()
        } else {
            let end = self.pose(on_m, 0.0);
            let (off_x, off_y) = (pose.x_m - end.x_m, pose.y_m - end.y_m);
            (off_x * off_x + off_y * off_y).sqrt()
        };
        let at = OnRoad {
            s_m: self.from_s_m + on_m,
            lateral_m,
            heading_rad: wrapped(pose.heading_rad - self.heading_rad(on_m)),
            curvature_per_m: k,
        };
        (away_m, at)
    }

    /// Returns a disc around the leg.
    pub(super) fn disc(&self) -> LegDisc {
        let middle = self.pose(0.5 * self.length_m, 0.0);
        LegDisc {
            // No point of a leg is farther from its middle than half of its length.
            middle_m: [middle.x_m, middle.y_m],
            radius_m: 0.5 * self.length_m,
        }
    }

    /// Returns a box around the leg.
    pub(super) fn bounds(&self) -> LegBox {
        if self.curvature_per_m == 0.0 {
            let end = self.end();
            return LegBox {
                least_m: [self.start.x_m.min(end.x_m), self.start.y_m.min(end.y_m)],
                most_m: [self.start.x_m.max(end.x_m), self.start.y_m.max(end.y_m)],
            };
        }
        // A bent leg is bounded by its disc, which needs no extreme of the
        // arc.
        let LegDisc { middle_m, radius_m } = self.disc();
        LegBox {
            least_m: middle_m.map(|at_m| at_m - radius_m),
            most_m: middle_m.map(|at_m| at_m + radius_m),
        }
    }
}
