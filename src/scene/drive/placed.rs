//! Roads beside the world's own: where in the plane they lie, and who goes first.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::course::{Course, CourseError, Piece};
use super::road::Road;

/// Named roads, in file order.
pub type PlacedRoads = IndexMap<String, PlacedRoad>;

/// Where a road begins: the middle of its lane 0 at s = 0, in the frame of the
/// world's own road.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoadPlace {
    /// Along world x.
    pub x_m: f64,
    /// Along world y.
    pub y_m: f64,
    /// Counter-clockwise from world x.
    #[serde(default)]
    pub heading_rad: f64,
}

/// Who goes first where a road crosses the world's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Priority {
    /// The world's own road.
    Yields,
    /// Who comes from the right, on either road.
    #[default]
    Equal,
    /// This one.
    Over,
}

/// Which way somebody drives on a road.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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
    /// Where it begins.
    pub at: RoadPlace,
    /// Its lanes, on the surface of the world's own road.
    pub road: Road,
    /// The course of its lane 0; before, after and without pieces it is straight.
    pub pieces: Vec<Piece>,
    /// Who goes first where it crosses the world's own road.
    pub priority: Priority,
}

impl PlacedRoad {
    /// The course of lane 0.
    ///
    /// # Errors
    /// What is wrong with the pieces, with the number of the one.
    pub fn course(&self) -> Result<Course, CourseError> {
        let RoadPlace {
            x_m,
            y_m,
            heading_rad,
        } = self.at;
        let reach_m = self.road.lanes() as f64 * self.road.lane_width_m();
        Course::placed((x_m, y_m), heading_rad, &self.pieces, reach_m)
    }
}
