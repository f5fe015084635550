//! Actions of events and their effects.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::number::is_default;
use super::{
    CoordinateSystem, SignalState, StoryNumber, StoryPosition, StoryTrajectory, TrajectoryTiming,
};
use crate::road::ChangeShape;

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
        #[serde(default, skip_serializing_if = "is_default")]
        target_lane_offset_m: StoryNumber,
        /// Course of the change.
        dynamics: TransitionDynamics,
    },
    /// Each actor follows a list of speeds.
    SpeedProfile {
        /// Agent whose speed at the start of the action is added. Default: none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        entity: Option<String>,
        /// Speeds, one after the other.
        points: Vec<SpeedPoint>,
        /// Whether dynamics or times are exact.
        #[serde(default, skip_serializing_if = "is_default")]
        following: FollowingMode,
        /// Limits of the motion. Without any the speeds are exact.
        #[serde(default, skip_serializing_if = "DynamicLimits::is_unlimited")]
        limits: DynamicLimits,
    },
    /// Each actor keeps a distance along its path to another agent.
    LongitudinalDistance {
        /// Other agent.
        entity: String,
        /// Distance.
        distance: DistanceOrTime,
        /// Side of the other agent.
        #[serde(default, skip_serializing_if = "is_default")]
        displacement: LongitudinalDisplacement,
        /// Between the boxes of the bodies, not between their reference points.
        freespace: bool,
        /// System of the distance.
        #[serde(default, skip_serializing_if = "is_default")]
        coordinate_system: CoordinateSystem,
        /// Whether it goes on once the distance is reached.
        #[serde(default, skip_serializing_if = "is_default")]
        continuous: bool,
        /// Limits of the motion. Without any the distance is reached at once.
        #[serde(default, skip_serializing_if = "DynamicLimits::is_unlimited")]
        limits: DynamicLimits,
    },
    /// Each actor reaches a place when another agent reaches its own.
    Synchronize {
        /// Other agent.
        master: String,
        /// Place of the other agent.
        master_position: StoryPosition,
        /// Place of the actor.
        target_position: StoryPosition,
        /// Speed of the actor there. Default: any.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        final_speed: Option<FinalSpeed>,
        /// Distance or time before the place from which the final speed is kept.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        steady: Option<DistanceOrTime>,
        /// Distance at which the other agent counts as there.
        #[serde(default, skip_serializing_if = "is_default")]
        master_tolerance_m: StoryNumber,
        /// Distance at which the actor counts as there.
        #[serde(default, skip_serializing_if = "is_default")]
        target_tolerance_m: StoryNumber,
    },
    /// Each actor keeps a distance across its path to another agent.
    LateralDistance {
        /// Other agent.
        entity: String,
        /// Distance. Default: 0.
        #[serde(default, skip_serializing_if = "is_default")]
        distance_m: StoryNumber,
        /// Side of the other agent.
        #[serde(default, skip_serializing_if = "is_default")]
        displacement: LateralDisplacement,
        /// Between the boxes of the bodies, not between their reference points.
        freespace: bool,
        /// System of the distance.
        #[serde(default, skip_serializing_if = "is_default")]
        coordinate_system: CoordinateSystem,
        /// Whether it goes on once the distance is reached.
        #[serde(default, skip_serializing_if = "is_default")]
        continuous: bool,
        /// Limits of the lateral motion. Without any the distance is reached at once.
        #[serde(default, skip_serializing_if = "DynamicLimits::is_unlimited")]
        limits: DynamicLimits,
    },
    /// Each actor moves to an offset from the middle of its lane.
    LaneOffset {
        /// Offset from the middle, to the left in road direction.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        target_m: Option<StoryNumber>,
        /// Target, instead of `target_m`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        target: Option<OffsetTarget>,
        /// Whether it goes on once the offset is reached.
        #[serde(default, skip_serializing_if = "is_default")]
        continuous: bool,
        /// Course of the change.
        #[serde(default = "sinusoidal")]
        shape: DynamicsShape,
        /// Greatest lateral acceleration. Default: at once.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        max_lateral_acc_mps2: Option<StoryNumber>,
    },
    /// A variable gets a value.
    VariableSet {
        /// Its name.
        name: String,
        /// New value.
        value: StoryNumber,
    },
    /// A variable changes by a value.
    VariableAdd {
        /// Its name.
        name: String,
        /// Added value.
        value: StoryNumber,
    },
    /// A variable is multiplied.
    VariableMultiply {
        /// Its name.
        name: String,
        /// Factor.
        value: StoryNumber,
    },
    /// Each actor follows a curve. Without timing it moves only across its path.
    FollowTrajectory {
        /// Curve.
        trajectory: StoryTrajectory,
        /// Meaning of its times. Default: none, and the speed is that of other actions.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        timing: Option<TrajectoryTiming>,
        /// Whether the dynamics or the curve are exact.
        #[serde(default, skip_serializing_if = "is_default")]
        following: FollowingMode,
        /// Distance along the curve at which it begins.
        #[serde(default, skip_serializing_if = "is_default")]
        initial_distance_m: StoryNumber,
    },
    /// Each actor follows another road from its place on.
    AssignRoute {
        /// Named road. Default: the world's own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        road: Option<String>,
    },
    /// Each actor is at a place at once.
    Teleport {
        /// Place.
        position: StoryPosition,
    },
    /// Controllers of the actors drive along or across the path, or leave it to actions.
    ActivateController {
        /// Along the path. Default: unchanged.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        longitudinal: Option<bool>,
        /// Across the path. Default: unchanged.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        lateral: Option<bool>,
    },
    /// An agent appears.
    Add {
        /// Agent.
        entity: String,
        /// Place.
        position: StoryPosition,
    },
    /// An agent vanishes.
    Delete {
        /// Agent.
        entity: String,
    },
    /// The road gets another friction.
    Friction {
        /// μ of the road.
        value: StoryNumber,
    },
    /// A traffic light changes.
    TrafficSignal {
        /// Name of the light.
        name: String,
        /// Its phase.
        state: SignalState,
    },
}

/// Speed of a profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "SpeedPoint")]
pub struct SpeedPoint<N = StoryNumber> {
    /// Duration of the change to the speed. Default: that of the limits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<N>,
    /// Speed.
    pub speed_mps: N,
}

/// Exact quantity of an agent that follows a profile or a trajectory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum FollowingMode {
    /// Place and time.
    #[default]
    Position,
    /// Dynamics of the body, from which place and time deviate.
    Follow,
}

/// Limits of a motion. `None` is unlimited.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "DynamicLimits")]
pub struct DynamicLimits<N = StoryNumber> {
    /// Greatest speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_speed_mps: Option<N>,
    /// Greatest acceleration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_accel_mps2: Option<N>,
    /// Greatest deceleration, positive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_decel_mps2: Option<N>,
}

// A derived default would require one of `N`, which no absent limit needs.
impl<N> Default for DynamicLimits<N> {
    fn default() -> DynamicLimits<N> {
        DynamicLimits {
            max_speed_mps: None,
            max_accel_mps2: None,
            max_decel_mps2: None,
        }
    }
}

impl<N> DynamicLimits<N> {
    /// Returns whether nothing is limited.
    pub fn is_unlimited(&self) -> bool {
        self.max_speed_mps.is_none()
            && self.max_accel_mps2.is_none()
            && self.max_decel_mps2.is_none()
    }
}

/// Distance, as a length or as a time in which it is driven.
///
/// The speed of that time is the final one of a meeting, and otherwise the other agent's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "DistanceOrTime")]
pub enum DistanceOrTime<N = StoryNumber> {
    /// Length in metres.
    Metres(N),
    /// Time in seconds.
    Seconds(N),
}

/// Side of another agent along the path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum LongitudinalDisplacement {
    /// The present one.
    Any,
    /// Behind it.
    #[default]
    Trailing,
    /// Ahead of it.
    Leading,
}

/// Side of another agent across the path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum LateralDisplacement {
    /// The present one.
    #[default]
    Any,
    /// To its left.
    LeftTo,
    /// To its right.
    RightTo,
}

/// Speed at the end of a synchronisation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "FinalSpeed")]
pub enum FinalSpeed<N = StoryNumber> {
    /// Speed in m/s.
    Absolute(N),
    /// Speed of the other agent plus a difference in m/s.
    RelativeToMaster(N),
}

/// Target of a lane offset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum OffsetTarget {
    /// Offset from the middle of the own lane.
    Absolute {
        /// Offset, to the left in road direction.
        value_m: StoryNumber,
    },
    /// Offset from the place of another agent.
    Relative {
        /// Agent on the same road.
        entity: String,
        /// Offset, to the left in road direction.
        value_m: StoryNumber,
    },
    /// A line along the actor's road.
    Line {
        /// Distance to the left of the road's course.
        lateral_m: StoryNumber,
    },
}

/// Target of a speed action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum SpeedTarget {
    /// A speed.
    Absolute {
        /// The speed.
        value_mps: StoryNumber,
    },
    /// Speed of another agent at the start of the action, plus a difference.
    Delta {
        /// Other agent.
        entity: String,
        /// Difference.
        value_mps: StoryNumber,
        /// Whether it follows the other's speed and never ends by itself.
        #[serde(default, skip_serializing_if = "is_default")]
        continuous: bool,
    },
    /// Speed of another agent at the start of the action, times a factor.
    Factor {
        /// Other agent.
        entity: String,
        /// Factor.
        value: StoryNumber,
        /// Whether it follows the other's speed and never ends by itself.
        #[serde(default, skip_serializing_if = "is_default")]
        continuous: bool,
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
    /// A line along the actor's road, on a lane or beside all of them.
    Line {
        /// Distance to the left of the road's course.
        lateral_m: StoryNumber,
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Dynamics", deny_unknown_fields)]
pub struct TransitionDynamics {
    /// Shape.
    pub shape: DynamicsShape,
    /// Size, which all shapes but a step need.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dimension: Option<Dimension>,
}

/// Size of a transition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Dimension")]
pub enum Dimension<N = StoryNumber> {
    /// Greatest rate of change per second, of the speed or of the lateral place.
    Rate(N),
    /// Duration in seconds.
    Time(N),
    /// Way along the path in metres.
    Distance(N),
}

fn sinusoidal() -> DynamicsShape {
    DynamicsShape::Sinusoidal
}
