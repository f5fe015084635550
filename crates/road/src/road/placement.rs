//! Further roads of a world: their place in the plane and their priority.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::course::{Course, CourseError};
use super::lanes::Road;
use super::piece::Piece;
use super::slope::{Bank, Grade, RoadProfile};
use crate::pose::Pose;

/// Named roads, in file order.
pub type PlacedRoads = IndexMap<String, PlacedRoad>;

/// Origin of a road: the middle of its lane 0 at s = 0.
///
/// In the frame of the world's own road.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoadPlace {
    /// Position along world x.
    pub x_m: f64,
    /// Position along world y.
    pub y_m: f64,
    /// Heading, counter-clockwise from world x.
    #[serde(default)]
    pub heading_rad: f64,
    /// Height.
    #[serde(default)]
    pub z_m: f64,
}

/// Right of way where a road crosses the world's own.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
pub enum Priority {
    /// Traffic on this road yields.
    Yields,
    /// Traffic from the right goes first, on either road.
    #[default]
    Equal,
    /// Traffic on this road goes first.
    Over,
}

/// Driving direction on a road.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Direction {
    /// Towards greater s.
    #[default]
    With,
    /// Towards smaller s, as oncoming traffic does.
    Against,
}

/// A road placed in the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedRoad {
    /// Origin of the road.
    pub at: RoadPlace,
    /// Its lanes, on the surface of the world's own road.
    pub road: Road,
    /// True if its lanes are as wide as those of the world's own road.
    pub shares_lane_width: bool,
    /// Course of its lane 0. Around the pieces, or without any, it is straight.
    pub pieces: Vec<Piece>,
    /// Right of way where it crosses the world's own road.
    pub priority: Priority,
    /// Its grades, by station.
    pub grades: Vec<Grade>,
    /// Length of the vertical curves between its grades.
    pub vertical_curve_m: f64,
    /// Its banks, by station.
    pub banks: Vec<Bank>,
}

impl PlacedRoad {
    /// Returns the heights of its surface.
    pub fn profile(&self) -> RoadProfile<'_> {
        RoadProfile {
            grades: &self.grades,
            vertical_curve_m: self.vertical_curve_m,
            banks: &self.banks,
            z_m: self.at.z_m,
        }
    }

    /// Returns the course of lane 0.
    ///
    /// # Errors
    /// The pieces are invalid. The error has the number of the first such piece.
    pub fn course(&self) -> Result<Course, CourseError> {
        let RoadPlace {
            x_m,
            y_m,
            heading_rad,
            ..
        } = self.at;
        // The lanes lie on the left of lane 0, so an arc must be wider than all
        // of them.
        let reach_m = self.road.lanes() as f64 * self.road.lane_width_m();
        let begins = Pose {
            x_m,
            y_m,
            heading_rad,
        };
        Course::placed(begins, &self.pieces, reach_m)
    }
}
