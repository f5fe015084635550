//! A storyboard as plain data, in the words of OpenSCENARIO 1.3.
//!
//! Names are text here, and [`check`](crate::check) resolves them.

mod actions;
mod conditions;
mod number;
mod position;
mod trajectory;

pub use actions::{
    Action, Dimension, DistanceOrTime, DynamicLimits, DynamicsShape, Effect, FinalSpeed,
    FollowingMode, LaneTarget, LateralDisplacement, LongitudinalDisplacement, OffsetTarget,
    SpeedPoint, SpeedTarget, TransitionDynamics,
};
pub use conditions::{
    ComparisonRule, Condition, ConditionEdge, CoordinateSystem, DistanceType, ElementState,
    EntityCondition, Expression, SignalState, Trigger, TriggeringRule,
};
pub use number::StoryNumber;
use number::is_default;
pub use position::StoryPosition;
pub use trajectory::{
    ClothoidPiece, ControlPoint, StoryTrajectory, TrajectoryTiming, TrajectoryVertex,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Stories of a world, with the variables that they share.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Storyboard {
    /// Variables and their first values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub variables: Vec<Variable>,
    /// Limits of agents, which bound changes of speed, meetings, and those profiles and
    /// distances that have limits of their own. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub performance: Vec<EntityPerformance>,
    /// Stories, which run side by side.
    pub stories: Vec<Story>,
    /// Stops all stories. Default: never.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stop_trigger: Trigger,
}

/// Limits of an agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EntityPerformance {
    /// Agent.
    pub entity: String,
    /// Limits of its motion along the path.
    pub limits: DynamicLimits,
}

/// Number that actions change and conditions read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Variable {
    /// Name in actions and conditions.
    pub name: String,
    /// First value.
    pub value: StoryNumber,
}

/// Acts, which run side by side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Story {
    /// Name in conditions.
    pub name: String,
    /// Acts of the story.
    pub acts: Vec<Act>,
}

/// Maneuver groups with a common start and stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Act {
    /// Name in conditions.
    pub name: String,
    /// Starts the act. Default: with its story.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub start_trigger: Trigger,
    /// Stops the act and all that it contains. Default: never.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stop_trigger: Trigger,
    /// Groups of the act, which run side by side.
    pub maneuver_groups: Vec<ManeuverGroup>,
}

/// Maneuvers of the same actors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ManeuverGroup {
    /// Name in conditions.
    pub name: String,
    /// Agents that perform the actions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub actors: Vec<String>,
    /// Whether agents that cause the start trigger of the act are actors, too.
    #[serde(default, skip_serializing_if = "is_default")]
    pub actors_are_triggering: bool,
    /// Number of executions.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub maximum_execution_count: u32,
    /// Maneuvers of the group, which run side by side.
    pub maneuvers: Vec<StoryManeuver>,
}

/// Events whose priorities apply among each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Maneuver", deny_unknown_fields)]
pub struct StoryManeuver {
    /// Name in conditions.
    pub name: String,
    /// Events of the maneuver.
    pub events: Vec<StoryEvent>,
}

/// Actions with a common trigger.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Event", deny_unknown_fields)]
pub struct StoryEvent {
    /// Name in conditions.
    pub name: String,
    /// Effect on the other events of its maneuver.
    #[serde(default, skip_serializing_if = "is_default")]
    pub priority: EventPriority,
    /// Number of executions, those that are skipped included.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub maximum_execution_count: u32,
    /// Starts the event. Default: with its maneuver.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub start_trigger: Trigger,
    /// Actions, which begin together.
    pub actions: Vec<Action>,
}

/// Effect of a starting event on the running events of its maneuver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum EventPriority {
    /// Stops them.
    #[default]
    Override,
    /// Leaves them running.
    Parallel,
    /// Does not start while one of them runs.
    Skip,
}

fn once() -> u32 {
    1
}

fn is_once(count: &u32) -> bool {
    *count == once()
}
