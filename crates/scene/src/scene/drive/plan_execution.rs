//! A plan in motion: the state of an agent on its plan, sample by sample.
//!
//! The laws move the rear axle of vehicles and the middle of pedestrians. The
//! body lies along its velocity. Laws that begin or end within a sample do so
//! at their own instant. Between those instants speeds are linear and lateral
//! motion has a closed form, so no error accumulates over time.

mod along;
mod beside;
mod steps;
mod story_laws;
mod ways;

use std::collections::VecDeque;
use std::sync::Arc;

use nalgebra::Vector2;

use super::along_law::AlongRun;
use super::beside_law::BesideRun;
use super::motion_profile::{SAME_S, SpeedRamp, Swing, forward_part};
use super::plan::{MotionPlan, ScriptStep, Unmet};
use super::plan_way::{PlanWay, TimedLegs};
use super::spec::DriveSpec;
use super::story_law::DueLaw;
use crate::ego::Command;
use crate::road::{Course, Road, RoadNetwork, wrapped};
use crate::sim::{Pose, rotation_by};
use crate::stl::{Monitor, OnlineMonitor};
use crate::story::robustness::{RobustnessAt, SampledRobustness};
use crate::story::view::AgentMotion;

/// Speed below which a body keeps its heading.
const TURNING_MPS: f64 = 0.05;
/// Distance below which a body counts as not displaced.
const SAME_M: f64 = 1e-9;
/// Parts of a sample in which a lateral motion may lag behind its plan.
const LAG_PARTS: u32 = 10;
/// Largest lateral deviation speed of a vehicle, as a share of its speed.
const MAX_SLIP: f64 = 0.4;

/// Planned state of an agent: front bumper on its road, and speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PlannedAt {
    pub s_m: f64,
    pub lateral_m: f64,
    pub speed_mps: f64,
}

/// Constant data of a planned agent.
#[derive(Clone, Debug)]
pub(super) struct PlanConstants {
    /// Distance from the point moved by the laws to the front.
    pub lever_m: f64,
    /// Distance from the point that stories move to the front.
    pub front_m: f64,
    pub length_m: f64,
    pub width_m: f64,
    /// Heading at the start, relative to the road's direction.
    pub facing_rad: f64,
    pub on_foot: bool,
    /// Formulas of its steps, each as "has once been true".
    pub whens: Arc<[Option<Monitor>]>,
}

/// Deviation of an agent from its plan, in its own heading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Stray {
    ahead_m: f64,
    ahead_mps: f64,
    left_m: f64,
    left_mps: f64,
}

/// State of a body at the end of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Arrival {
    pub pose: Pose,
    /// Speed along the heading.
    pub speed_mps: f64,
    /// Speed to the left of the heading, at the front.
    pub lateral_mps: f64,
    pub yaw_rate_rad_per_s: f64,
    pub accel_mps2: f64,
}

#[derive(Clone, Debug)]
enum PlanPhase {
    /// Waits for the formula of the step.
    Waits {
        since_s: f64,
        /// Robustness at the previous sample.
        before: Option<RobustnessAt>,
        watch: Box<OnlineMonitor>,
    },
    /// Waits for a time.
    Due(f64),
    Acts {
        /// End of its laws along the path, and of those across it that it overlaps.
        ends_s: f64,
        /// Whether it also ends no earlier than the lateral motion.
        awaits_swing: bool,
    },
    /// No steps are left.
    Over,
}

/// An agent on its plan.
#[derive(Clone, Debug)]
pub(super) struct PlanRun {
    carried: PlanConstants,
    steps: Vec<ScriptStep<f64, ()>>,
    step: usize,
    phase: PlanPhase,
    ramp: SpeedRamp,
    swing: Option<Swing>,
    /// The point moved by the laws, on its road.
    s_m: f64,
    lateral_m: f64,
    /// Initial lateral position, which determines the lane, and the sum of all
    /// lane changes since.
    start_m: f64,
    changed_m: f64,
    /// Heading relative to the road's direction, with and without deviation.
    heading_rad: f64,
    planned_rad: f64,
    stray: Stray,
    last: Arrival,
    /// Laws of a story that are to begin, in the order of time.
    laws: VecDeque<DueLaw>,
    /// Way that it follows instead of its own road.
    way: Option<Arc<PlanWay>>,
    /// Parts of a trajectory with times.
    legs: Option<TimedLegs>,
    /// Speeds that follow the present one.
    profile: VecDeque<SpeedRamp>,
    /// Speed that depends on another agent.
    along: Option<AlongRun>,
    /// Lateral place to another agent that it keeps.
    beside: Option<BesideRun>,
    /// End of the last trajectory or lateral place that has ended by itself.
    way_ended_s: f64,
    /// Whether it has been put somewhere else since its body moved.
    has_jumped: bool,
    /// Whether it is out of reach, and obeys nothing but a place.
    is_absent: bool,
}

/// Interval of a sample, with roads and agents at its beginning, as input to a plan.
#[derive(Clone, Copy)]
pub(super) struct SampleSpan<'a> {
    /// The agent's own road.
    pub course: &'a Course,
    pub road: &'a Road,
    pub network: &'a RoadNetwork,
    pub spec: &'a DriveSpec,
    /// Motion of an agent at an instant of the sample.
    pub motion_of: &'a dyn Fn(usize, f64) -> AgentMotion,
    pub from_s: f64,
    pub to_s: f64,
}

impl SampleSpan<'_> {
    /// Returns the speed of an agent, 0 for an unknown one.
    fn speed_of(&self, name: &str) -> f64 {
        let mut agents = self.spec.agents.iter();
        let other = agents.position(|agent| agent.name == name);
        other.map_or(0.0, |other| (self.motion_of)(other, self.from_s).speed_mps)
    }
}

impl PlanRun {
    /// Begins with the front at a place of the road.
    ///
    /// The road counts as straight there. On bends the body lies along the
    /// tangent at its rear axle.
    ///
    /// # Errors
    /// The meeting is infeasible.
    pub(super) fn begin(
        carried: PlanConstants,
        plan: MotionPlan<f64, ()>,
        front: PlannedAt,
        ego: PlannedAt,
    ) -> Result<PlanRun, Unmet> {
        let (front_m, lateral_m) = (front.s_m, front.lateral_m);
        let (cos, sin) = carried.direction();
        let (speed_mps, steps) = match plan {
            MotionPlan::Script(steps) => (front.speed_mps, steps),
            MotionPlan::Meet(meet) => {
                // Agents that face across the road measure the distance
                // laterally.
                let way_m = if cos.abs() < sin.abs() {
                    sin.signum() * (meet.here_at_m - lateral_m)
                } else {
                    cos.signum() * (meet.here_at_m - front_m)
                };
                let approach = meet.approach(ego.s_m, ego.speed_mps, way_m)?;
                (approach.from_mps, vec![approach.step()])
            }
        };
        let mut run = PlanRun {
            steps,
            step: 0,
            phase: PlanPhase::Over,
            ramp: SpeedRamp::steady(speed_mps),
            swing: None,
            s_m: front_m - carried.lever_m * cos,
            lateral_m: lateral_m - carried.lever_m * sin,
            start_m: lateral_m,
            changed_m: 0.0,
            heading_rad: carried.facing_rad,
            planned_rad: carried.facing_rad,
            stray: Stray::default(),
            last: Arrival {
                speed_mps,
                ..Arrival::default()
            },
            laws: VecDeque::new(),
            way: None,
            legs: None,
            profile: VecDeque::new(),
            along: None,
            beside: None,
            way_ended_s: f64::NEG_INFINITY,
            has_jumped: false,
            is_absent: false,
            carried,
        };
        run.phase = run.turn_of(0, 0.0);
        Ok(run)
    }

    /// Returns the planned speed now.
    pub(super) fn speed_mps(&self) -> f64 {
        self.ramp.speed_mps(self.ramp.begins_s)
    }

    /// Returns whether it waits for a formula, which needs rows of signals.
    pub(super) fn is_watching(&self) -> bool {
        matches!(self.phase, PlanPhase::Waits { .. })
    }

    /// Checks the trigger of the next step at a sample.
    ///
    /// The instant at which it came true is interpolated from ρ at the previous
    /// and the current sample.
    pub(super) fn look(&mut self, row: &[f64], time_s: f64) {
        let PlanPhase::Waits {
            since_s,
            before,
            watch,
        } = &mut self.phase
        else {
            return;
        };
        // A row that is not finite ends the episode elsewhere.
        let Ok(seen) = watch.push(row) else {
            return;
        };
        let now = RobustnessAt {
            at_s: time_s,
            rho: seen.lo,
        };
        if !now.holds() {
            *before = Some(now);
            return;
        }
        let sampled = SampledRobustness {
            before: *before,
            now,
        };
        // Without a change it held when it was first checked.
        let came_s = sampled.change_s().unwrap_or(*since_s);
        self.phase = PlanPhase::Due(came_s + self.steps[self.step].after_s);
    }

    /// Advances by a sample.
    ///
    /// `deviation` is what an ado adds, along its heading and to the left of it.
    pub(super) fn advance(&mut self, stretch: SampleSpan<'_>, deviation: Command) -> Arrival {
        let SampleSpan { from_s, to_s, .. } = stretch;
        let mut time_s = from_s;
        let mut driven = Driven::default();
        loop {
            // Steps due at the end of the sample are settled too, so the
            // arrival has the motion that follows them.
            self.settle(time_s, stretch);
            self.pursue(time_s, stretch);
            self.aim(time_s, stretch);
            if to_s - SAME_S <= time_s {
                break;
            }
            let change_s = self.next_change_s(time_s).min(to_s);
            let next_s = self.way_end_s(time_s, change_s);
            // A handle, as the plan changes on its way.
            let way = self.way.clone();
            let course = way.as_deref().map_or(stretch.course, PlanWay::course);
            driven.add(self.move_on(course, time_s, next_s));
            time_s = next_s;
        }
        let sample_s = to_s - from_s;
        let speed_mps = self.ramp.speed_mps(to_s);
        let strayed_m = self.stray_on(deviation, speed_mps, sample_s, driven);
        let wanted_mps = self
            .swing
            .map_or(0.0, |swing| swing.speed_mps(to_s, speed_mps));
        let end = SampleEnd {
            sample_s,
            speed_mps,
            // Where the plan demands more, the body lags behind it.
            sideways_mps: wanted_mps.clamp(-speed_mps, speed_mps),
            planned_m: driven.way_m,
            driven_m: driven.way_m + strayed_m,
        };
        let way = self.way.clone();
        self.arrive(way.as_deref().map_or(stretch.course, PlanWay::course), end)
    }

    /// Returns the planned state, without deviations.
    pub(super) fn planned(&self, course: &Course, time_s: f64) -> PlannedAt {
        let front = self.front(self.course(course), Stray::default(), self.planned_rad);
        let at = course.locate(&front);
        PlannedAt {
            s_m: at.s_m,
            lateral_m: at.lateral_m,
            speed_mps: self.ramp.speed_mps(time_s),
        }
    }

    /// Returns the pose of the front bumper now.
    pub(super) fn pose(&self, course: &Course) -> Pose {
        self.front(self.course(course), self.stray, self.heading_rad)
    }

    fn front(&self, course: &Course, stray: Stray, heading_rad: f64) -> Pose {
        let (cos, sin) = self.carried.direction();
        let s_m = self.s_m + cos * stray.ahead_m - sin * stray.left_m;
        let lateral_m = self.lateral_m + sin * stray.ahead_m + cos * stray.left_m;
        let at = course.pose(s_m, lateral_m);
        let heading_rad = wrapped(at.heading_rad + heading_rad);
        Pose { heading_rad, ..at }.ahead(self.carried.lever_m)
    }

    /// Returns whether a lateral motion may be faster than the body, now or later.
    fn may_lag(&self, swing: &Swing, time_s: f64) -> bool {
        // The body may slow down before the lateral motion ends.
        let slowest_mps = self.ramp.speed_mps(time_s).min(self.ramp.to_mps);
        swing.over.is_some() || slowest_mps < swing.most_mps()
    }

    /// Advances between two instants at which no law begins or ends.
    fn move_on(&mut self, course: &Course, from_s: f64, to_s: f64) -> Driven {
        // Without a lag the whole interval has a closed form.
        let Some(mut swing) = self.swing.filter(|it| self.may_lag(it, from_s)) else {
            let way_m = self.ramp.way_m(from_s, to_s);
            let aside_m = self
                .swing
                .map_or(0.0, |it| it.way_m(to_s) - it.way_m(from_s));
            let is_slanted = self.swing.is_some_and(|it| it.is_slanted);
            return self.move_by(course, way_m, aside_m, is_slanted);
        };
        let mut driven = Driven::default();
        let at_s = |part: u32| from_s + (to_s - from_s) * f64::from(part) / f64::from(LAG_PARTS);
        for part in 0..LAG_PARTS {
            let (from_s, to_s) = (at_s(part), at_s(part + 1));
            let way_m = self.ramp.way_m(from_s, to_s);
            // A jump takes no time, so the body drives its whole way ahead.
            let is_slanted = swing.is_slanted && !swing.is_jump();
            let aside_m = swing.driven_m(way_m, from_s, to_s);
            driven.add(self.move_by(course, way_m, aside_m, is_slanted));
        }
        self.swing = Some(swing);
        driven
    }

    fn move_by(&mut self, course: &Course, way_m: f64, aside_m: f64, is_slanted: bool) -> Driven {
        let ahead_m = if is_slanted {
            forward_part(way_m, aside_m)
        } else {
            way_m
        };
        let (cos, sin) = self.carried.direction();
        // Beside a bend the same distance covers a different length of course.
        let middle_m = self.lateral_m + 0.5 * (aside_m + sin * ahead_m);
        let shorter = 1.0 - course.curvature_per_m(self.s_m) * middle_m;
        self.s_m += cos * ahead_m / shorter;
        self.lateral_m += sin * ahead_m + aside_m;
        Driven {
            way_m,
            aside_m,
            ahead_m,
        }
    }

    /// Adds an ado's action to the deviation, and returns its way ahead.
    fn stray_on(
        &mut self,
        deviation: Command,
        planned_mps: f64,
        sample_s: f64,
        driven: Driven,
    ) -> f64 {
        let left_mps = deviation.lateral_mps;
        let before_mps = self.stray.ahead_mps;
        // Agents never reverse.
        let ahead_mps = (before_mps + deviation.accel_mps2 * sample_s).max(-planned_mps);
        // Trapezoidal rule, exact for the even acceleration within a sample.
        // The earlier speed is limited too, since the plan may have slowed down
        // since.
        let ahead_m = 0.5 * (before_mps.max(-planned_mps) + ahead_mps) * sample_s;
        self.stray.ahead_mps = ahead_mps;
        self.stray.ahead_m += ahead_m;
        if self.carried.on_foot {
            self.stray.left_mps = left_mps;
            self.stray.left_m += left_mps * sample_s;
            return ahead_m;
        }
        let most_mps = MAX_SLIP * (planned_mps + ahead_mps);
        let mut left_mps = left_mps.clamp(-most_mps, most_mps);
        // Together with the plan it moves sideways no farther than it drives.
        let aside_m = self.carried.direction().0 * driven.aside_m;
        let most_m = (driven.way_m + ahead_m).max(0.0);
        if !driven.jumps() && most_m < (aside_m + left_mps * sample_s).abs() {
            let all_m = (aside_m + left_mps * sample_s).clamp(-most_m, most_m);
            left_mps = (all_m - aside_m) / sample_s;
            // A body that its plan slants has no more of its way ahead.
            let is_slanted = self.swing.is_some_and(|swing| swing.is_slanted);
            let whole_m = if is_slanted {
                forward_part(most_m, all_m)
            } else {
                most_m
            };
            self.stray.ahead_m += whole_m - driven.ahead_m - ahead_m;
        }
        self.stray.left_mps = left_mps;
        self.stray.left_m += left_mps * sample_s;
        ahead_m
    }

    fn arrive(&mut self, course: &Course, end: SampleEnd) -> Arrival {
        let SampleEnd {
            sample_s,
            speed_mps,
            sideways_mps,
            planned_m,
            driven_m,
        } = end;
        let (cos, sin) = self.carried.direction();
        let is_slanted = self.swing.is_some_and(|swing| swing.is_slanted);
        let ahead = |along_mps: f64| {
            if is_slanted {
                forward_part(along_mps, sideways_mps)
            } else {
                along_mps
            }
        };
        let along_mps = speed_mps + self.stray.ahead_mps;
        let ahead_mps = ahead(along_mps);
        let left_mps = self.stray.left_mps;
        let velocity_mps = Vector2::new(
            cos * ahead_mps - sin * left_mps,
            sin * ahead_mps + cos * left_mps + sideways_mps,
        );
        // At low speeds the direction of the velocity is mostly noise, and a
        // standing body must not turn.
        let moves = ahead_mps.max(sideways_mps.abs()) >= TURNING_MPS;
        if !self.carried.on_foot && moves {
            let towards_rad = libm::atan2(velocity_mps.y, velocity_mps.x);
            self.heading_rad = self.carried.turned(self.heading_rad, towards_rad, driven_m);
        }
        let planned_mps = ahead(speed_mps);
        if !self.carried.on_foot && planned_mps.max(sideways_mps.abs()) >= TURNING_MPS {
            let aside_mps = sin * planned_mps + sideways_mps;
            let towards_rad = libm::atan2(aside_mps, cos * planned_mps);
            self.planned_rad = self
                .carried
                .turned(self.planned_rad, towards_rad, planned_m);
        }
        if let Some(turned_rad) = self.turned_rad() {
            // On a curve the body has its heading, to which a deviation adds.
            let strays = !self.carried.on_foot && moves;
            let strayed_rad = if strays {
                libm::atan2(velocity_mps.y, velocity_mps.x)
            } else {
                0.0
            };
            self.planned_rad = turned_rad;
            self.heading_rad = wrapped(turned_rad + strayed_rad);
        }
        let before = self.last;
        let pose = self.pose(course);
        let turn_rad = wrapped(pose.heading_rad - before.pose.heading_rad);
        let yaw_rate_rad_per_s = turn_rad / sample_s;
        let own_mps = if self.carried.on_foot {
            rotation_by(self.heading_rad).inverse() * velocity_mps
        } else {
            // A body that faces backwards on a curve reverses.
            let faces_back = self.way.is_some() && libm::cos(self.heading_rad) < 0.0;
            let reverses = faces_back && cos > 0.0;
            let ahead_mps = if reverses { -along_mps } else { along_mps };
            Vector2::new(ahead_mps, yaw_rate_rad_per_s * self.carried.lever_m)
        };
        let arrival = Arrival {
            pose,
            speed_mps: own_mps.x,
            lateral_mps: own_mps.y,
            yaw_rate_rad_per_s,
            accel_mps2: 0.0,
        };
        self.last = Arrival {
            accel_mps2: (arrival.speed_mps - before.speed_mps) / sample_s,
            ..arrival
        };
        self.last
    }

    /// Records the initial pose, which precedes that of the first sample.
    pub(super) fn begun(&mut self, pose: Pose) {
        self.last.pose = pose;
    }
}

/// Motion at the end of a sample, and the distances driven during it.
#[derive(Clone, Copy, Debug)]
struct SampleEnd {
    sample_s: f64,
    /// Planned speeds along the path and across the road.
    speed_mps: f64,
    sideways_mps: f64,
    /// Distance of the plan, and the one with the ado's deviation.
    planned_m: f64,
    driven_m: f64,
}

/// Distance that a plan drives, and its parts across and along the road.
#[derive(Clone, Copy, Debug, Default)]
struct Driven {
    way_m: f64,
    aside_m: f64,
    ahead_m: f64,
}

impl Driven {
    fn add(&mut self, other: Driven) {
        self.way_m += other.way_m;
        self.aside_m += other.aside_m;
        self.ahead_m += other.ahead_m;
    }

    /// Returns whether the plan has displaced the body farther than it drove.
    fn jumps(&self) -> bool {
        self.way_m + SAME_M < self.aside_m.abs()
    }
}

impl PlanConstants {
    /// Returns the heading of a body that turns towards another on a way.
    ///
    /// Steered wheels turn a car on circles of about the length of its lever, so a
    /// slow body turns slowly and a standing one not at all.
    fn turned(&self, from_rad: f64, to_rad: f64, way_m: f64) -> f64 {
        let turn_rad = wrapped(to_rad - from_rad);
        // The rear follows the front, so the turn is at most the way over the
        // lever.
        let most_rad = way_m.abs() / self.lever_m;
        if turn_rad.abs() <= most_rad {
            to_rad
        } else {
            wrapped(from_rad + most_rad.copysign(turn_rad))
        }
    }

    /// Returns cosine and sine of the facing. Vehicles face along the road.
    fn direction(&self) -> (f64, f64) {
        if self.on_foot {
            let (sin, cos) = libm::sincos(self.facing_rad);
            (cos, sin)
        } else {
            (libm::cos(self.facing_rad).signum(), 0.0)
        }
    }
}
