//! Interface to the scene: motion at any instant of a sample, and actions.
//!
//! Agents are numbers in the order of the names that were given to
//! [`check`](crate::check::check). A view is right-continuous: at the instant at which an
//! action begins it shows the motion under that action.

use crate::pose::Pose;
use crate::road::OnRoad;
use crate::values::{DynamicsShape, SignalState, TransitionDynamics};

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
    /// First and last station, infinite where the road goes on.
    pub from_s_m: f64,
    /// Last station.
    pub to_s_m: f64,
}

/// Scene at the instants of a sample.
pub trait StoryView {
    /// Returns the motion of an agent.
    fn motion(&self, agent: usize, at_s: f64) -> AgentMotion;
    /// Returns the place of a pose on the road of `viewer`, in road direction.
    fn on_road(&self, viewer: usize, pose: &Pose) -> OnRoad;
    /// Returns the pose of a place on the road of `viewer`.
    fn pose_on_road(&self, viewer: usize, s_m: f64, lateral_m: f64) -> Pose;
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
}

/// Degree of freedom of a body, of which one action at a time has control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionDomain {
    /// Along the path.
    Longitudinal,
    /// Across the path.
    Lateral,
}

/// Action of an agent, with resolved names.
#[derive(Clone, Debug, PartialEq)]
pub enum ActorAction {
    /// Change of speed.
    Speed {
        /// Target.
        target: ActorSpeed,
        /// Course of the change.
        dynamics: TransitionDynamics,
    },
    /// Change of lane.
    LaneChange {
        /// Target.
        target: ActorLane,
        /// Offset from the middle of the new lane, to the left in road direction.
        offset_m: f64,
        /// Course of the change.
        dynamics: TransitionDynamics,
    },
    /// Move to an offset in the lane.
    LaneOffset {
        /// Offset from the middle, to the left in road direction.
        to_m: f64,
        /// Course of the change.
        shape: DynamicsShape,
        /// Greatest lateral acceleration, infinite for a change at once.
        most_lateral_mps2: f64,
    },
}

/// Target speed of an agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ActorSpeed {
    /// A speed in m/s.
    Absolute(f64),
    /// Speed of an agent plus a difference in m/s.
    Delta(usize, f64),
    /// Speed of an agent times a factor.
    Factor(usize, f64),
}

/// Target lane of an agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ActorLane {
    /// A lane, counted from 0 at the right.
    Absolute(usize),
    /// Lane of an agent, plus a number to the left.
    Relative(usize, i32),
}

impl ActorAction {
    /// Returns the degree of freedom that it controls.
    pub fn domain(&self) -> MotionDomain {
        match self {
            ActorAction::Speed { .. } => MotionDomain::Longitudinal,
            ActorAction::LaneChange { .. } | ActorAction::LaneOffset { .. } => {
                MotionDomain::Lateral
            }
        }
    }
}

/// Scene that performs the actions of a storyboard.
pub trait StoryStage: StoryView {
    /// Begins an action of an agent. It replaces the one of the same domain.
    fn begin(&mut self, agent: usize, action: &ActorAction, at_s: f64);
    /// Returns the instant at which the action of a domain ends, as known now.
    ///
    /// Infinite if it does not end by itself.
    fn ends_s(&self, agent: usize, domain: MotionDomain) -> f64;
    /// Stops the action of a domain, so that the body keeps its speed or its lateral place.
    fn stop(&mut self, agent: usize, domain: MotionDomain, at_s: f64);
}
