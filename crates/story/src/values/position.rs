//! Places of the world.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::StoryNumber;
use super::number::is_default;

/// Place in the world.
///
/// A heading is left out where it is that of the road, or of the agent that a place is
/// relative to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum StoryPosition {
    /// Point of the world frame.
    World {
        /// Along world x.
        x_m: StoryNumber,
        /// Along world y.
        y_m: StoryNumber,
        /// Counter-clockwise from world x.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        heading_rad: Option<StoryNumber>,
    },
    /// Place on a road.
    Road {
        /// Named road. Default: that of the agent whose condition or action it is.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        road: Option<String>,
        /// Along the road.
        s_m: StoryNumber,
        /// To the left of the road's course.
        t_m: StoryNumber,
        /// Counter-clockwise from the road's direction.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        heading_rad: Option<StoryNumber>,
    },
    /// Place relative to an agent, in the axes of the world.
    RelativeWorld {
        /// Agent.
        entity: String,
        /// Along world x.
        dx_m: StoryNumber,
        /// Along world y.
        dy_m: StoryNumber,
        /// Counter-clockwise from the agent's heading.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        heading_rad: Option<StoryNumber>,
    },
    /// Place relative to an agent, in the axes of its body.
    RelativeObject {
        /// Agent.
        entity: String,
        /// Ahead of it.
        dx_m: StoryNumber,
        /// To its left.
        dy_m: StoryNumber,
        /// Counter-clockwise from the agent's heading.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        heading_rad: Option<StoryNumber>,
    },
    /// Place relative to an agent, along its road.
    RelativeRoad {
        /// Agent.
        entity: String,
        /// Along the road.
        ds_m: StoryNumber,
        /// To the left of the agent's place.
        dt_m: StoryNumber,
        /// Counter-clockwise from the road's direction.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        heading_rad: Option<StoryNumber>,
    },
    /// Place in a lane, relative to the lane of an agent.
    RelativeLane {
        /// Agent.
        entity: String,
        /// Number of lanes to the left in road direction.
        lanes: i32,
        /// Along the road.
        ds_m: StoryNumber,
        /// Offset to the left of the lane's middle.
        #[serde(default, skip_serializing_if = "is_default")]
        offset_m: StoryNumber,
        /// Counter-clockwise from the road's direction.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        heading_rad: Option<StoryNumber>,
    },
}
