//! A storyboard in the scene: its state, and the past sample as it sees it.
//!
//! The interpreter runs over a sample when its end is known. An action then begins at
//! its own instant: the plan of its actor is driven again from the beginning of the
//! sample. The body follows in the next sample, as for the formulas of scripts.

mod across;
mod along;
mod formulas;

use std::cell::RefCell;
use std::sync::Arc;

use super::actions::Maneuver;
use super::layout::DriveLayout;
use super::motion_profile::next_step_s;
use super::plan_execution::{Arrival, PlanRun, SampleSpan};
use super::spec::Drive;
use super::state::SceneState;
use super::story_law::{DueLaw, LateralBase, LateralTiming, StoryLaw};
use crate::ego::{Command, Phase};
use crate::road::{Course, OnRoad, Road};
use crate::sim::{Body, BodyState, Pose, PosedBody, body_gap_m};
use crate::story::check::CheckedStoryboard;
use crate::story::robustness::SampledRobustness;
use crate::story::run::{ElementChange, StoryRun};
use crate::story::values::SignalState;
use crate::story::view::{
    ActorAction, ActorLane, AgentMotion, AgentSize, MotionDomain, PosedAgent, RoadLimits,
    SceneChange, StoryStage, StoryView,
};
use formulas::StoryFormulas;

/// State of a storyboard, with the sample over which it runs next.
#[derive(Clone, Debug)]
pub(super) struct StoryExecution {
    /// Storyboard with the numbers of the start.
    board: Arc<CheckedStoryboard>,
    run: StoryRun,
    formulas: StoryFormulas,
    /// Changes of its elements so far, in the order of time.
    changes: Vec<ElementChange>,
    past: PastSample,
}

/// Beginning of a sample that is not interpreted yet.
#[derive(Clone, Debug, Default)]
struct PastSample {
    from_s: f64,
    motions: Vec<AgentMotion>,
    /// Plans before the sample, with the laws that begin in it.
    plans: Vec<Option<PlanRun>>,
    phases: Vec<Phase>,
    /// What each ado does in the sample.
    chosen: Vec<Maneuver>,
}

/// Scene between two samples, in which actions begin.
struct SampleStage<'a> {
    layout: &'a DriveLayout,
    state: &'a SceneState,
    /// Plans at the end of the sample.
    plans: &'a mut [Option<PlanRun>],
    past: &'a mut PastSample,
    formulas: &'a mut StoryFormulas,
    board: &'a CheckedStoryboard,
    /// Motion of the agents whose plans depend on others, once it is known.
    traces: RefCell<Vec<AgentTrace>>,
    /// Instants of the sample and motions, of each agent, until a law begins.
    ///
    /// Conditions ask for the same motions, and each costs a plan that is driven.
    known: RefCell<Vec<Vec<(f64, AgentMotion)>>>,
    /// Changes that are not those of agents.
    applied: Vec<SceneChange>,
    to_s: f64,
}

/// Motion of an agent whose plan depends on others, over a sample.
#[derive(Clone, Debug)]
enum AgentTrace {
    Unknown,
    /// It is being computed. Agents that wait for each other keep their acceleration.
    Open,
    /// Instants and motions.
    Known(Vec<(f64, AgentMotion)>),
}

impl StoryExecution {
    /// Begins a storyboard that has the numbers of the start.
    pub(super) fn new(board: Arc<CheckedStoryboard>, layout: &DriveLayout) -> StoryExecution {
        StoryExecution {
            run: StoryRun::new(&board),
            formulas: StoryFormulas::new(&layout.story_formulas),
            board,
            changes: Vec::new(),
            past: PastSample::default(),
        }
    }

    /// Returns the changes of the elements so far, in the order of time.
    pub(super) fn changes(&self) -> &[ElementChange] {
        &self.changes
    }

    /// Rates the formulas of its conditions at the current sample, before it runs.
    pub(super) fn rate(&mut self, row: &[f64], at_s: f64) {
        self.formulas.rate(row, at_s);
    }

    /// Runs up to the current sample, and changes the plans whose laws begin in it.
    ///
    /// `chosen` is what each ado does from now on. Returns the changes of road and lights.
    pub(super) fn run(
        &mut self,
        layout: &DriveLayout,
        state: &SceneState,
        plans: &mut [Option<PlanRun>],
        chosen: &[Maneuver],
    ) -> Vec<SceneChange> {
        // Before the first sample the past is the present, so that laws begin
        // at once.
        if self.past.motions.is_empty() {
            self.past = PastSample::of(state, plans, chosen);
        }
        let to_s = state.time_s();
        let mut stage = SampleStage {
            layout,
            state,
            plans: &mut *plans,
            past: &mut self.past,
            formulas: &mut self.formulas,
            board: &self.board,
            traces: RefCell::default(),
            known: RefCell::default(),
            applied: Vec::new(),
            to_s,
        };
        // Plans assumed how others move in this sample, which is known by now.
        stage.drive_dependent_again();
        let changes = &mut self.changes;
        self.run.step(&self.board, &mut stage, to_s, changes);
        let applied = stage.applied;
        self.past = PastSample::of(state, plans, chosen);
        applied
    }
}

impl PastSample {
    /// Returns the beginning of a sample at the present state.
    fn of(state: &SceneState, plans: &[Option<PlanRun>], chosen: &[Maneuver]) -> PastSample {
        let mut plans = plans.to_vec();
        for plan in plans.iter_mut().flatten() {
            // Its body makes the jump in the sample to come.
            plan.take_jump();
        }
        PastSample {
            from_s: state.time_s(),
            motions: state.states.iter().map(motion_of).collect(),
            plans,
            phases: state.lights.iter().map(|light| light.phase).collect(),
            chosen: chosen.to_vec(),
        }
    }
}

/// Returns the motion of a body at a sample.
pub(super) fn motion_of(state: &BodyState) -> AgentMotion {
    AgentMotion {
        pose: state.pose,
        speed_mps: state.speed_mps,
        lateral_mps: state.lateral_mps,
        accel_mps2: state.accel_mps2,
    }
}

/// Returns what an ado adds to its plan, which is nothing for planned traffic.
pub(super) fn deviation_of(drive: &Drive, chosen: Maneuver) -> Command {
    match (drive, chosen) {
        (
            Drive::Ado { .. },
            Maneuver::Drive {
                accel_mps2,
                lateral_mps,
            },
        ) => Command {
            accel_mps2,
            lateral_mps,
        },
        _ => Command::accelerate(0.0),
    }
}

/// Returns a motion between known ones.
fn traced(motions: &[(f64, AgentMotion)], at_s: f64) -> AgentMotion {
    let after = motions.partition_point(|it| it.0 <= at_s);
    match (
        after.checked_sub(1).map(|it| &motions[it]),
        motions.get(after),
    ) {
        // Instants of a trace strictly increase, so no share is 0/0.
        (Some((from_s, from)), Some((to_s, to))) => {
            from.towards(to, to_s - from_s, (at_s - from_s) / (to_s - from_s))
        }
        (Some((_, only)), None) | (None, Some((_, only))) => *only,
        (None, None) => AgentMotion::default(),
    }
}

impl SampleStage<'_> {
    fn body(&self, agent: usize) -> &Body {
        &self.layout.spec.agents[agent].body
    }

    /// Returns the plan of an agent at an instant of the sample, and its motion.
    fn planned(&self, agent: usize, at_s: f64) -> Option<(PlanRun, Arrival)> {
        let before = self.past.plans.get(agent)?.as_ref()?;
        let span = SampleSpan {
            course: self.state.network.course_of(agent),
            road: self.layout.spec.road_of(agent),
            network: &self.state.network,
            spec: &self.layout.spec,
            motion_of: &|other: usize, at_s: f64| self.seen(other, at_s),
            from_s: self.past.from_s,
            to_s: at_s,
        };
        let drive = &self.layout.spec.agents[agent].drive;
        let deviation = deviation_of(drive, self.past.chosen[agent]);
        Some(before.at(span, deviation))
    }

    /// Lets a law begin at an instant of the sample.
    fn begin_law(&mut self, agent: usize, law: DueLaw) {
        if let Some(Some(before)) = self.past.plans.get_mut(agent) {
            before.add_law(law);
        }
        self.drive_again(agent);
        // Whoever keeps a distance to it does so to its new motion.
        self.drive_dependent_again();
    }

    fn drive_again(&mut self, agent: usize) {
        if let Some((run, _)) = self.planned(agent, self.to_s) {
            self.plans[agent] = Some(run);
        }
    }

    fn depends(&self, agent: usize) -> bool {
        let plan = self.past.plans.get(agent).and_then(Option::as_ref);
        plan.is_some_and(PlanRun::depends)
    }

    /// Drives all plans again that depend on the motion of others in the sample.
    fn drive_dependent_again(&mut self) {
        let agents = self.past.plans.len();
        // Motions found before the law began are wrong from now on.
        self.traces = RefCell::new(vec![AgentTrace::Unknown; agents]);
        self.known = RefCell::new(vec![Vec::new(); self.past.motions.len()]);
        for agent in 0..agents {
            if self.depends(agent) {
                self.drive_again(agent);
            }
        }
    }

    /// Returns the motion of an agent as plans see it that depend on it.
    fn seen(&self, agent: usize, at_s: f64) -> AgentMotion {
        if !self.depends(agent) {
            return self.motion(agent, at_s);
        }
        match &self.traces.borrow()[agent] {
            AgentTrace::Known(motions) => return traced(motions, at_s),
            AgentTrace::Open => return self.past.motions[agent].ahead(at_s - self.past.from_s),
            AgentTrace::Unknown => {}
        }
        // Marked first, because agents may wait for each other in a circle.
        self.traces.borrow_mut()[agent] = AgentTrace::Open;
        let motions = self.trace(agent);
        let motion = traced(&motions, at_s);
        self.traces.borrow_mut()[agent] = AgentTrace::Known(motions);
        motion
    }

    /// Returns whether an agent's motion is final until a law begins.
    ///
    /// While a trace is computed, those that wait for it only assume it.
    fn is_final(&self, agent: usize) -> bool {
        let is_open = |it: &AgentTrace| matches!(it, AgentTrace::Open);
        !self.depends(agent) || !self.traces.borrow().iter().any(is_open)
    }

    /// Returns the motion of an agent that has not been asked for.
    fn motion_anew(&self, agent: usize, at_s: f64) -> AgentMotion {
        if let Some((run, arrival)) = self.planned(agent, at_s) {
            return AgentMotion {
                pose: arrival.pose,
                speed_mps: arrival.speed_mps,
                lateral_mps: arrival.lateral_mps,
                accel_mps2: run.accel_mps2(at_s),
            };
        }
        let from = &self.past.motions[agent];
        let lasts_s = self.to_s - self.past.from_s;
        // At the start the sample has no duration.
        let share = if lasts_s > 0.0 {
            (at_s - self.past.from_s) / lasts_s
        } else {
            1.0
        };
        from.towards(&motion_of(&self.state.states[agent]), lasts_s, share)
    }

    /// Returns the motion of an agent at instants that no sample time changes.
    fn trace(&self, agent: usize) -> Vec<(f64, AgentMotion)> {
        let mut instants_s = vec![self.past.from_s];
        let mut at_s = self.past.from_s;
        while at_s < self.to_s {
            at_s = next_step_s(at_s).min(self.to_s);
            instants_s.push(at_s);
        }
        let motions = instants_s.into_iter();
        motions
            .map(|at_s| (at_s, self.motion(agent, at_s)))
            .collect()
    }

    /// Returns the road on which an agent is: that of its route, or its own.
    fn road_of(&self, agent: usize) -> (&Course, &Road) {
        let run = self.plans.get(agent).and_then(Option::as_ref);
        let routed = run.and_then(PlanRun::routed);
        routed.unwrap_or_else(|| {
            let course = self.state.network.course_of(agent);
            (course, self.layout.spec.road_of(agent))
        })
    }

    fn lane_of(&self, agent: usize, at_s: f64) -> usize {
        let (course, road) = self.road_of(agent);
        road.lane_at(course.locate(&self.reference(agent, at_s)).lateral_m)
    }

    /// Returns the law of an action, or `None` for one that moves nothing.
    fn law_of(&self, agent: usize, action: &ActorAction, at_s: f64) -> Option<StoryLaw> {
        let law = match *action {
            ActorAction::LaneChange {
                target,
                offset_m,
                dynamics,
            } => {
                let (from, line_m) = match target {
                    ActorLane::Absolute(lane) => (LateralBase::Lane(lane), 0.0),
                    ActorLane::Relative(of, by) => {
                        let by = isize::try_from(by).unwrap_or(0);
                        // Nothing lies to the right of lane 0.
                        let lane = self.lane_of(of, at_s).saturating_add_signed(by);
                        (LateralBase::Lane(lane), 0.0)
                    }
                    ActorLane::Line(lateral_m) => (LateralBase::Course, lateral_m),
                };
                StoryLaw::Lateral {
                    from,
                    offset_m: line_m + offset_m,
                    shape: dynamics.shape.curve(),
                    timing: LateralTiming::Size(dynamics.dimension),
                }
            }
            _ => {
                let along = self.law_along(agent, action, at_s);
                return along.or_else(|| self.law_across(agent, action, at_s));
            }
        };
        Some(law)
    }
}

impl StoryView for SampleStage<'_> {
    fn motion(&self, agent: usize, at_s: f64) -> AgentMotion {
        if !self.is_final(agent) {
            return self.motion_anew(agent, at_s);
        }
        let known = self.known.borrow()[agent]
            .iter()
            // Backwards, as the latest instants are asked for again.
            .rev()
            .find(|it| it.0 == at_s)
            .map(|it| it.1);
        known.unwrap_or_else(|| {
            let motion = self.motion_anew(agent, at_s);
            self.known.borrow_mut()[agent].push((at_s, motion));
            motion
        })
    }

    fn on_road(&self, viewer: usize, pose: &Pose) -> OnRoad {
        self.road_of(viewer).0.locate(pose)
    }

    fn pose_on_road(&self, viewer: usize, road: Option<usize>, s_m: f64, lateral_m: f64) -> Pose {
        let courses = self.state.network.courses();
        let course = road.map_or(self.road_of(viewer).0, |road| &courses[road]);
        course.pose(s_m, lateral_m)
    }

    fn lane_middle_m(&self, viewer: usize, lateral_m: f64, lanes: i32) -> f64 {
        let road = self.road_of(viewer).1;
        let by = isize::try_from(lanes).unwrap_or(0);
        let lane = road.lane_at(lateral_m).saturating_add_signed(by);
        road.lane_middle_m(lane.min(road.lanes().saturating_sub(1)))
    }

    fn road_limits(&self, agent: usize) -> RoadLimits {
        let (course, road) = self.road_of(agent);
        let mut borders = road.borders_m();
        let first_m = borders.next().unwrap_or(f64::NEG_INFINITY);
        RoadLimits {
            right_m: first_m,
            left_m: borders.last().unwrap_or(first_m),
            from_s_m: f64::NEG_INFINITY,
            // A road without pieces has no end. Others go straight on beyond their last
            // piece, which no lane does in the file that they come from.
            to_s_m: if course.piece_count() == 0 {
                f64::INFINITY
            } else {
                course.end_s_m()
            },
        }
    }

    fn size(&self, agent: usize) -> AgentSize {
        let body = self.body(agent);
        AgentSize {
            length_m: body.length_m,
            width_m: body.width_m,
            front_m: body.front_m(),
        }
    }

    fn gap_m(&self, bodies: [PosedAgent; 2]) -> f64 {
        let [a, b] = bodies.map(|PosedAgent { agent, pose }| PosedBody {
            body: self.body(agent),
            pose,
        });
        body_gap_m(a, b)
    }

    fn signal(&self, light: usize, at_s: f64) -> SignalState {
        // Lights change at samples.
        let phase = if at_s < self.to_s {
            self.past.phases[light]
        } else {
            self.state.lights[light].phase
        };
        match phase {
            Phase::Green => SignalState::Green,
            Phase::Yellow => SignalState::Yellow,
            Phase::Red => SignalState::Red,
        }
    }

    fn parameter(&self, number: usize) -> f64 {
        self.state.parameters[number]
    }

    fn robustness(&self, formula: usize) -> SampledRobustness {
        self.formulas.robustness(formula)
    }
}

impl StoryStage for SampleStage<'_> {
    fn begin(&mut self, agent: usize, action: &ActorAction, at_s: f64) {
        if let Some(law) = self.law_of(agent, action, at_s) {
            self.begin_law(agent, DueLaw { at_s, law });
        }
    }

    fn change(&mut self, change: SceneChange, at_s: f64) {
        match self.law_of_change(change, at_s) {
            Some((agent, law)) => self.begin_law(agent, DueLaw { at_s, law }),
            None => self.applied.push(change),
        }
    }

    fn ends_s(&self, agent: usize, domain: MotionDomain) -> f64 {
        let Some(run) = &self.plans[agent] else {
            // Bodies without a plan move by other laws, whose end no story knows.
            return f64::INFINITY;
        };
        match domain {
            MotionDomain::Longitudinal => run.ramp_ends_s(),
            MotionDomain::Lateral => run.swing_ends_s(),
        }
    }

    fn stop(&mut self, agent: usize, domain: MotionDomain, at_s: f64) {
        let law = match domain {
            MotionDomain::Longitudinal => StoryLaw::KeepSpeed,
            MotionDomain::Lateral => StoryLaw::KeepPlace,
        };
        self.begin_law(agent, DueLaw { at_s, law });
    }

    fn watch(&mut self, formula: usize, at_s: f64) {
        let monitor = &self.layout.story_formulas[formula];
        self.formulas.restart(formula, monitor, at_s);
    }
}
