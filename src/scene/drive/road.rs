//! Roads: lanes along a course, and where on it somebody is.
//!
//! Lane 0 is the rightmost, and its middle is the course. A position on the
//! road is (s, lateral): metres along the course, metres to the left of it.

use serde::{Deserialize, Serialize};

use super::course::{Course, CourseError, Piece};

/// The road. Lane 0 is the rightmost; its middle is y = 0 on a straight one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Road {
    /// Along world x, without end.
    Straight {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane.
        lane_width_m: f64,
        /// Coefficient of friction μ of the surface.
        friction: f64,
        /// The law's limit, which egos are told of; rules are written with constants.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
    },
    /// Lines and arcs one after the other, from the origin along world x.
    Curved {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane.
        lane_width_m: f64,
        /// Coefficient of friction μ of the surface.
        friction: f64,
        /// The law's limit, which egos are told of; rules are written with constants.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
        /// The course of lane 0; before and after it the road is straight.
        pieces: Vec<Piece>,
    },
    /// Straight from point to point, with rounded corners.
    Polyline {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane.
        lane_width_m: f64,
        /// Coefficient of friction μ of the surface.
        friction: f64,
        /// The law's limit, which egos are told of; rules are written with constants.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
        /// The course of lane 0; before and after it the road is straight.
        points_m: Vec<(f64, f64)>,
        /// Radius of the corners.
        corner_radius_m: f64,
    },
}

/// What roads of all kinds have.
struct Shape {
    lanes: usize,
    lane_width_m: f64,
    friction: f64,
    speed_limit_mps: Option<f64>,
}

impl Road {
    fn shape(&self) -> Shape {
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
            } => Shape {
                lanes,
                lane_width_m,
                friction,
                speed_limit_mps,
            },
        }
    }

    /// The law's limit, where the world file names one.
    pub fn speed_limit_mps(&self) -> Option<f64> {
        self.shape().speed_limit_mps
    }

    /// Number of lanes.
    pub fn lanes(&self) -> usize {
        self.shape().lanes
    }

    /// Width of a lane.
    pub fn lane_width_m(&self) -> f64 {
        self.shape().lane_width_m
    }

    /// Coefficient of friction μ.
    pub fn friction(&self) -> f64 {
        self.shape().friction
    }

    /// Lays another surface.
    pub fn set_friction(&mut self, to: f64) {
        match self {
            Road::Straight { friction, .. }
            | Road::Curved { friction, .. }
            | Road::Polyline { friction, .. } => *friction = to,
        }
    }

    /// Lateral position of a lane's middle.
    pub fn lane_middle_m(&self, lane: usize) -> f64 {
        lane as f64 * self.lane_width_m()
    }

    /// The lane in which a lateral position lies, clamped to the road.
    pub fn lane_at(&self, lateral_m: f64) -> usize {
        let lane = (lateral_m / self.lane_width_m()).round();
        (lane.max(0.0) as usize).min(self.lanes() - 1)
    }

    /// Lateral positions of the lanes' borders, from the right.
    pub fn borders_m(&self) -> impl Iterator<Item = f64> {
        let width_m = self.lane_width_m();
        (0..=self.lanes()).map(move |border| (border as f64 - 0.5) * width_m)
    }

    /// The course of lane 0.
    ///
    /// # Errors
    /// What is wrong with the pieces or points, with the number of the one.
    pub fn course(&self) -> Result<Course, CourseError> {
        // Nobody can drive where the lanes fold over each other.
        let reach_m = self.lanes() as f64 * self.lane_width_m();
        match self {
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
