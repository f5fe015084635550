//! Trajectories in the world frame.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::StoryNumber;

/// Curve in the world frame that an agent follows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Trajectory")]
pub enum StoryTrajectory<N = StoryNumber> {
    /// Straight lines between vertices.
    Polyline(Vec<TrajectoryVertex<N>>),
    /// Pieces whose curvature changes evenly, each from the end of the one before.
    Clothoid {
        /// Beginning along world x.
        x_m: N,
        /// Beginning along world y.
        y_m: N,
        /// Heading at the beginning, counter-clockwise from world x.
        heading_rad: N,
        /// Time at the beginning.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        time_s: Option<N>,
        /// Pieces.
        pieces: Vec<ClothoidPiece<N>>,
    },
    /// Non-uniform rational B-spline.
    Nurbs {
        /// Degree plus 1.
        order: usize,
        /// Knots, as many as control points and the order together.
        knots: Vec<N>,
        /// Control points.
        control_points: Vec<ControlPoint<N>>,
    },
}

/// Vertex of a polyline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "TrajectoryVertex")]
pub struct TrajectoryVertex<N = StoryNumber> {
    /// Along world x.
    pub x_m: N,
    /// Along world y.
    pub y_m: N,
    /// Heading, counter-clockwise from world x. Default: along the line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_rad: Option<N>,
    /// Time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<N>,
}

/// Piece of a curve with evenly changing curvature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "ClothoidPiece")]
pub struct ClothoidPiece<N = StoryNumber> {
    /// Length.
    pub length_m: N,
    /// Curvature at its beginning, positive to the left.
    pub from_per_m: N,
    /// Curvature at its end.
    pub to_per_m: N,
    /// Time at its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<N>,
}

/// Control point of a B-spline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "ControlPoint")]
pub struct ControlPoint<N = StoryNumber> {
    /// Along world x.
    pub x_m: N,
    /// Along world y.
    pub y_m: N,
    /// Weight. Default: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<N>,
    /// Time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<N>,
}

/// Meaning of the times of a trajectory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "TrajectoryTiming")]
pub enum TrajectoryTiming<N = StoryNumber> {
    /// Times since the start of the episode.
    Absolute {
        /// Factor on the times.
        scale: N,
        /// Sum to the scaled times.
        offset_s: N,
    },
    /// Times since the start of the action.
    Relative {
        /// Factor on the times.
        scale: N,
        /// Sum to the scaled times.
        offset_s: N,
    },
}
