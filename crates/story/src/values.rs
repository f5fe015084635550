//! A storyboard as plain data, in the words of OpenSCENARIO 1.3.
//!
//! Names are text here, and [`check`](crate::check) resolves them.

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

/// Groups of conditions. One group suffices, and all of its conditions must hold.
pub type Trigger = Vec<Vec<Condition>>;

/// Condition of a trigger.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Change of the expression that counts.
    #[serde(default)]
    pub edge: ConditionEdge,
    /// Time by which the condition lags behind its expression and edge.
    #[serde(default)]
    pub delay_s: f64,
    /// Logical expression.
    pub is: Expression,
}

/// Change of a logical expression that makes a condition true.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum ConditionEdge {
    /// No change: the condition is as true as its expression.
    #[default]
    None,
    /// From false to true.
    Rising,
    /// From true to false.
    Falling,
    /// Either of the two.
    RisingOrFalling,
}

/// ValueComparison of a quantity with a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[allow(missing_docs)]
pub enum ComparisonRule {
    LessThan,
    LessOrEqual,
    EqualTo,
    NotEqualTo,
    GreaterOrEqual,
    GreaterThan,
}

/// Logical expression of a condition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum Expression {
    /// Time since the start of the episode.
    SimulationTime {
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value_s: f64,
    },
    /// State or transition of an element of the storyboard.
    StoryboardElementState {
        /// Name, or the names from the story on with `::` between them.
        element: String,
        /// State or transition.
        state: ElementState,
    },
    /// Value of a variable.
    Variable {
        /// Its name.
        name: String,
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value: f64,
    },
    /// Parameter of the world's start.
    Parameter {
        /// Its name.
        name: String,
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value: f64,
    },
    /// Phase of a traffic light.
    TrafficSignal {
        /// Name of the light.
        name: String,
        /// Its phase.
        state: SignalState,
    },
    /// Motion of one or several agents.
    ByEntity {
        /// Agents whose motion is compared.
        entities: Vec<String>,
        /// Whether it must hold for any or for all of them.
        #[serde(default)]
        rule: TriggeringRule,
        /// Condition of each agent.
        condition: EntityCondition,
    },
}

/// Number of agents for which a condition must hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[allow(missing_docs)]
pub enum TriggeringRule {
    #[default]
    Any,
    All,
}

/// State of an element of a storyboard, or the instant of its change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[allow(missing_docs)]
pub enum ElementState {
    StandbyState,
    RunningState,
    CompleteState,
    StartTransition,
    EndTransition,
    StopTransition,
    SkipTransition,
}

/// Phase of a traffic light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[allow(missing_docs)]
pub enum SignalState {
    Green,
    Yellow,
    Red,
}

/// Direction in which a distance is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum DistanceType {
    /// Straight line.
    #[default]
    Euclidean,
    /// Along the heading of the agent, or along its road.
    Longitudinal,
    /// Across the heading of the agent, or across its road.
    Lateral,
}

/// System in which longitudinal and lateral distances are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum CoordinateSystem {
    /// Axes of the agent's body.
    Entity,
    /// Road of the agent, along its bends.
    #[default]
    Road,
}

/// TargetPlace in the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum StoryPosition {
    /// Point of the world frame.
    World {
        /// Along world x.
        x_m: f64,
        /// Along world y.
        y_m: f64,
    },
    /// TargetPlace on the road of the agent whose condition it is.
    Road {
        /// Along the road.
        s_m: f64,
        /// To the left of the road's course.
        t_m: f64,
    },
}

/// Condition on the motion of an agent.
///
/// A quantity that is undefined fulfils no comparison, not even `NotEqualTo`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum EntityCondition {
    /// Speed along the heading.
    Speed {
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value_mps: f64,
    },
    /// Own speed less that of another agent.
    RelativeSpeed {
        /// Other agent.
        entity: String,
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value_mps: f64,
    },
    /// Acceleration along the heading.
    Acceleration {
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value_mps2: f64,
    },
    /// Rest for a duration.
    StandStill {
        /// Duration.
        duration_s: f64,
    },
    /// Way since the start of the episode.
    TraveledDistance {
        /// Way from which it holds.
        value_m: f64,
    },
    /// Distance to another agent.
    RelativeDistance {
        /// Other agent.
        entity: String,
        /// Direction.
        #[serde(default)]
        distance_type: DistanceType,
        /// System of the direction.
        #[serde(default)]
        coordinate_system: CoordinateSystem,
        /// Between the boxes of the bodies, not between their reference points.
        freespace: bool,
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value_m: f64,
    },
    /// Distance from the reference point to a place.
    Distance {
        /// TargetPlace.
        position: StoryPosition,
        /// Direction.
        #[serde(default)]
        distance_type: DistanceType,
        /// System of the direction.
        #[serde(default)]
        coordinate_system: CoordinateSystem,
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value_m: f64,
    },
    /// Arrival within a tolerance of a place.
    ReachPosition {
        /// TargetPlace.
        position: StoryPosition,
        /// Radius around the place.
        tolerance_m: f64,
    },
    /// Distance to an agent ahead along an axis, divided by the own speed.
    TimeHeadway {
        /// Agent ahead.
        entity: String,
        /// System of the distance.
        #[serde(default)]
        coordinate_system: CoordinateSystem,
        /// From the own front to the other's rear, not to its reference point.
        freespace: bool,
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value_s: f64,
    },
    /// Time until the distance to another agent is used up at both present speeds.
    TimeToCollision {
        /// Other agent.
        entity: String,
        /// System of the distance.
        #[serde(default)]
        coordinate_system: CoordinateSystem,
        /// Between the boxes of the bodies, not between their reference points.
        freespace: bool,
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value_s: f64,
    },
    /// Contact with another agent.
    Collision {
        /// Other agent.
        entity: String,
    },
    /// Stay off the lanes of its road for a duration.
    Offroad {
        /// Duration.
        duration_s: f64,
    },
    /// Stay at the end of its road for a duration.
    EndOfRoad {
        /// Duration.
        duration_s: f64,
    },
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
