//! A storyboard as plain data, in the words of OpenSCENARIO 1.3.
//!
//! Names are text here, and [`check`](crate::check) resolves them.

mod conditions;

pub use conditions::{
    ComparisonRule, Condition, ConditionEdge, CoordinateSystem, DistanceType, ElementState,
    EntityCondition, Expression, SignalState, StoryPosition, Trigger, TriggeringRule,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::road::ChangeShape;

/// Stories of a world, with the variables that they share.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Storyboard {
    /// Variables and their first values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub variables: Vec<Variable>,
    /// Stories, which run side by side.
    pub stories: Vec<Story>,
    /// Stops all stories. Default: never.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stop_trigger: Trigger,
}

/// Number that actions change and conditions read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Variable {
    /// Name in actions and conditions.
    pub name: String,
    /// First value.
    pub value: f64,
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
    #[serde(default)]
    pub actors: Vec<String>,
    /// Number of executions.
    #[serde(default = "once")]
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
    #[serde(default)]
    pub priority: EventPriority,
    /// Number of executions, those that are skipped included.
    #[serde(default = "once")]
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

/// Action of an event.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Action {
    /// Name in conditions.
    pub name: String,
    /// Its effect.
    pub does: Effect,
}

/// Effect of an action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum Effect {
    /// Each actor changes its speed.
    Speed {
        /// Target.
        target: SpeedTarget,
        /// Course of the change.
        dynamics: TransitionDynamics,
    },
    /// Each actor changes its lane.
    LaneChange {
        /// Target.
        target: LaneTarget,
        /// Offset from the middle of the new lane, to the left in road direction.
        #[serde(default)]
        target_lane_offset_m: f64,
        /// Course of the change.
        dynamics: TransitionDynamics,
    },
    /// Each actor moves to an offset from the middle of its lane.
    LaneOffset {
        /// Offset, to the left in road direction.
        target_m: f64,
        /// Course of the change.
        #[serde(default = "sinusoidal")]
        shape: DynamicsShape,
        /// Greatest lateral acceleration. Default: at once.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        max_lateral_acc_mps2: Option<f64>,
    },
    /// A variable gets a value.
    VariableSet {
        /// Its name.
        name: String,
        /// New value.
        value: f64,
    },
    /// A variable changes by a value.
    VariableAdd {
        /// Its name.
        name: String,
        /// Added value.
        value: f64,
    },
    /// A variable is multiplied.
    VariableMultiply {
        /// Its name.
        name: String,
        /// Factor.
        value: f64,
    },
}

/// Target of a speed action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum SpeedTarget {
    /// A speed.
    Absolute {
        /// The speed.
        value_mps: f64,
    },
    /// Speed of another agent at the start of the action, plus a difference.
    Delta {
        /// Other agent.
        entity: String,
        /// Difference.
        value_mps: f64,
    },
    /// Speed of another agent at the start of the action, times a factor.
    Factor {
        /// Other agent.
        entity: String,
        /// Factor.
        value: f64,
    },
}

/// Target of a lane change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum LaneTarget {
    /// A lane of the actor's road, counted from 0 at the right.
    Absolute {
        /// Its number.
        lane: usize,
    },
    /// Lane of an agent at the start of the action, plus a number to the left.
    ///
    /// Beyond the road it is the outermost lane.
    Relative {
        /// Agent on the same road.
        entity: String,
        /// Number of lanes to the left in road direction.
        lanes: i32,
    },
}

/// Shape of a transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum DynamicsShape {
    /// At one rate.
    Linear,
    /// Cubic curve without a rate at its ends.
    Cubic,
    /// Half a wave of a cosine.
    Sinusoidal,
    /// At once.
    Step,
}

impl DynamicsShape {
    /// Returns the curve, or `None` for a change at once.
    pub fn curve(self) -> Option<ChangeShape> {
        match self {
            DynamicsShape::Linear => Some(ChangeShape::Linear),
            DynamicsShape::Cubic => Some(ChangeShape::Cubic),
            DynamicsShape::Sinusoidal => Some(ChangeShape::Cosine),
            DynamicsShape::Step => None,
        }
    }
}

/// Course of a transition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Dynamics", deny_unknown_fields)]
pub struct TransitionDynamics {
    /// Shape.
    pub shape: DynamicsShape,
    /// Size, which a step does not need.
    #[serde(default = "unlimited")]
    pub dimension: Dimension,
}

/// Size of a transition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Dimension {
    /// Greatest rate of change per second, of the speed or of the lateral place.
    Rate(f64),
    /// Duration in seconds.
    Time(f64),
    /// Way along the path in metres.
    Distance(f64),
}

fn once() -> u32 {
    1
}

fn sinusoidal() -> DynamicsShape {
    DynamicsShape::Sinusoidal
}

fn unlimited() -> Dimension {
    Dimension::Time(0.0)
}
