//! Roads from OpenDRIVE files: reference lines, lanes, links and ways along them.
//!
//! Every curve is read as a place at each distance, and becomes arcs within a
//! millimetre of it. A way along lanes leads through sections, over links and
//! through junctions.
//!
//! Architecture Invariant: a function provides the files, and this module knows no
//! world and no scenario.

pub(crate) mod curve;
pub mod error;
pub(crate) mod expression;
pub mod files;
pub mod lane_drive;
pub mod lanes;
mod links;
mod pose_geometry;
pub(crate) mod reference_line;
pub mod roads;
pub mod scope;
pub(crate) mod surface;
pub mod tree;
mod way_parts;
pub mod ways;

mod driven_road;

pub use driven_road::{LaneRoad, LaneStart, lane_road};
pub use error::ImportError;
pub use files::Files;
pub use way_parts::{bank_list, grade_list};
