//! Roads: lanes along a course, and positions on them.
//!
//! Lane 0 is the rightmost, and its middle is the course. A position on the
//! road is (s, lateral): metres along the course, metres to the left of it.

use serde::{Deserialize, Serialize};

use super::course::{Course, CourseError};
use super::piece::Piece;

/// A road. Lane 0 is the rightmost. Its middle is y = 0 on a straight road.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Road {
    /// A straight road along world x, without end.
    Straight {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane.
        lane_width_m: f64,
        /// Coefficient of friction μ of the surface.
        friction: f64,
        /// Legal speed limit, passed to egos. Rules use constants instead.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
    },
    /// Lines and arcs in sequence, from the origin along world x.
    Curved {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane.
        lane_width_m: f64,
        /// Coefficient of friction μ of the surface.
        friction: f64,
        /// Legal speed limit, passed to egos. Rules use constants instead.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
        /// Course of lane 0. Before and after it the road is straight.
        pieces: Vec<Piece>,
    },
    /// Straight lines between points, with rounded corners.
    Polyline {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane.
        lane_width_m: f64,
        /// Coefficient of friction μ of the surface.
        friction: f64,
        /// Legal speed limit, passed to egos. Rules use constants instead.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
        /// Course of lane 0. Before and after it the road is straight.
        points_m: Vec<(f64, f64)>,
        /// Radius of the corners.
        corner_radius_m: f64,
    },
}

/// Data common to all kinds of road.
struct RoadProperties {
    lanes: usize,
    lane_width_m: f64,
    friction: f64,
    speed_limit_mps: Option<f64>,
}

impl Road {
    #[inline]
    fn shape(&self) -> RoadProperties {
        match *self {
            Road::Straight {
                lanes,
                lane_width_m,
                friction,
                speed_limit_mps,
            }
            | Road::Curved {
                lanes,
                lane_width_m,
                friction,
                speed_limit_mps,
                ..
            }
            | Road::Polyline {
                lanes,
                lane_width_m,
                friction,
                speed_limit_mps,
                ..
            } => RoadProperties {
                lanes,
                lane_width_m,
                friction,
                speed_limit_mps,
            },
        }
    }

    /// Returns the legal speed limit, if the world file has one.
    pub fn speed_limit_mps(&self) -> Option<f64> {
        self.shape().speed_limit_mps
    }

    /// Returns the number of lanes.
    pub fn lanes(&self) -> usize {
        self.shape().lanes
    }

    /// Returns the width of a lane.
    pub fn lane_width_m(&self) -> f64 {
        self.shape().lane_width_m
    }

    /// Returns the coefficient of friction μ.
    pub fn friction(&self) -> f64 {
        self.shape().friction
    }

    /// Replaces the coefficient of friction.
    pub fn set_friction(&mut self, to: f64) {
        match self {
            Road::Straight { friction, .. }
            | Road::Curved { friction, .. }
            | Road::Polyline { friction, .. } => *friction = to,
        }
    }

    /// Replaces the width of the lanes.
    pub fn set_lane_width_m(&mut self, to_m: f64) {
        match self {
            Road::Straight { lane_width_m, .. }
            | Road::Curved { lane_width_m, .. }
            | Road::Polyline { lane_width_m, .. } => *lane_width_m = to_m,
        }
    }

    /// Returns the radius of a piece, positive to the left, if it is an arc.
    pub fn radius_m(&self, piece: usize) -> Option<f64> {
        match self {
            Road::Curved { pieces, .. } => match pieces.get(piece)? {
                Piece::Arc { radius_m, .. } => Some(*radius_m),
                Piece::Line { .. } => None,
            },
            Road::Straight { .. } | Road::Polyline { .. } => None,
        }
    }

    /// Replaces the radius of a piece, if it is an arc.
    pub fn set_radius_m(&mut self, piece: usize, to_m: f64) {
        if let Road::Curved { pieces, .. } = self
            && let Some(Piece::Arc { radius_m, .. }) = pieces.get_mut(piece)
        {
            *radius_m = to_m;
        }
    }

    /// Returns the number of pieces, 0 on other roads than curved ones.
    pub fn pieces(&self) -> usize {
        match self {
            Road::Curved { pieces, .. } => pieces.len(),
            Road::Straight { .. } | Road::Polyline { .. } => 0,
        }
    }

    /// Appends a piece to a curved road.
    pub fn push(&mut self, piece: Piece) {
        if let Road::Curved { pieces, .. } = self {
            pieces.push(piece);
        }
    }

    /// Keeps the first pieces of a curved road only.
    pub fn truncate(&mut self, to: usize) {
        if let Road::Curved { pieces, .. } = self {
            pieces.truncate(to);
        }
    }

    /// Returns the lateral position of a lane's middle.
    pub fn lane_middle_m(&self, lane: usize) -> f64 {
        lane as f64 * self.lane_width_m()
    }

    /// Returns the lane of a lateral position, clamped to the road.
    #[inline]
    pub fn lane_at(&self, lateral_m: f64) -> usize {
        // The percept asks at every sample, and a single lane needs no
        // division.
        if self.lanes() == 1 {
            return 0;
        }
        // A border between two lanes belongs to the left one.
        // The cast cuts, to 0 for a negative number. With the float below one half this
        // rounds like `f64::round`, which is a call on x86-64 and runs at every percept.
        let lane = lateral_m / self.lane_width_m() + 0.5_f64.next_down();
        (lane as usize).min(self.lanes() - 1)
    }

    /// Returns the lateral positions of the lanes' borders, from the right.
    pub fn borders_m(&self) -> impl Iterator<Item = f64> {
        let width_m = self.lane_width_m();
        (0..=self.lanes()).map(move |border| (border as f64 - 0.5) * width_m)
    }

    /// Returns the course of lane 0.
    ///
    /// # Errors
    /// The pieces or points are invalid. The error has the number of the first such.
    pub fn course(&self) -> Result<Course, CourseError> {
        // An arc narrower than the road would fold its lanes over each other.
        let reach_m = self.lanes() as f64 * self.lane_width_m();
        match self {
            // Without legs, so that coordinates are those of the world to the bit.
            Road::Straight { .. } => Ok(Course::straight()),
            Road::Curved { pieces, .. } => Course::of_pieces(pieces, reach_m),
            Road::Polyline {
                points_m,
                corner_radius_m,
                ..
            } => Course::of_points(points_m, *corner_radius_m, reach_m),
        }
    }
}
