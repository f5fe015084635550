//! Interface to the scene: motion at any instant of a sample, and actions.
//!
//! Agents are numbers in the order of the names that were given to
//! [`check`](crate::check::check). A view is right-continuous: at the instant at which an
//! action begins it shows the motion under that action.

use std::sync::Arc;

use crate::pose::Pose;
use crate::road::OnRoad;
use crate::robustness::SampledRobustness;
use crate::trajectory::TrajectoryPath;
use crate::values::{
    CoordinateSystem, Dimension, DistanceOrTime, DynamicLimits, DynamicsShape, FinalSpeed,
    FollowingMode, SignalState, SpeedPoint, TrajectoryTiming,
};

/// Motion of an agent at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AgentMotion {
    /// Middle of the front bumper.
    pub pose: Pose,
    /// Speed along the heading.
    pub speed_mps: f64,
    /// Speed to the left of the heading.
    pub lateral_mps: f64,
    /// Acceleration along the heading.
    pub accel_mps2: f64,
}

impl AgentMotion {
    /// Returns the motion at a share of the way in time to another.
    ///
    /// Even acceleration is exact on straight roads, since the curve has both velocities.
    pub fn towards(&self, to: &AgentMotion, lasts_s: f64, share: f64) -> AgentMotion {
        let (from_v, to_v) = (self.velocity_mps(), to.velocity_mps());
        // Weights of the cubic curve through both places with both velocities.
        let back = 1.0 - share;
        let end = share * share * (3.0 - 2.0 * share);
        let (leave, arrive) = (share * back * back, -share * share * back);
        let at = |from: f64, to: f64, from_v: f64, to_v: f64| {
            from + (to - from) * end + lasts_s * (leave * from_v + arrive * to_v)
        };
        let mix = |from: f64, to: f64| from + (to - from) * share;
        // The shorter way around, because headings are wrapped.
        let turn_rad = crate::road::wrapped(to.pose.heading_rad - self.pose.heading_rad);
        AgentMotion {
            pose: Pose {
                x_m: at(self.pose.x_m, to.pose.x_m, from_v[0], to_v[0]),
                y_m: at(self.pose.y_m, to.pose.y_m, from_v[1], to_v[1]),
                heading_rad: self.pose.heading_rad + turn_rad * share,
            },
            speed_mps: mix(self.speed_mps, to.speed_mps),
            lateral_mps: mix(self.lateral_mps, to.lateral_mps),
            // The plant reports the mean of the sample, which applies until its end.
            accel_mps2: to.accel_mps2,
        }
    }

    /// Returns the motion after a time at the same acceleration. It never reverses.
    pub fn ahead(&self, for_s: f64) -> AgentMotion {
        let rests_s = if self.accel_mps2 < 0.0 {
            (self.speed_mps / -self.accel_mps2).max(0.0)
        } else {
            f64::INFINITY
        };
        // At rest the deceleration ends, or the body would drive backwards.
        let moves_s = for_s.min(rests_s);
        let way_m = (self.speed_mps + 0.5 * self.accel_mps2 * moves_s) * moves_s;
        AgentMotion {
            pose: self.pose.ahead(way_m),
            speed_mps: self.speed_mps + self.accel_mps2 * moves_s,
            ..*self
        }
    }

    /// Returns the velocity in the world frame.
    pub fn velocity_mps(&self) -> [f64; 2] {
        let (sin, cos) = libm::sincos(self.pose.heading_rad);
        [
            self.speed_mps * cos - self.lateral_mps * sin,
            self.speed_mps * sin + self.lateral_mps * cos,
        ]
    }
}

/// Size of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AgentSize {
    /// Length.
    pub length_m: f64,
    /// Width.
    pub width_m: f64,
    /// Distance from the reference point to the middle of the front bumper.
    ///
    /// The point is the middle of the rear axle, or that of a walker.
    pub front_m: f64,
}

/// Agent at the pose of its front bumper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosedAgent {
    /// Its number.
    pub agent: usize,
    /// Middle of its front bumper.
    pub pose: Pose,
}

/// Road of an agent, as far as conditions ask for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoadLimits {
    /// Right border of the rightmost lane, to the left of the course.
    pub right_m: f64,
    /// Left border of the leftmost lane.
    pub left_m: f64,
    /// First station, −∞ where the road goes on.
    pub from_s_m: f64,
    /// Last station, +∞ where the road goes on.
    pub to_s_m: f64,
}

/// Scene at the instants of a sample.
pub trait StoryView {
    /// Returns the motion of an agent.
    fn motion(&self, agent: usize, at_s: f64) -> AgentMotion;
    /// Returns the place of a pose on the road of `viewer`, in road direction.
    fn on_road(&self, viewer: usize, pose: &Pose) -> OnRoad;
    /// Returns the pose of a place on a road, or on that of `viewer`.
    fn pose_on_road(&self, viewer: usize, road: Option<usize>, s_m: f64, lateral_m: f64) -> Pose;
    /// Returns the middle of the lane that is a number to the left of a place.
    ///
    /// Beyond the road it is that of the outermost lane.
    fn lane_middle_m(&self, viewer: usize, lateral_m: f64, lanes: i32) -> f64;
    /// Returns the borders and ends of the road of an agent.
    fn road_limits(&self, agent: usize) -> RoadLimits;
    /// Returns the size of an agent's body.
    fn size(&self, agent: usize) -> AgentSize;
    /// Returns the clearance of two bodies, 0 if they touch.
    fn gap_m(&self, bodies: [PosedAgent; 2]) -> f64;
    /// Returns the phase of a light.
    fn signal(&self, light: usize, at_s: f64) -> SignalState;
    /// Returns a parameter of the start.
    fn parameter(&self, number: usize) -> f64;
    /// Returns the robustness of a formula over the sample.
    fn robustness(&self, formula: usize) -> SampledRobustness;

    /// Returns the pose of the reference point of an agent.
    fn reference(&self, agent: usize, at_s: f64) -> Pose {
        let front = self.motion(agent, at_s).pose;
        front.ahead(-self.size(agent).front_m)
    }

    /// Returns the pose of a place. `viewer` is the agent whose condition or action it is.
    fn pose_of(&self, viewer: usize, place: &StoryPlace, at_s: f64) -> Pose {
        let StoryPlace {
            along_m, left_m, ..
        } = *place;
        let own = match place.frame {
            PlaceFrame::World => Pose {
                x_m: along_m,
                y_m: left_m,
                heading_rad: 0.0,
            },
            PlaceFrame::Road(road) => self.pose_on_road(viewer, road, along_m, left_m),
            PlaceFrame::AgentInWorld(of) => {
                let at = self.reference(of, at_s);
                Pose {
                    x_m: at.x_m + along_m,
                    y_m: at.y_m + left_m,
                    // The axes are those of the world, but a heading
                    // counts from the agent's.
                    ..at
                }
            }
            PlaceFrame::Agent(of) => {
                let at = self.reference(of, at_s);
                let point = at.frame().to_world(along_m, left_m);
                Pose {
                    x_m: point.x,
                    y_m: point.y,
                    ..at
                }
            }
            PlaceFrame::AgentOnRoad(of) => {
                // The agent's own road, which may differ from that of `viewer`.
                let at = self.on_road(of, &self.reference(of, at_s));
                self.pose_on_road(of, None, at.s_m + along_m, at.lateral_m + left_m)
            }
            PlaceFrame::AgentLane(of, lanes) => {
                let at = self.on_road(of, &self.reference(of, at_s));
                // The offset counts from the lane's middle, not from the
                // agent's place in its lane.
                let middle_m = self.lane_middle_m(of, at.lateral_m, lanes);
                self.pose_on_road(of, None, at.s_m + along_m, middle_m + left_m)
            }
        };
        Pose {
            heading_rad: own.heading_rad + place.heading_rad.unwrap_or(0.0),
            ..own
        }
    }
}

/// Place with resolved names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoryPlace {
    /// System of its coordinates.
    pub frame: PlaceFrame,
    /// Along the first axis of the system.
    pub along_m: f64,
    /// To the left of that axis.
    pub left_m: f64,
    /// Heading relative to the system, or `None` for its own.
    pub heading_rad: Option<f64>,
}

/// System of the coordinates of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlaceFrame {
    /// World.
    World,
    /// A road by its number, or the own road.
    Road(Option<usize>),
    /// Reference point of an agent, in the axes of the world.
    AgentInWorld(usize),
    /// Reference point and heading of an agent.
    Agent(usize),
    /// Place of an agent's reference point on its road.
    AgentOnRoad(usize),
    /// Middle of the lane that is a number to the left of an agent's.
    AgentLane(usize, i32),
}

/// Degree of freedom of a body, of which one action at a time has control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionDomain {
    /// Along the path.
    Longitudinal,
    /// Across the path.
    Lateral,
}

/// Course of a change, with its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActorTransition {
    /// Shape.
    pub shape: DynamicsShape,
    /// Size, which means nothing for a step.
    pub dimension: Dimension<f64>,
}

/// Action of an agent, with resolved names and numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum ActorAction {
    /// Change of speed.
    Speed {
        /// Target.
        target: ActorSpeed,
        /// Course of the change.
        dynamics: ActorTransition,
    },
    /// List of speeds.
    SpeedProfile {
        /// Agent whose speed at the start is added.
        relative_to: Option<usize>,
        /// Speeds.
        points: Vec<SpeedPoint<f64>>,
        /// Exact quantity.
        following: FollowingMode,
        /// Limits.
        limits: DynamicLimits<f64>,
    },
    /// Distance along the path to another agent.
    LongitudinalDistance(ActorDistance),
    /// Arrival at a place when another agent arrives at its own.
    Synchronize(Synchronization),
    /// Distance across the path to another agent.
    LateralDistance(ActorDistance),
    /// Change of lane.
    LaneChange {
        /// Target.
        target: ActorLane,
        /// Offset from the middle of the new lane, to the left in road direction.
        offset_m: f64,
        /// Course of the change.
        dynamics: ActorTransition,
    },
    /// Move to an offset in the lane.
    LaneOffset {
        /// Target.
        target: ActorOffset,
        /// Whether it goes on once the offset is reached.
        continuous: bool,
        /// Course of the change.
        shape: DynamicsShape,
        /// Greatest lateral acceleration, infinite for a change at once.
        most_lateral_mps2: f64,
    },
    /// Motion along a curve.
    FollowTrajectory {
        /// Curve.
        path: Arc<TrajectoryPath>,
        /// Meaning of its times, or `None` for a motion only across the path.
        timing: Option<TrajectoryTiming<f64>>,
        /// Exact quantity.
        following: FollowingMode,
        /// Distance along the curve at which it begins.
        initial_distance_m: f64,
    },
    /// Another road from the present place on, by its number.
    AssignRoute(usize),
    /// Motion to a place at once.
    Teleport(StoryPlace),
    /// Control by the agent's own controller, or by actions.
    ActivateController {
        /// Along the path.
        longitudinal: Option<bool>,
        /// Across the path.
        lateral: Option<bool>,
    },
}

/// Change of the scene by a storyboard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SceneChange {
    /// An agent appears at a place.
    Add(usize, StoryPlace),
    /// An agent vanishes.
    Delete(usize),
    /// Road gets a friction.
    Friction(f64),
    /// Light gets a phase.
    TrafficSignal(usize, SignalState),
}

/// Target speed of an agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ActorSpeed {
    /// A speed in m/s.
    Absolute(f64),
    /// Speed of an agent plus a difference in m/s.
    Delta(RelativeTarget),
    /// Speed of an agent times a factor.
    Factor(RelativeTarget),
}

/// Target that depends on another agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeTarget {
    /// Other agent.
    pub of: usize,
    /// Difference or factor.
    pub by: f64,
    /// Whether it follows the other agent and never ends by itself.
    pub continuous: bool,
}

/// Distance that an agent keeps to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActorDistance {
    /// Other agent.
    pub of: usize,
    /// Distance.
    pub distance: DistanceOrTime<f64>,
    /// Side of the other agent on which it is kept.
    pub side: DistanceSide,
    /// Between the boxes of the bodies, not between their reference points.
    pub freespace: bool,
    /// System of the distance.
    pub system: CoordinateSystem,
    /// Whether it goes on once the distance is reached.
    pub continuous: bool,
    /// Limits of the motion.
    pub limits: DynamicLimits<f64>,
}

/// Side of another agent, along or across the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DistanceSide {
    /// The present one.
    Any,
    /// Behind it or to its right.
    Less,
    /// Ahead of it or to its left.
    More,
}

/// Arrival of an agent at a place when another arrives at its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Synchronization {
    /// Other agent.
    pub master: usize,
    /// Place of the other agent.
    pub master_place: StoryPlace,
    /// Place of the actor.
    pub target_place: StoryPlace,
    /// Speed of the actor there, or `None` for any.
    pub final_speed: Option<FinalSpeed<f64>>,
    /// Distance or time before the place from which the final speed is kept.
    pub steady: Option<DistanceOrTime<f64>>,
    /// Distance at which the other agent counts as there.
    pub master_tolerance_m: f64,
    /// Distance at which the actor counts as there.
    pub target_tolerance_m: f64,
}

/// Target lane of an agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ActorLane {
    /// A lane, counted from 0 at the right.
    Absolute(usize),
    /// Lane of an agent, plus a number to the left.
    Relative(usize, i32),
    /// Line to the left of the road's course, in metres.
    Line(f64),
}

/// Target offset of an agent, to the left in road direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ActorOffset {
    /// From the middle of its lane, in metres.
    Absolute(f64),
    /// From the place of an agent, in metres.
    Relative(usize, f64),
    /// From the road's course, in metres.
    Line(f64),
}

impl ActorAction {
    /// Returns the degrees of freedom that it controls.
    pub fn domains(&self) -> &'static [MotionDomain] {
        match self {
            ActorAction::Speed { .. }
            | ActorAction::SpeedProfile { .. }
            | ActorAction::LongitudinalDistance(_)
            | ActorAction::Synchronize(_) => &[MotionDomain::Longitudinal],
            ActorAction::LaneChange { .. }
            | ActorAction::LaneOffset { .. }
            | ActorAction::LateralDistance(_)
            | ActorAction::FollowTrajectory { timing: None, .. } => &[MotionDomain::Lateral],
            // Times fix the progress along the curve, so it controls the speed as well.
            ActorAction::FollowTrajectory { .. } => {
                &[MotionDomain::Longitudinal, MotionDomain::Lateral]
            }
            // They take effect at once and leave both to other actions.
            ActorAction::AssignRoute(_)
            | ActorAction::Teleport(_)
            | ActorAction::ActivateController { .. } => &[],
        }
    }

    /// Returns whether it goes on until another action takes over.
    pub fn is_endless(&self) -> bool {
        match self {
            ActorAction::Speed {
                target: ActorSpeed::Delta(target) | ActorSpeed::Factor(target),
                ..
            } => target.continuous,
            ActorAction::LongitudinalDistance(distance)
            | ActorAction::LateralDistance(distance) => distance.continuous,
            ActorAction::LaneOffset { continuous, .. } => *continuous,
            _ => false,
        }
    }
}

/// Scene that performs the actions of a storyboard.
pub trait StoryStage: StoryView {
    /// Begins an action of an agent. It replaces those of its domains.
    fn begin(&mut self, agent: usize, action: &ActorAction, at_s: f64);
    /// Changes the scene.
    fn change(&mut self, change: SceneChange, at_s: f64);
    /// Returns the instant at which the action of a domain ends, as known now.
    ///
    /// Infinite if it does not end by itself, or if its end is not known yet.
    fn ends_s(&self, agent: usize, domain: MotionDomain) -> f64;
    /// Stops the action of a domain, so that the body keeps its speed or its lateral place.
    fn stop(&mut self, agent: usize, domain: MotionDomain, at_s: f64);
    /// Lets a formula look back no further than the sample at or before an instant.
    fn watch(&mut self, formula: usize, at_s: f64);
}
