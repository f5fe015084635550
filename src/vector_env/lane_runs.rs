//! Environments as a structure of arrays: a column per quantity, an entry per run.

use rand::Rng;

use std::sync::Arc;

use super::StepInto;
use super::eligible::LaneWorld;
use super::run::Run;
use crate::ego::{Actuator, Controller, Percept};
use crate::rulebook::{RunsJudge, Stop, Verdict};
use crate::scene::drive::{
    Drive, LaneKeeper, Maneuver, SceneState, Sensing, blank_percept, fill_percept,
};
use crate::seed::StartKey;
use crate::sim::kinematic::KinematicLanes;
use crate::stl::RunColumns;

/// Runs of one world side by side.
///
/// The order of a sample is that of a test bench: percept and commands, physics,
/// signals, rules, verdict. Rules and expressions are evaluated for all runs at once.
pub(super) struct LaneRuns {
    world: LaneWorld,
    runs: Vec<Run>,
    plant: KinematicLanes,
    vehicles: Vec<Drivetrains>,
    controllers: Vec<Box<dyn Controller>>,
    /// Sensors of each run, empty if they neither delay nor disturb.
    sensing: Vec<Sensing>,
    /// Number of the newest sample of each run.
    samples: Vec<usize>,
    judge: RunsJudge,
    /// Newest row of each run: a column per signal.
    columns: Vec<Vec<f64>>,
    /// 0 for each run whose newest row has finite numbers only.
    checks: Vec<f64>,
    /// The run that moves at the moment, as signals, percepts and scripts read it.
    scene: SceneState,
    percept: Percept,
    /// Runs that move in this step, and why they stop.
    live: Vec<(usize, Option<Stop>)>,
}

/// Actuators, lane keepers and actions of one vehicle in every run.
struct Drivetrains {
    actuators: Vec<Actuator>,
    keepers: Vec<LaneKeeper>,
    chosen: Vec<Maneuver>,
}

/// Result of the motion of a run during a sample.
enum Moved {
    On(Option<Stop>),
    Fault,
}

impl LaneRuns {
    /// Creates runs that have not begun, `None` if the world does not fit.
    pub(super) fn new(world: &LaneWorld, runs: usize) -> Option<LaneRuns> {
        let layout = &world.layout;
        let spec = &layout.spec;
        let bodies = spec.agents.iter().map(|agent| &agent.body);
        let controller = || {
            let mut controller = spec.ego.controller.build();
            controller.brief(&layout.briefing());
            controller
        };
        let drivetrains = |agent| {
            let (actuator, keeper) = layout.drivetrain_of(agent, 0.0);
            Drivetrains {
                actuators: vec![actuator; runs],
                keepers: vec![keeper; runs],
                chosen: vec![Maneuver::NONE; runs],
            }
        };
        let sensors = spec.sensors;
        let disturb = sensors.is_noisy() || sensors.delay_s != 0.0;
        let sensing = Sensing::new(sensors, spec.clock.sample_s);
        Some(LaneRuns {
            runs: vec![Run::new(); runs],
            plant: KinematicLanes::new(bodies, world.ground, runs)?,
            vehicles: spec.agents.iter().map(drivetrains).collect(),
            controllers: (0..runs).map(|_| controller()).collect(),
            sensing: vec![sensing; if disturb { runs } else { 0 }],
            samples: vec![0; runs],
            judge: RunsJudge::new(&world.rulebook, world.samples, runs)?,
            columns: vec![vec![0.0; runs]; layout.schema.len()],
            checks: vec![0.0; runs],
            scene: SceneState::new(Arc::clone(spec), Arc::clone(&layout.network)),
            percept: blank_percept(spec, layout.ego),
            live: Vec::with_capacity(runs),
            world: world.clone(),
        })
    }

    pub(super) fn run(&self, at: usize) -> &Run {
        &self.runs[at]
    }

    pub(super) fn begin(&mut self, run: usize, key: StartKey, observation: &mut [f32]) {
        let layout = Arc::clone(&self.world.layout);
        let spec = &layout.spec;
        let noise = key.generator("", "noise").next_u64();
        let drawn = spec.drawn(&layout.draw(key));
        for (i, (agent, at)) in spec.agents.iter().zip(&drawn).enumerate() {
            let pose = layout.start_pose(agent, (at.front_m, at.lateral_m));
            let body = (i, &agent.body, self.world.ground);
            self.plant.spawn(body, run, pose, at.speed_mps);
            let vehicle = &mut self.vehicles[i];
            (vehicle.actuators[run], vehicle.keepers[run]) =
                layout.drivetrain_of(agent, at.lateral_m);
            vehicle.chosen[run] = Maneuver::NONE;
        }
        if let Some(sensing) = self.sensing.get_mut(run) {
            sensing.reset(noise);
        }
        self.controllers[run].reset(noise);
        self.runs[run].begin(key);
        self.samples[run] = 0;
        self.show(run);
        self.scene.touch = None;
        self.publish(run);
        self.derive();
        self.check();
        let verdict = if self.is_finite(run) {
            self.judge_first(run)
        } else {
            Some(Verdict::Invalid)
        };
        self.runs[run].verdict = verdict;
        self.observe(run, observation);
    }

    /// Judges the sample at 0 s of one run. The others have none.
    fn judge_first(&mut self, run: usize) -> Option<Verdict> {
        let row: Vec<f64> = self.columns.iter().map(|column| column[run]).collect();
        self.judge.begin(run, &row);
        self.judge.verdict(&self.world.rulebook, (run, 0), None)
    }

    pub(super) fn step(&mut self, actions: &[usize], mut into: StepInto<'_>) {
        let count = self.runs.len();
        self.live.clear();
        for (run, it) in self.runs.iter_mut().enumerate() {
            if it.is_over {
                continue;
            }
            it.actions.push(actions[run] as u32);
            if it.verdict.is_none() {
                self.live.push((run, None));
            }
        }
        for at in 0..self.live.len() {
            let run = self.live[at].0;
            self.decide(run, actions[run]);
        }
        for _ in 0..self.world.samples_per_decision {
            self.sample();
        }
        for run in 0..count {
            (into.rewards[run], into.ends[run]) = (0.0, None);
            if !self.runs[run].is_over {
                self.observe(run, into.row(run, count));
                let report = self.runs[run].report(&self.world.rulebook);
                (into.rewards[run], into.ends[run]) = report;
            }
        }
    }

    /// Sets the actions of a run's ados until the next decision.
    fn decide(&mut self, run: usize, mut action: usize) {
        // The mixed radix of `DriveScene::decide`, of which only road users are left.
        for (agent, vehicle) in self.world.layout.spec.agents.iter().zip(&mut self.vehicles) {
            if let Drive::Ado { actions, .. } = &agent.drive {
                vehicle.chosen[run] = actions.choice(action % actions.len());
                action /= actions.len();
            }
        }
    }

    /// Advances every live run by a sample and judges it.
    fn sample(&mut self) {
        if self.live.is_empty() {
            return;
        }
        let mut live = std::mem::take(&mut self.live);
        live.retain_mut(|(run, stop)| match self.advance(*run) {
            Moved::On(why) => {
                *stop = why;
                true
            }
            Moved::Fault => {
                self.runs[*run].verdict = Some(Verdict::Invalid);
                false
            }
        });
        self.derive();
        self.check();
        let moved = live.iter().map(|(run, _)| *run);
        self.judge
            .push(&self.samples, moved, RunColumns(&self.columns));
        live.retain(|&(run, stop)| {
            let at = (run, self.samples[run]);
            let verdict = if self.is_finite(run) {
                self.judge.verdict(&self.world.rulebook, at, stop)
            } else {
                Some(Verdict::Invalid)
            };
            if verdict.is_some_and(|verdict| verdict != Verdict::Invalid) {
                self.runs[run].robustness = self.judge.robustness(at);
            }
            self.runs[run].verdict = verdict;
            verdict.is_none()
        });
        self.live = live;
    }

    /// Moves one run by a sample and publishes its signals.
    fn advance(&mut self, run: usize) -> Moved {
        self.show(run);
        self.scene.touch = None;
        if self.command_all(run).is_none() {
            return Moved::Fault;
        }
        let touch = self
            .plant
            .advance(run, self.world.layout.spec.clock.sample_s);
        self.samples[run] += 1;
        if !self.plant.is_sound(run) {
            return Moved::Fault;
        }
        self.show(run);
        self.scene.touch = touch;
        self.publish(run);
        Moved::On(match touch {
            Some(_) => Some(Stop::Contact),
            None if self.samples[run] + 1 == self.world.samples => Some(Stop::Horizon),
            None => None,
        })
    }

    /// Makes a run the one that signals, percepts and scripts read.
    fn show(&mut self, run: usize) {
        let scene = &mut self.scene;
        scene.sample = self.samples[run];
        scene.states.clear();
        scene.on_road.clear();
        for vehicle in 0..self.vehicles.len() {
            let state = self.plant.state(vehicle, run);
            let at = self.world.layout.network.locate(vehicle, &state.pose);
            scene.states.push(state);
            scene.on_road.push(at);
        }
    }

    /// Commands all vehicles of a run, `None` if the ego's command is a fault.
    fn command_all(&mut self, run: usize) -> Option<()> {
        fill_percept(&mut self.percept, &self.scene, self.world.layout.ego);
        if let Some(sensing) = self.sensing.get_mut(run) {
            sensing.look(&mut self.percept, 1.0);
        }
        let command = self.controllers[run].control(&self.percept).ok()?;
        if command.flaw().is_some() {
            return None;
        }
        let ego = Maneuver::Drive {
            accel_mps2: command.accel_mps2,
            lateral_mps: command.lateral_mps,
        };
        for (i, vehicle) in self.vehicles.iter_mut().enumerate() {
            let wish = self.scene.wish_of(i, ego, vehicle.chosen[run]);
            // Invariant: no vehicle here walks or has a plan.
            if let Some(Maneuver::Drive {
                accel_mps2,
                lateral_mps,
            }) = wish
            {
                let drivetrain = (&mut vehicle.actuators[run], &mut vehicle.keepers[run]);
                let wish = (accel_mps2, lateral_mps);
                let (accel_mps2, curvature_per_m) = self.scene.driven(i, drivetrain, wish);
                self.plant.command(i, run, accel_mps2, curvature_per_m);
            }
        }
        Some(())
    }

    fn publish(&mut self, run: usize) {
        for (position, source) in &self.world.published {
            self.columns[*position][run] = source.value(&self.scene);
        }
    }

    /// Computes the derived signals of all runs.
    fn derive(&mut self) {
        let published = self.world.layout.sources.len();
        for (i, expr) in self.world.layout.derived.iter().enumerate() {
            // A derived signal reads only those before it.
            let (before, rest) = self.columns.split_at_mut(published + i);
            expr.eval_runs(RunColumns(before), &mut rest[0]);
        }
    }

    /// Finds out which rows have finite numbers only.
    fn check(&mut self) {
        self.checks.fill(0.0);
        for column in &self.columns {
            // A number times 0 is 0, unless it is not finite. Then the sum is NaN.
            let pairs = self.checks.iter_mut().zip(column);
            pairs.for_each(|(check, value)| *check += value * 0.0);
        }
    }

    fn is_finite(&self, run: usize) -> bool {
        self.checks[run] == 0.0
    }

    fn observe(&self, run: usize, observation: &mut [f32]) {
        let observed = &self.world.layout.observed;
        observed.read(|position| self.columns[position][run], observation);
    }

    /// Returns the memory of all runs, and of what they share, if it is known.
    pub(super) fn bytes(&self) -> Option<usize> {
        let judge = self.judge.bytes()?;
        let controllers = self.controllers.iter();
        let controllers = controllers.map(|it| size_of_val(&**it) + size_of_val(it));
        let vehicles = self.vehicles.iter().map(|it| {
            size_of_val(&*it.actuators) + size_of_val(&*it.keepers) + size_of_val(&*it.chosen)
        });
        let columns = self.columns.iter();
        let columns = columns.map(|it| size_of_val(it) + it.capacity() * size_of::<f64>());
        let scene = &self.scene;
        let shared = size_of::<LaneRuns>()
            + size_of_val(&*scene.states)
            + size_of_val(&*scene.on_road)
            + size_of_val(&*self.percept.others);
        let runs = self.runs.iter().map(Run::bytes).sum::<usize>()
            + self.plant.bytes()
            + vehicles.sum::<usize>()
            + self.vehicles.capacity() * size_of::<Drivetrains>()
            + controllers.sum::<usize>()
            + size_of_val(&*self.sensing)
            + size_of_val(&*self.samples)
            + size_of_val(&*self.checks)
            + columns.sum::<usize>()
            + self.live.capacity() * size_of::<(usize, Option<Stop>)>();
        Some(shared + runs + judge)
    }
}
