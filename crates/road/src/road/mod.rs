//! Roads as geometry: lanes, courses, surfaces and the crossings of paths.
//!
//! A [`Road`] has lanes, a [`Course`] leads its lane 0 through the plane, and a
//! network joins the roads of a world.
//!
//! Architecture Invariant: a road knows no world, no agent and no rule.

mod change_shape;
mod course;
mod lanes;
mod network;
mod on_road;
mod piece;
mod placement;
mod self_overlap;
mod slope;
mod surface;

pub use change_shape::ChangeShape;
pub(crate) use course::MOST_WINDS_RAD;
pub use course::{Course, CourseError};
pub use lanes::Road;
pub use network::{RoadNetwork, Traveller, goes_first};
pub use on_road::{OnRoad, wrapped};
pub use piece::{Bend, Piece, RoadPiece};
pub use placement::PlacedRoads;
pub use placement::{Direction, PlacedRoad, Priority, RoadPlace};
pub use self_overlap::SelfOverlap;
pub use slope::{Bank, Grade, MAX_RISE, RoadProfile, slope_direction};
pub use surface::{SurfaceExtent, SurfaceMesh, stations_m};
