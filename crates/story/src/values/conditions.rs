//! Triggers and their conditions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::number::is_default;
use super::{StoryNumber, StoryPosition};

/// Groups of conditions. One group suffices, and all of its conditions must hold.
pub type Trigger = Vec<Vec<Condition>>;

/// Condition of a trigger.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Change of the expression that counts.
    #[serde(default, skip_serializing_if = "is_default")]
    pub edge: ConditionEdge,
    /// Time by which the condition lags behind its expression and edge.
    #[serde(default, skip_serializing_if = "is_default")]
    pub delay_s: StoryNumber,
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

/// Comparison of a quantity with a value.
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
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value_s: StoryNumber,
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
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value: StoryNumber,
    },
    /// Parameter of the world's start.
    Parameter {
        /// Its name.
        name: String,
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value: StoryNumber,
    },
    /// Formula in STL over the signals of the world, of the present and the past only.
    ///
    /// It looks back to the sample at or before the instant from which the element waits.
    Formula(String),
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
        #[serde(default, skip_serializing_if = "is_default")]
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

fn longitudinal() -> DistanceType {
    DistanceType::Longitudinal
}

// Serde passes a reference.
#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_longitudinal(it: &DistanceType) -> bool {
    *it == DistanceType::Longitudinal
}

/// Condition on the motion of an agent.
///
/// A quantity that is undefined fulfils no comparison, not even `NotEqualTo`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum EntityCondition {
    /// Speed along the heading.
    Speed {
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value_mps: StoryNumber,
    },
    /// Own speed less that of another agent.
    RelativeSpeed {
        /// Other agent.
        entity: String,
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value_mps: StoryNumber,
    },
    /// Acceleration along the heading.
    Acceleration {
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value_mps2: StoryNumber,
    },
    /// Rest for a duration.
    StandStill {
        /// Duration.
        duration_s: StoryNumber,
    },
    /// Way since the start of the episode.
    TraveledDistance {
        /// Way from which it holds.
        value_m: StoryNumber,
    },
    /// Distance to another agent.
    RelativeDistance {
        /// Other agent.
        entity: String,
        /// Direction.
        #[serde(default, skip_serializing_if = "is_default")]
        distance_type: DistanceType,
        /// System of the direction.
        #[serde(default, skip_serializing_if = "is_default")]
        coordinate_system: CoordinateSystem,
        /// Between the boxes of the bodies, not between their reference points.
        freespace: bool,
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value_m: StoryNumber,
    },
    /// Distance to a place.
    Distance {
        /// Place.
        position: StoryPosition,
        /// From the box of the body, not from its reference point.
        #[serde(default, skip_serializing_if = "is_default")]
        freespace: bool,
        /// Direction.
        #[serde(default, skip_serializing_if = "is_default")]
        distance_type: DistanceType,
        /// System of the direction.
        #[serde(default, skip_serializing_if = "is_default")]
        coordinate_system: CoordinateSystem,
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value_m: StoryNumber,
    },
    /// Arrival within a tolerance of a place.
    ReachPosition {
        /// Place.
        position: StoryPosition,
        /// Radius around the place.
        tolerance_m: StoryNumber,
    },
    /// Distance to an agent ahead, divided by the own speed.
    TimeHeadway {
        /// Agent ahead.
        entity: String,
        /// Direction of the distance. Default: `Longitudinal`.
        #[serde(default = "longitudinal", skip_serializing_if = "is_longitudinal")]
        distance_type: DistanceType,
        /// System of the distance.
        #[serde(default, skip_serializing_if = "is_default")]
        coordinate_system: CoordinateSystem,
        /// From the own front to the other's rear, not to its reference point.
        freespace: bool,
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value_s: StoryNumber,
    },
    /// Time until the distance to another agent is used up at both present speeds.
    TimeToCollision {
        /// Other agent.
        entity: String,
        /// Direction of the distance. Default: `Longitudinal`.
        #[serde(default = "longitudinal", skip_serializing_if = "is_longitudinal")]
        distance_type: DistanceType,
        /// System of the distance.
        #[serde(default, skip_serializing_if = "is_default")]
        coordinate_system: CoordinateSystem,
        /// Between the boxes of the bodies, not between their reference points.
        freespace: bool,
        /// Comparison with the value.
        rule: ComparisonRule,
        /// Compared value.
        value_s: StoryNumber,
    },
    /// Time until the distance to a place is used up at the present speed.
    TimeToPlace {
        /// TargetPlace.
        position: StoryPosition,
        /// Direction of the distance. Default: `Longitudinal`.
        #[serde(default = "longitudinal", skip_serializing_if = "is_longitudinal")]
        distance_type: DistanceType,
        /// System of the distance.
        #[serde(default, skip_serializing_if = "is_default")]
        coordinate_system: CoordinateSystem,
        /// From the box of the body, not from its reference point.
        freespace: bool,
        /// ValueComparison.
        rule: ComparisonRule,
        /// Compared value.
        value_s: StoryNumber,
    },
    /// Contact with another agent.
    Collision {
        /// Other agent.
        entity: String,
    },
    /// Stay off the lanes of its road for a duration.
    Offroad {
        /// Duration.
        duration_s: StoryNumber,
    },
    /// Stay at the end of its road for a duration.
    EndOfRoad {
        /// Duration.
        duration_s: StoryNumber,
    },
}
