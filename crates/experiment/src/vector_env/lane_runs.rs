//! Environments as a structure of arrays: a column per quantity, an entry per run.
//!
//! A step loads each run from the columns, drives it to its next decision and judges
//! all of its new samples at once. Motion beyond a sample that decides the episode is
//! discarded with the episode.

use std::sync::Arc;

use rand::Rng;

use super::StepInto;
use super::eligible::LaneWorld;
use super::run::EnvRun;
use crate::ego::{Actuator, Command, Controller, Percept};
use crate::road::OnRoad;
use crate::rulebook::{NewSamples, RunsJudge, Stop, Verdict};
use crate::scene::drive::{
    Drive, LaneKeeper, Maneuver, SceneState, Sensing, blank_percept, fill_percept,
};
use crate::seed::StartKey;
use crate::sim::kinematic::KinematicLanes;
use crate::sim::{BodyId, BodyState};
use crate::stl::SampleColumns;
use crate::testbench::NoisyStart;

/// Runs of one world side by side.
///
/// The order within a sample is that of a test bench: percept and commands, physics,
/// signals, rules, verdict.
pub(super) struct LaneRuns {
    world: LaneWorld,
    runs: Vec<EnvRun>,
    plant: KinematicLanes,
    vehicles: Vec<Drivetrains>,
    controllers: Vec<Box<dyn Controller>>,
    /// Sensors of each run, empty if they neither delay nor disturb.
    sensing: Vec<Sensing>,
    /// Number of the newest sample of each run.
    samples: Vec<usize>,
    judge: RunsJudge,
    /// Parts of the loaded run. Signals, percepts and scripts read the scene.
    scene: SceneState,
    percept: Percept,
    /// Its new samples: a column per signal.
    columns: Vec<Vec<f64>>,
    /// 0 for each new sample that has finite numbers only.
    checks: Vec<f64>,
    /// Newest row of each run, `[runs, signals]`, empty if nobody reads rows.
    rows: Vec<f64>,
}

/// Actuators, lane keepers and actions of one vehicle in every run.
struct Drivetrains {
    actuators: Vec<Actuator>,
    keepers: Vec<LaneKeeper>,
    chosen: Vec<Maneuver>,
}

/// Result of the motion of the loaded run for some samples.
struct DrivenLane {
    /// Number of new samples.
    count: usize,
    /// Why no further sample follows.
    stop: Option<Stop>,
    /// True if a fault followed the samples.
    is_faulty: bool,
}

impl LaneRuns {
    /// Creates runs that have not begun, `None` if the world does not fit.
    ///
    /// `has_rows`: keep the newest row of each run.
    pub(super) fn new(world: &LaneWorld, runs: usize, has_rows: bool) -> Option<LaneRuns> {
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
        // Samples are judged after each decision, so columns need no more room.
        let block = world.samples_per_decision;
        // Signals and percepts read a scene, which shows one run at a time.
        let mut scene = SceneState::new(Arc::clone(spec), Arc::clone(&layout.network));
        scene.bodies.extend((0..spec.agents.len()).map(BodyId));
        scene.states.resize(spec.agents.len(), BodyState::default());
        scene.on_road.resize(spec.agents.len(), OnRoad::default());
        Some(LaneRuns {
            runs: EnvRun::several(runs, spec.clock.decisions()),
            plant: KinematicLanes::new(bodies, world.ground, runs)?,
            vehicles: spec.agents.iter().map(drivetrains).collect(),
            controllers: (0..runs).map(|_| controller()).collect(),
            // Perfect sensors have no state, so they need no copy per run.
            sensing: vec![sensing; if disturb { runs } else { 0 }],
            samples: vec![0; runs],
            judge: RunsJudge::new(&world.rulebook, world.samples, runs)?,
            scene,
            percept: blank_percept(spec, layout.ego),
            columns: vec![vec![0.0; block]; layout.schema.len()],
            checks: vec![0.0; block],
            rows: vec![
                0.0;
                if has_rows {
                    runs * layout.schema.len()
                } else {
                    0
                }
            ],
            world: world.clone(),
        })
    }

    pub(super) fn run(&self, at: usize) -> &EnvRun {
        &self.runs[at]
    }

    pub(super) fn begin(&mut self, run: usize, key: StartKey, observation: &mut [f32]) {
        // The stream of `Testbench::noise_of`, so that both layouts play the same noise.
        let noise = key.generator("", "noise").next_u64();
        let start = (self.world.layout.draw(key), noise);
        self.begin_at(run, NoisyStart::from(&start), observation);
        // Afterwards, because every beginning forgets the key.
        self.runs[run].key = Some(key);
    }

    pub(super) fn begin_at(
        &mut self,
        run: usize,
        NoisyStart { start, noise }: NoisyStart<'_>,
        observation: &mut [f32],
    ) {
        // A handle of its own, because the calls below borrow all of these runs.
        let layout = Arc::clone(&self.world.layout);
        let spec = &layout.spec;
        let drawn = spec.drawn(start);
        for (i, (agent, at)) in spec.agents.iter().zip(&drawn).enumerate() {
            let pose = layout.start_pose(agent, (at.front_m, at.lateral_m));
            let (body, ground) = (&agent.body, self.world.ground);
            self.plant.spawn(i, body, ground, pose, at.speed_mps);
            let vehicle = &mut self.vehicles[i];
            (vehicle.actuators[run], vehicle.keepers[run]) =
                layout.drivetrain_of(agent, at.lateral_m);
            // The first sample comes before the first decision.
            vehicle.chosen[run] = Maneuver::NONE;
        }
        // A spawn sets the loaded run only, and `store` makes it this one.
        self.plant.store(run);
        if let Some(sensing) = self.sensing.get_mut(run) {
            sensing.reset(noise);
        }
        self.controllers[run].reset(noise);
        self.runs[run].begin(None);
        self.judge.begin(run);
        self.samples[run] = 0;
        // The scene still shows the run before.
        self.scene.sample = 0;
        self.scene.touch = None;
        self.look();
        self.publish(0);
        let first = DrivenLane {
            count: 1,
            stop: None,
            is_faulty: false,
        };
        self.conclude(run, 0, &first, observation);
    }

    /// Returns the newest row of a run, empty if rows are not kept.
    pub(super) fn row(&self, run: usize) -> &[f64] {
        self.rows.chunks(self.columns.len()).nth(run).unwrap_or(&[])
    }

    pub(super) fn step(&mut self, actions: &[usize], mut into: StepInto<'_>) {
        let count = self.runs.len();
        for (run, &action) in actions.iter().enumerate().take(count) {
            (into.rewards[run], into.ends[run]) = (0.0, None);
            if self.runs[run].is_over {
                continue;
            }
            self.runs[run].actions.push(action as u32);
            // The first sample may have decided the episode, which then stands still.
            if self.runs[run].verdict.is_none() {
                self.decide(run, action);
                let first = self.samples[run] + 1;
                let driven = self.drive(run);
                self.conclude(run, first, &driven, into.row(run, count));
            }
            let report = self.runs[run].report(&self.world.rulebook);
            (into.rewards[run], into.ends[run]) = report;
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

    /// Drives a run to its next decision, and publishes its samples.
    fn drive(&mut self, run: usize) -> DrivenLane {
        let sample_s = self.world.layout.spec.clock.sample_s;
        self.plant.load(run);
        self.scene.sample = self.samples[run];
        // The scene shows one run at a time, and the one before may have ended in
        // contact.
        self.scene.touch = None;
        self.look();
        let mut driven = DrivenLane {
            count: 0,
            stop: None,
            is_faulty: false,
        };
        while driven.count < self.world.samples_per_decision && driven.stop.is_none() {
            let commanded = self.command_all(run);
            let moved = commanded.and_then(|()| self.plant.advance(sample_s));
            let Some(touch) = moved else {
                driven.is_faulty = true;
                break;
            };
            self.scene.sample += 1;
            self.scene.touch = touch;
            self.look();
            self.publish(driven.count);
            driven.count += 1;
            // At the last sample both hold, and a test bench reports the contact.
            driven.stop = match touch {
                Some(_) => Some(Stop::Contact),
                None if self.scene.sample + 1 == self.world.samples => Some(Stop::Horizon),
                None => None,
            };
        }
        self.samples[run] = self.scene.sample;
        self.plant.store(run);
        driven
    }

    /// Reads the loaded run from the plant.
    #[inline]
    fn look(&mut self) {
        let SceneState {
            states,
            on_road,
            network,
            ..
        } = &mut self.scene;
        for (vehicle, (state, at)) in states.iter_mut().zip(on_road).enumerate() {
            *state = self.plant.state(vehicle);
            *at = network.locate(vehicle, &state.pose);
        }
    }

    /// Commands all vehicles of the loaded run, `None` if the ego's command is a fault.
    #[inline]
    fn command_all(&mut self, run: usize) -> Option<()> {
        fill_percept(&mut self.percept, &self.scene, self.world.layout.ego);
        if let Some(sensing) = self.sensing.get_mut(run) {
            sensing.look(&mut self.percept, 1.0);
        }
        let command = self.controllers[run].control(&self.percept).ok()?;
        // Such a command is a fault of the ego on a test bench as well.
        if !command.is_plausible() {
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
                let wish = Command {
                    accel_mps2,
                    lateral_mps,
                };
                let (actuator, keeper) = (&mut vehicle.actuators[run], &mut vehicle.keepers[run]);
                let (accel_mps2, curvature_per_m) = self.scene.driven(i, actuator, keeper, wish);
                self.plant.command(i, accel_mps2, curvature_per_m);
            }
        }
        Some(())
    }

    /// Writes the signals of the loaded run that somebody reads.
    #[inline]
    fn publish(&mut self, at: usize) {
        for it in &self.world.published {
            // The scene's own plant is empty.
            self.columns[it.position][at] = if it.is_gap {
                self.plant.gap_m(it.source.whose)
            } else {
                it.source.value(&self.scene)
            };
        }
    }

    /// Judges the new samples of a run, the first of which is its sample `first`.
    fn conclude(&mut self, run: usize, first: usize, driven: &DrivenLane, observation: &mut [f32]) {
        let DrivenLane {
            mut count,
            mut stop,
            mut is_faulty,
        } = *driven;
        self.derive(count);
        // A row that is no sample ends the episode with a fault, and is still observed.
        let broken = (0..count).find(|i| self.checks[*i] != 0.0);
        let mut last = count.checked_sub(1);
        if let Some(broken) = broken {
            (count, stop, is_faulty, last) = (broken, None, true, Some(broken));
        }
        let new = NewSamples {
            run,
            first,
            count,
            columns: SampleColumns(&self.columns),
            stop,
        };
        let decided = self.judge.push(&self.world.rulebook, &new);
        if let Some((verdict, at)) = decided {
            last = Some(at);
            self.runs[run].robustness = self.judge.robustness(run, first + at);
            self.runs[run].verdict = Some(verdict);
        } else if is_faulty {
            self.runs[run].verdict = Some(Verdict::Invalid);
        }
        // Without a new sample the observation stays.
        if let Some(last) = last {
            let observed = &self.world.layout.observed;
            observed.read(|position| self.columns[position][last], observation);
            let width = self.columns.len();
            let row = self.rows.chunks_mut(width).nth(run);
            for (to, column) in row.into_iter().flatten().zip(&self.columns) {
                *to = column[last];
            }
        }
    }

    /// Computes the derived signals of the new samples, and checks all signals.
    fn derive(&mut self, count: usize) {
        let published = self.world.layout.sources.len();
        for (i, expr) in self.world.layout.derived.iter().enumerate() {
            // A derived signal reads only those before it.
            let (before, rest) = self.columns.split_at_mut(published + i);
            if let Some(values) = rest.first_mut() {
                expr.eval_all(SampleColumns(before), 0, &mut values[..count]);
            }
        }
        let checks = &mut self.checks[..count];
        checks.fill(0.0);
        for position in &self.world.checked {
            // A number times 0 is 0, unless it is not finite. Then the sum is NaN.
            let pairs = checks.iter_mut().zip(&self.columns[*position]);
            pairs.for_each(|(check, value)| *check += value * 0.0);
        }
    }

    /// Returns the memory of all runs, and of what they share, if it is known.
    pub(super) fn bytes(&self) -> Option<usize> {
        let controllers = self
            .controllers
            .iter()
            .map(|it| size_of_val(&**it) + size_of_val(it));
        let vehicles = self.vehicles.iter().map(|it| {
            let columns = size_of_val(&*it.actuators) + size_of_val(&*it.keepers);
            size_of::<Drivetrains>() + columns + size_of_val(&*it.chosen)
        });
        let columns = self
            .columns
            .iter()
            .chain([&self.checks])
            .map(|it| size_of_val(it) + it.capacity() * size_of::<f64>());
        let shared = size_of::<LaneRuns>()
            + size_of_val(&*self.scene.states)
            + size_of_val(&*self.scene.on_road)
            + size_of_val(&*self.percept.others)
            + size_of_val(&*self.rows)
            + columns.sum::<usize>();
        let runs = self.runs.iter().map(EnvRun::bytes).sum::<usize>()
            + size_of_val(&*self.sensing)
            + size_of_val(&*self.samples);
        let driven = self.plant.bytes() + vehicles.sum::<usize>() + controllers.sum::<usize>();
        Some(shared + runs + driven + self.judge.bytes()?)
    }
}
