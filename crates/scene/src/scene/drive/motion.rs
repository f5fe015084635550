//! A driving scene in motion: commands in, states out, sample by sample.

use std::sync::Arc;

use rand::RngExt;

use super::actions::Maneuver;
use super::layout::DriveLayout;
use super::light::LightDrive;
use super::line_of_sight::perceived;
use super::plan_execution::{Arrival, PlanRun};
use super::sensors::Sensing;
use super::spec::{Agent, Drive};
use super::start_sampling::Drawn;
use super::state::SceneState;
use super::steering::{CourseAhead, LaneKeeper};
use super::story_execution::StoryExecution;
use super::trained::TrainedAdo;
use super::turns::Turn;
use super::world::DriveWorld;
use super::{ego_percept, scene_geometry};
use crate::ego::{self, Actuator, Controller, Fault, FaultKind, Percept};
use crate::rl::Spaces;
use crate::road::{Direction, wrapped};
use crate::scene::{
    AfterContact, Axis, BodySample, Clock, ContactEvent, Frame, Scene, SceneGeometry, Start,
    StepOutcome,
};
use crate::seed::StartKey;
use crate::severity::{Impact, Party};
use crate::sim::{BodyCommand, BodyId, BodyState, Contact, Plant, Pose};
use crate::trace::Schema;

/// A driving scene in motion.
pub struct DriveScene {
    pub(super) layout: Arc<DriveLayout>,
    pub(super) state: SceneState,
    pub(super) controller: Box<dyn Controller>,
    /// Commands of an external ego so far. Other egos are deterministic and
    /// leave it empty.
    pub(super) commands: Vec<ego::Command>,
    pub(super) sensing: Sensing,
    /// Seed of the noise of the episode.
    pub(super) noise: u64,
    /// Placed ados that act now.
    pub(super) turn: Turn,
    /// Lag of each agent's acceleration.
    pub(super) actuators: Vec<Actuator>,
    pub(super) keepers: Vec<LaneKeeper>,
    pub(super) chosen: Vec<Maneuver>,
    /// Last command of each body, `None` before the first.
    pub(super) commanded: Vec<Option<BodyCommand>>,
    /// Plan of each agent, in motion. Empty if no agent has a plan.
    pub(super) plans: Vec<Option<PlanRun>>,
    /// Reason for which a plan cannot begin. Loading finds it for tried starts.
    unmet: Option<String>,
    /// State of each planned agent at the end of the sample.
    pub(super) arrivals: Vec<Arrival>,
    /// State of the storyboard, if the world has one.
    pub(super) story: Option<Box<StoryExecution>>,
    /// Signals that plans read, kept to save the allocation.
    pub(super) row: Vec<f64>,
    pub(super) percept: Percept,
}

impl DriveWorld {
    /// Returns a scene at rest. Call `reset` before use.
    pub fn scene(&self) -> DriveScene {
        DriveScene::new(Arc::clone(&self.0))
    }
}

impl DriveScene {
    pub(super) fn new(layout: Arc<DriveLayout>) -> DriveScene {
        let spec = &layout.spec;
        let agents = spec.agents.len();
        let mut controller = spec.ego.controller.build();
        controller.brief(&layout.briefing());
        DriveScene {
            state: SceneState::new(Arc::clone(spec), Arc::clone(&layout.network)),
            controller,
            commands: Vec::new(),
            sensing: Sensing::new(spec.sensors, spec.clock.sample_s),
            noise: 0,
            turn: Turn::All,
            actuators: Vec::with_capacity(agents),
            keepers: Vec::with_capacity(agents),
            chosen: vec![Maneuver::NONE; agents],
            commanded: vec![None; agents],
            plans: Vec::new(),
            unmet: None,
            arrivals: Vec::new(),
            story: None,
            row: Vec::new(),
            percept: Percept::default(),
            layout,
        }
    }

    /// Spawns an agent at a pose. It keeps `lateral_m` of its road.
    pub(super) fn spawn_at(&mut self, agent: &Agent, pose: Pose, lateral_m: f64, speed_mps: f64) {
        self.state.spawn(&agent.body, pose, speed_mps);
        let (actuator, keeper) = self.layout.drivetrain_of(agent, lateral_m);
        self.actuators.push(actuator);
        self.keepers.push(keeper);
    }

    /// Removes every agent and restarts time at 0.
    pub(super) fn clear(&mut self) {
        self.state.clear();
        self.actuators.clear();
        self.keepers.clear();
        self.chosen.fill(Maneuver::NONE);
        self.commanded.fill(None);
    }

    /// Advances the physics by one sample under the current commands.
    pub(super) fn move_on(&mut self) -> StepOutcome {
        self.state.advance();
        if !self.state.plant.sound() {
            return StepOutcome::Fault(Fault::new(
                FaultKind::Physics,
                format!("the physics broke down at {:.3} s", self.state.time_s()),
            ));
        }
        match &self.state.touch {
            Some(contact) => StepOutcome::Contact(self.touch_of(contact)),
            None => StepOutcome::Going,
        }
    }

    /// Lays the road and lets the trained ados decide, before all commands of a sample.
    fn prepare(&mut self) -> Result<(), Fault> {
        // An episode with an infeasible plan is invalid and must not count as a
        // success.
        if let Some(why) = &self.unmet {
            return Err(Fault::new(FaultKind::Physics, why.clone()));
        }
        // Laid before the commands, so that the ego perceives the new piece.
        let laid = self.lay_road();
        laid.map_err(|error| Fault::new(FaultKind::Physics, error.what))?;
        self.decide_trained();
        Ok(())
    }

    /// Advances the physics by one sample, and the planned agents with it.
    fn move_with_plans(&mut self) -> StepOutcome {
        let flow = self.move_on();
        match (&flow, &self.state.touch) {
            (StepOutcome::Going, _) => self.arrive_all(),
            (StepOutcome::Contact(_), Some(contact)) => self.stop_all(contact.after_s),
            // A fault ends the episode, and the plans with it.
            _ => {}
        }
        flow
    }

    /// Writes the current row of signals.
    pub(super) fn publish_into(&self, row: &mut [f64]) {
        for (value, source) in row.iter_mut().zip(&self.layout.sources) {
            *value = source.value(&self.state);
        }
        let published = self.layout.sources.len();
        // In order, because a derived signal may read earlier ones.
        for (i, expr) in self.layout.derived.iter().enumerate() {
            row[published + i] = expr.eval(row);
        }
    }

    /// Returns the poses of all agents on a plant with this scene's bodies.
    pub(super) fn frame_of(&self, plant: &dyn Plant) -> Frame {
        let state = &self.state;
        let placements = state.bodies.iter();
        Frame {
            placements: placements.map(|&body| plant.placement(body)).collect(),
            phases: state.lights.iter().map(|shown| shown.phase).collect(),
            seen: perceived(state, self.layout.ego),
        }
    }

    fn touch_of(&self, contact: &Contact) -> ContactEvent {
        let name = |body: BodyId| self.layout.spec.agents[body.0].name.clone();
        ContactEvent {
            between: (name(contact.pair.0), name(contact.pair.1)),
            time_s: self.contact_s(contact),
            closing_speed_mps: contact.closing_speed_mps,
            point_m: contact.point_m,
            impact: self.impact_of(contact),
        }
    }

    /// Returns the time of a contact of the last sample.
    pub(super) fn contact_s(&self, contact: &Contact) -> f64 {
        // The state's time is already that of the sample's end.
        self.state.time_s() - self.layout.spec.clock.sample_s + contact.after_s
    }

    /// Returns the effect of a contact on the ego, or `None` if it is not involved.
    fn impact_of(&self, contact: &Contact) -> Option<Impact> {
        let ego = self.layout.ego;
        let (BodyId(first), BodyId(second)) = contact.pair;
        let [x, y] = contact.normal;
        let (other, normal) = match (first == ego, second == ego) {
            (true, _) => (second, [x, y]),
            // The normal must point from the ego to the other body.
            (false, true) => (first, [-x, -y]),
            (false, false) => return None,
        };
        let party = |agent: usize| Party {
            body: &self.layout.spec.agents[agent].body,
            state: self.state.states[agent],
        };
        let closing_mps = contact.closing_speed_mps;
        Some(Impact::of(party(ego), party(other), normal, closing_mps))
    }
}

impl DriveLayout {
    /// Draws the start of a key.
    pub fn draw(&self, key: StartKey) -> Start {
        let mut rng = key.generator(&self.spec.world, "start");
        let points = &self.spec.points;
        if !points.is_empty() {
            // The clamp covers a product that rounds up to the length of the
            // list.
            let number = (rng.random::<f64>() * points.len() as f64) as usize;
            return points[number.min(points.len() - 1)].clone();
        }
        let spec = &self.spec;
        let axes = self.axes.iter();
        // The environment has the last axes and is drawn last, so that it changes
        // no other value.
        let others = self.axes.len() - spec.environment.len();
        let mut values: Vec<f64> = axes
            .take(others)
            .map(|axis| axis.lo + (axis.hi - axis.lo) * rng.random::<f64>())
            .collect();
        let environment = spec.environment.iter();
        values.extend(environment.map(|it| it.at(rng.random::<f64>(), spec.clock.sample_s)));
        Start(values)
    }

    /// Returns the initial pose of an agent at a place (s, lateral) of its road.
    pub fn start_pose(&self, agent: &Agent, place: (f64, f64)) -> Pose {
        let ahead = CourseAhead {
            course: &self.network.courses()[agent.road],
            direction: agent.direction,
        };
        let (s_m, lateral_m) = place;
        let pose = agent.lane_keeping.begun(&agent.body, ahead, s_m, lateral_m);
        let heading_rad = pose.heading_rad + agent.facing_rad;
        Pose {
            heading_rad: if agent.is_with_road() {
                heading_rad
            } else {
                wrapped(heading_rad)
            },
            ..pose
        }
    }

    /// Returns the actuator and the lane keeper of an agent that keeps `lateral_m`.
    pub fn drivetrain_of(&self, agent: &Agent, lateral_m: f64) -> (Actuator, LaneKeeper) {
        let (lag_s, lateral_lag_s) = match &agent.drive {
            Drive::Ego => (self.spec.ego.lag_s, self.spec.ego.lag_s),
            Drive::Ado { actions, lag_s, .. } => (*lag_s, actions.lateral_lag_s()),
            Drive::Trained(TrainedAdo { actions, lag_s, .. }) => (*lag_s, actions.lateral_lag_s()),
            // Background traffic has no actuators, and plans prescribe motion.
            Drive::Scripted(_) | Drive::Planned(_) => (0.0, 0.0),
        };
        let sample_s = self.spec.clock.sample_s;
        // Keepers work in the driving direction, in which left and right swap.
        let kept_m = match agent.direction {
            Direction::With => lateral_m,
            Direction::Against => -lateral_m,
        };
        let keeps = agent.lane_keeping;
        (
            Actuator::new(lag_s, sample_s),
            LaneKeeper::new(&agent.body, keeps, kept_m, lateral_lag_s, sample_s),
        )
    }
}

impl Scene for DriveScene {
    fn schema(&self) -> &Arc<Schema> {
        &self.layout.schema
    }

    fn spaces(&self) -> &Spaces {
        &self.layout.spaces
    }

    fn clock(&self) -> &Clock {
        &self.layout.spec.clock
    }

    fn axes(&self) -> &[Axis] {
        &self.layout.axes
    }

    fn draw(&self, key: StartKey) -> Start {
        self.layout.draw(key)
    }

    fn reset(&mut self, start: &Start, noise: u64) {
        // Before the bodies spawn, because the start may draw their road.
        let laid = self.set_environment(start);
        let layout = Arc::clone(&self.layout);
        self.clear();
        let drawn = layout.spec.drawn(start);
        let has_plans = drawn.iter().any(|at| at.plan.is_some());
        self.plans.clear();
        self.unmet = laid.err().map(|error| error.what);
        for (i, (agent, at)) in layout.spec.agents.iter().zip(&drawn).enumerate() {
            let Drawn {
                front_m,
                lateral_m,
                speed_mps,
                ..
            } = *at;
            // `reset` cannot fail, so the reason is kept and `advance` reports
            // it as a fault.
            let begun = layout.begun(i, &drawn).unwrap_or_else(|(why, _)| {
                self.unmet = Some(format!("`{}`: {why}", agent.name));
                None
            });
            match &begun {
                Some((run, pose)) => self.spawn_at(agent, *pose, lateral_m, run.speed_mps()),
                None => {
                    let pose = layout.start_pose(agent, (front_m, lateral_m));
                    self.spawn_at(agent, pose, lateral_m, speed_mps);
                }
            }
            if has_plans {
                self.plans.push(begun.map(|(run, _)| run));
            }
        }
        self.arrivals.clear();
        self.arrivals.resize(self.plans.len(), Arrival::default());
        // Before the storyboard, whose numbers may be parameters.
        self.state.parameters.clear();
        self.state
            .parameters
            .extend(layout.spec.parameters_of(start));
        let story = layout.spec.story.as_ref();
        let resolved = story.map(|board| board.at_values(&self.state.parameters));
        self.story = resolved.and_then(|board| match board {
            Ok(board) => Some(Box::new(StoryExecution::new(board, &layout))),
            Err(why) => {
                self.unmet = Some(format!("storyboard: {why}"));
                None
            }
        });
        self.plans_begin();
        self.state.read();
        self.percept = ego_percept::blank(&layout.spec, layout.ego);
        self.sensing.reset(noise);
        self.noise = noise;
        self.turn = Turn::All;
        self.commands.clear();
        self.controller.reset(noise);
    }

    fn decide(&mut self, mut action: usize) {
        let layout = Arc::clone(&self.layout);
        // Decodes the joint action in the mixed radix of `Layout::new`, lowest
        // digit first: road users in file order, then lights, then the weather, then the
        // road, then turns.
        for (i, agent) in layout.spec.agents.iter().enumerate() {
            if let Drive::Ado { actions, .. } = &agent.drive {
                let own = action % actions.len();
                self.chosen[i] = actions.choice(own);
                self.state.note_action(i, own);
                action /= actions.len();
            }
        }
        for (i, light) in layout.spec.lights.iter().enumerate() {
            if let LightDrive::Ado { actions, .. } = &light.drive {
                if let Maneuver::Turn(turn) = actions.choice(action % actions.len()) {
                    self.state.turn(i, turn);
                }
                action /= actions.len();
            }
        }
        if let Some(weather) = &layout.spec.weather
            && let Maneuver::Change(rates) = weather.actions.choice(action % weather.actions.len())
        {
            self.state.change_weather(rates);
        }
        if let Some(weather) = &layout.spec.weather {
            action /= weather.actions.len();
        }
        if let Some(road) = &layout.spec.road_ado
            && let Maneuver::Bend { curvature_per_m } =
                road.actions.choice(action % road.actions.len())
        {
            self.state.next_curvature_per_m = curvature_per_m;
        }
        if let Some(road) = &layout.spec.road_ado {
            action /= road.actions.len();
        }
        if let Some(turn) = layout.turns.get(action) {
            self.turn = *turn;
        }
    }

    fn advance(&mut self) -> StepOutcome {
        let commanded = self.prepare().and_then(|()| self.command_all());
        match commanded {
            Ok(()) => self.move_with_plans(),
            Err(fault) => StepOutcome::Fault(fault),
        }
    }

    fn advance_given(&mut self, given: &[Option<BodyState>]) -> Option<StepOutcome> {
        if let Err(fault) = self.prepare() {
            return Some(StepOutcome::Fault(fault));
        }
        self.command_around(given);
        let flow = self.move_with_plans();
        // The plant knows only the mean velocity of a carried body over the sample.
        for (state, given) in self.state.states.iter_mut().zip(given) {
            // The pose stays, since a contact stops a body before the given one.
            if let Some(given) = given {
                let pose = state.pose;
                *state = BodyState { pose, ..*given };
            }
        }
        Some(flow)
    }

    fn publish(&self, row: &mut [f64]) {
        self.publish_into(row);
    }

    fn observe(&self, row: &[f64], obs: &mut [f32]) {
        self.layout.observed.read(|position| row[position], obs);
    }

    fn stage(&self) -> SceneGeometry {
        scene_geometry::stage(&self.layout)
    }

    fn frame(&self) -> Frame {
        self.frame_of(&*self.state.plant)
    }

    fn rapier_steps(&self) -> u64 {
        self.state.plant.rapier_steps()
    }

    fn after_contact(&self, default_s: f64) -> Option<(AfterContact, Vec<Frame>)> {
        self.collide_on(default_s)
    }

    fn bodies(&self, into: &mut Vec<BodySample>) {
        let samples = self.state.states.iter().zip(&self.commanded);
        into.extend(samples.map(|(&state, &command)| BodySample { state, command }));
    }

    fn driven(&self) -> Option<DriveWorld> {
        Some(DriveWorld(Arc::clone(&self.layout)))
    }

    fn finish(&mut self) {
        self.controller.finish();
    }

    fn commands(&self) -> &[ego::Command] {
        &self.commands
    }

    fn fork(&self) -> Option<Box<dyn Scene>> {
        Some(Box::new(DriveScene {
            layout: Arc::clone(&self.layout),
            state: self.state.fork(),
            controller: self.controller.fork()?,
            commands: self.commands.clone(),
            sensing: self.sensing.clone(),
            noise: self.noise,
            turn: self.turn,
            actuators: self.actuators.clone(),
            keepers: self.keepers.clone(),
            chosen: self.chosen.clone(),
            commanded: self.commanded.clone(),
            plans: self.plans.clone(),
            unmet: self.unmet.clone(),
            arrivals: self.arrivals.clone(),
            story: self.story.clone(),
            // Scratch space: it is filled before every use.
            row: Vec::new(),
            percept: self.percept.clone(),
        }))
    }
}
