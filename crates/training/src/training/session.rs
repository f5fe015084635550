//! Training from its world to its closing evaluation.
//!
//! It is new, resumed, or fine-tuned from another run.

use std::path::{Path, PathBuf};

use super::bank::gather;
use super::error::{OptionClash, SessionError};
use super::per_ado_mode::PerAdoMode;
use super::train_loop::{TrainError, TrainingOutcome, steps, train};
use crate::adversary::Ado;
use crate::crashes::description;
use crate::crashes::save_crashes::keep_first;
use crate::experiment::{
    EgoUnderTest, TestStarts, Watch, check_repeatability, consent, consent_to_family, on_plant,
};
use crate::risk::{RiskTraffic, TrafficCrashes};
use crate::rl::{LearnerConfig, Policy, TrafficSettings};
use crate::run_dir::{
    About, Beginning, ChangedEgo, Counterexample, KeptError, KnownFailures, RequestedTraining, Row,
    RunDir, RunError, bind_programs, file_name, make_dir, trained_naturally,
};
use crate::search::{
    Adversary, BASELINES, Experiment, ExperimentCell, GUIDED_BUDGET, Guided, GuidingPolicy, Search,
};
use crate::sim::PlantKind;
use crate::testbench::{Aftermath, Replay, play};
use crate::world::{Change, Scenario, TrainingEgos, TrainingGoal};

/// Runs from natural starts, from which the rates of an ado trained as traffic are estimated.
const TRAFFIC_RUNS: u64 = 4000;
/// Counterexamples of the closing evaluation that a run directory keeps.
const KEPT_EPISODES: usize = 5;

/// Request to train in a world.
///
/// A missing option has the value of the world, or of the resumed run.
#[derive(Clone, Copy, Debug, Default)]
pub struct TrainRequest<'a> {
    /// Seed of the training, 0 by default.
    pub seed: Option<u64>,
    /// Number of decisions.
    pub decisions: Option<u64>,
    /// Name under the world's `learners`.
    pub learner: Option<&'a str>,
    /// Training of a policy per ado, instead of one for all of them.
    pub per_ado: Option<PerAdoMode>,
    /// Goals of the training, instead of those of the world.
    pub goals: Option<&'a [TrainingGoal]>,
    /// Training against the world's ego or its family.
    pub against: TrainingEgos,
    /// Structure of the family that is left out.
    pub leave_out: Option<&'a str>,
    /// Changed ego to train against: a name under `reuse`, or a RON file.
    pub ego: Option<&'a str>,
    /// Plant to train on.
    pub plant: Option<PlantKind>,
    /// Run whose policy is fine-tuned.
    pub from: Option<&'a RunDir>,
    /// Runs and kept counterexamples, of any ego, to learn from.
    pub bank: &'a [PathBuf],
    /// Traffic that the ados are trained as, given that the ego fails.
    pub traffic: Option<&'a RiskTraffic>,
    /// Temperature at which such ados draw their actions, 1 by default.
    pub temperature: Option<f64>,
    /// Power of the traffic's law, from 1, the default, to 0: all possible actions alike.
    pub prior: Option<f64>,
}

/// Training with its run directory.
pub struct TrainSession {
    run: RunDir,
    world: Scenario,
    ego: EgoUnderTest,
}

/// Closing evaluation of a training.
pub struct Closing {
    /// Rows of the trained ado and the baselines.
    pub rows: Vec<Row>,
    /// Crashes and rates of an ado that was trained as traffic.
    pub traffic: Option<TrafficCrashes>,
    trained: ExperimentCell,
}

impl TrainSession {
    /// Creates a run directory to train in.
    ///
    /// An unsuitable request is refused before anything is created.
    ///
    /// # Errors
    /// The request does not fit the world, there is a run already, a program may
    /// not be started, or the disk refuses.
    pub fn begin(
        world: &Scenario,
        path: &Path,
        request: &TrainRequest<'_>,
    ) -> Result<TrainSession, SessionError> {
        let world = request.world(world)?;
        if world
            .drive()
            .is_some_and(|driving| driving.spec().action_sets().next().is_none())
        {
            return Err(SessionError::NoAdo {
                world: world.name.clone(),
            });
        }
        // All of the request is checked before the directory exists.
        let ego = request.ego(&world)?;
        let seed = request.seed.unwrap_or(0);
        let from = request.from.map(|from| from.policy_bundle()).transpose()?;
        if let Some(bundle) = &from {
            let fits = world.learner.build_from(world.spaces(), seed, bundle);
            // Built here to see whether it fits. The training builds its own.
            fits.map_err(TrainError::from)?;
        }
        let bank = gather(&world, request.bank)?;
        let begin = |ego| {
            let with = Beginning {
                from: from.as_ref(),
                bank: &bank,
                known: None,
                ego,
            };
            RunDir::begin(path, &world, seed, with)
        };
        TrainSession::with(world.clone(), ego, begin)
    }

    /// Creates a run directory for a training with the options and the seed of this one,
    /// in which failures of rare cells earn more.
    ///
    /// # Errors
    /// There is a run already, or the disk refuses.
    pub(crate) fn begin_beyond(
        &self,
        path: &Path,
        known: &KnownFailures,
    ) -> Result<TrainSession, SessionError> {
        let (begun, from) = (self.run.manifest(), self.run.from()?);
        let begin = |ego| {
            let with = Beginning {
                from: from.as_ref(),
                known: Some(known),
                ego,
                ..Beginning::default()
            };
            RunDir::begin(path, &self.world, begun.seed, with)
        };
        TrainSession::with(self.world.clone(), begun.ego.clone(), begin)
    }

    /// Opens a run directory to resume its training.
    ///
    /// # Errors
    /// There is no run, or it was begun as another training.
    pub fn resume(
        given: &Scenario,
        path: &Path,
        request: &TrainRequest<'_>,
    ) -> Result<TrainSession, SessionError> {
        let requested_world = request.world(given)?;
        // The request is checked first, because an invalid one is no reason to lock the
        // run.
        let requested = request.ego(&requested_world)?;
        let run = RunDir::resume(path)?;
        let driven = match request.in_begun_traffic(given, &run)? {
            Some(in_traffic) => request.world(&in_traffic)?,
            None => requested_world,
        };
        let world = request.as_begun(driven, &run)?;
        let begun = run.manifest();
        let ego = match request.ego {
            Some(_) => requested,
            None => begun.ego.clone(),
        };
        let seed = request.seed.unwrap_or(begun.seed);
        // Code is in no file, so it must be given again.
        let own = ego.as_ref().filter(|ego| ego.is_own());
        if own.is_some_and(|ego| world.own_ego() != Some(&ego.name)) {
            let name = own.map_or("", |ego| &ego.name);
            return Err(SessionError::EgoInNoFile {
                ego: name.to_owned(),
            });
        }
        run.must_be_of(RequestedTraining {
            scenario: &world,
            seed,
            ego: ego.as_ref(),
        })?;
        TrainSession::with(world, ego, |_| Ok(run))
    }

    /// Requires consent, and only then opens the run.
    fn with(
        world: Scenario,
        ego: Option<ChangedEgo>,
        open: impl FnOnce(Option<ChangedEgo>) -> Result<RunDir, RunError>,
    ) -> Result<TrainSession, SessionError> {
        let tested = EgoUnderTest::of_training(&world, ego.as_ref())?;
        consent(&world, std::slice::from_ref(&tested))?;
        // Before the directory is made, so that a refusal leaves nothing behind.
        consent_to_family(&world)?;
        let mut run = open(ego)?;
        // A rebuilt program is another ego.
        let content = tested.program_content();
        let programs = content.map(|content| (tested.name().to_owned(), content));
        bind_programs(run.path(), &programs.into_iter().collect(), false)?;
        run.allow_programs(world.may_start_programs());
        if world.begins_egos_anew() {
            run.begin_egos_anew();
        }
        Ok(TrainSession {
            run,
            world,
            ego: tested,
        })
    }

    /// Trains until the requested decisions are taken, or `watch` stops it.
    ///
    /// # Errors
    /// The disk refuses, or the ego keeps failing to run.
    pub fn train(&mut self, watch: &Watch<'_>) -> Result<TrainingOutcome, SessionError> {
        let scenario = self.ego.scenario();
        let watch = watch.first_of(steps(scenario));
        Ok(train(scenario, &mut self.run, &watch)?)
    }

    /// Evaluates the trained ado and the baselines on the first test starts.
    ///
    /// `None`: stopped before there was a result.
    ///
    /// # Errors
    /// The policy cannot be read.
    pub fn evaluate(
        &self,
        starts: usize,
        watch: &Watch<'_>,
    ) -> Result<Option<Closing>, SessionError> {
        let policy = self.run.policy()?;
        let steps = steps(self.ego.scenario());
        // The evaluation is the last step, after the training and its searches.
        let watch = &watch.first_of(steps).later(steps - 1);
        let nominal = EgoUnderTest::nominal(&self.run.world()?);
        // The same starts after every training, so that closing rows compare.
        let stored = TestStarts::stored(Some(self.run.path()), &nominal, starts, 0, watch);
        let Some(starts) = stored else {
            return Ok(None);
        };
        let trained: &dyn Adversary = &Ado::Trained(&*policy, self.run.manifest().seed);
        let experiment = Experiment {
            ego: &self.ego,
            adversaries: [trained].into_iter().chain(BASELINES).collect(),
            starts: &starts,
        };
        // Invariant: every adversary here has a cell, and the first is the trained ado's.
        let mut cells = experiment.run(watch);
        let mut second = self.second_look(&*policy, &starts, watch);
        let rows = cells.iter_mut().map(|cell| &mut cell.row);
        check_repeatability(&self.ego, &starts, rows.chain(second.as_mut()), watch);
        let mut rows: Vec<Row> = cells.iter().map(|cell| cell.row.clone()).collect();
        let trained = cells.swap_remove(0);
        if let Some(row) = second {
            // Below the ado's own row, with which it is compared.
            rows.insert(1, row);
        }
        let traffic = match self.traffic_crashes(&*policy, watch)? {
            Some(crashes) => crashes,
            None => return Ok(None),
        };
        Ok(Some(Closing {
            rows,
            traffic,
            trained,
        }))
    }

    /// Plays an ado that was trained as traffic from natural starts.
    ///
    /// The outer `None`: stopped. The inner one: the ado is no traffic.
    fn traffic_crashes(
        &self,
        policy: &dyn Policy,
        watch: &Watch<'_>,
    ) -> Result<Option<Option<TrafficCrashes>>, SessionError> {
        let ego = self.ego.scenario();
        if ego.learner.as_traffic().is_none() {
            return Ok(Some(None));
        }
        // Bound to the world of the ego, whose starts are the same.
        let Some(traffic) = RiskTraffic::of_world(ego)? else {
            return Ok(Some(None));
        };
        watch.phase("playing natural starts");
        // Seed 0, as the test starts: equal ados have equal rates.
        let crashes = traffic.crashes_of(ego, policy, [TRAFFIC_RUNS, 0], watch);
        Ok(crashes.map(Some))
    }

    /// Searches every start by the ado's proposals where its greedy actions do not succeed.
    ///
    /// `None` unless the calibration has shown that it then solves more starts.
    fn second_look(
        &self,
        policy: &dyn Policy,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<Row> {
        let calibration = self.run.manifest().calibration;
        // Draws that solved nothing on the calibration starts will not pay on the test
        // starts.
        calibration.filter(|calibration| calibration.drawn > 0)?;
        let guided = Search {
            method: Guided(GuidingPolicy(policy)).into(),
            budget: GUIDED_BUDGET,
        };
        let cell = guided.play(&self.ego, starts, watch)?;
        Some(Row {
            train_seed: Some(self.run.manifest().seed),
            ..cell.row
        })
    }

    /// Writes the closing evaluation and some counterexamples into the run.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(&self, closing: &Closing) -> Result<(), SessionError> {
        self.run.save_report(&closing.rows)?;
        let episodes = self.run.path().join("episodes");
        match &closing.traffic {
            Some(traffic) => self.keep_likeliest(traffic, &episodes)?,
            None => keep_first(&closing.trained, &episodes, KEPT_EPISODES).map(|_| ())?,
        }
        Ok(())
    }

    /// Keeps the likeliest crash of the most frequent kinds, with their rates.
    fn keep_likeliest(&self, traffic: &TrafficCrashes, dir: &Path) -> Result<(), KeptError> {
        make_dir(dir)?;
        let (scenario, name) = (self.ego.scenario(), self.ego.name());
        let mut bench = scenario.bench();
        for crash in traffic.likeliest.iter().take(KEPT_EPISODES) {
            let (start, noise) = &crash.start;
            let mut ado = Replay::holding(&crash.actions);
            let episode = play(&mut bench, start, *noise, &mut ado, Aftermath::Play);
            let (change, caption) = (self.ego.change(), "trained");
            let mut kept = Counterexample::record(scenario, name, change, caption, &episode);
            kept.about = Some(About {
                traffic: Some(crash.likelihood.clone()),
                ..description(scenario, &episode)
            });
            let stem = file_name(&format!("{name} {}", crash.likelihood.kind));
            kept.save_as(dir, &stem, &episode.trace)?;
        }
        Ok(())
    }

    /// Returns the run directory.
    pub fn run(&self) -> &RunDir {
        &self.run
    }

    /// Returns the ego of the training, in its world.
    pub fn ego(&self) -> &EgoUnderTest {
        &self.ego
    }

    /// Returns the world with the learner, the plant and the egos of the training.
    pub fn world(&self) -> &Scenario {
        &self.world
    }
}

impl TrainRequest<'_> {
    /// Returns the world with the requested options.
    pub fn world(&self, world: &Scenario) -> Result<Scenario, SessionError> {
        let in_traffic = self.in_traffic(world)?;
        let given = in_traffic.as_ref().unwrap_or(world);
        let mut world = match self.plant {
            Some(plant) => on_plant(given, plant)?,
            None => given.clone(),
        };
        if let Some(goals) = self.goals {
            world = world.training_towards(goals).map_err(SessionError::Goals)?;
        }
        if let Some(name) = self.learner {
            let none = || SessionError::NoLearner {
                world: world.name.clone(),
                learner: name.to_owned(),
                known: world.learners.keys().cloned().collect(),
            };
            world = world.learning_by(name).ok_or_else(none)?;
        }
        if let Some(mode) = self.per_ado {
            world = mode.in_world(&world)?;
        }
        // A structure can only be left out of egos that are drawn.
        if self.leave_out.is_some() && self.against != TrainingEgos::Randomized {
            return Err(SessionError::Options(OptionClash::LeaveOut));
        }
        if !self.against.is_nominal() {
            world = self.against_family(&world)?;
        }
        Ok(match self.decisions {
            Some(decisions) => world.training_for(decisions)?,
            None => world,
        })
    }

    /// Returns the world in which the ados are trained as traffic, if they are.
    fn in_traffic(&self, world: &Scenario) -> Result<Option<Scenario>, SessionError> {
        let refused = |clash: OptionClash| Err(SessionError::Options(clash));
        let Some(traffic) = self.traffic else {
            return match (self.temperature, self.prior) {
                (Some(_), _) => refused(OptionClash::Temperature),
                (None, Some(_)) => refused(OptionClash::Prior),
                (None, None) => Ok(None),
            };
        };
        // Training as traffic has a learner and an aim of its own.
        if self.learner.is_some() || self.per_ado.is_some() || self.goals.is_some() {
            return refused(OptionClash::TrafficAndLearner);
        }
        if !self.against.is_nominal() {
            return refused(OptionClash::TrafficAndMany);
        }
        let defaults = TrafficSettings::default();
        let settings = TrafficSettings {
            temperature: self.temperature.unwrap_or(defaults.temperature),
            prior: self.prior.unwrap_or(defaults.prior),
            ..defaults
        };
        Ok(Some(traffic.training_world(world, settings)?))
    }

    /// Returns the world in the traffic of a run that was begun in some.
    fn in_begun_traffic(
        &self,
        world: &Scenario,
        run: &RunDir,
    ) -> Result<Option<Scenario>, SessionError> {
        let begun = run.world()?;
        let Some(settings) = begun.learner.as_traffic() else {
            return Ok(None);
        };
        let (None, Some(traffic)) = (self.traffic, RiskTraffic::of_world(&begun)?) else {
            return Ok(None);
        };
        Ok(Some(traffic.training_world(world, settings.clone())?))
    }

    fn against_family(&self, world: &Scenario) -> Result<Scenario, SessionError> {
        let refused = |clash: OptionClash| Err(SessionError::Options(clash));
        // A family draws the ego of each episode.
        if self.ego.is_some() {
            return refused(OptionClash::FamilyAndEgo);
        }
        if self.learner.is_some() || self.per_ado.is_some() {
            return refused(OptionClash::FamilyAndLearner);
        }
        if self.plant.is_some() {
            return refused(OptionClash::FamilyAndPlant);
        }
        let world = self.leaving_out(world)?;
        world
            .training_against(self.against)
            .ok_or_else(|| SessionError::NoFamily {
                world: world.name.clone(),
            })
    }

    /// Returns the world without the structure to leave out.
    pub fn leaving_out(&self, world: &Scenario) -> Result<Scenario, SessionError> {
        let Some(name) = self.leave_out else {
            return Ok(world.clone());
        };
        world.leaving_out(name).ok_or_else(|| {
            let structures = world.family().into_iter().flat_map(|f| &f.structures);
            SessionError::NoStructure {
                world: world.name.clone(),
                structure: name.to_owned(),
                known: structures.map(|other| other.name.clone()).collect(),
            }
        })
    }

    /// Returns the requested changed ego. `None`: the nominal ego.
    fn ego(&self, world: &Scenario) -> Result<Option<ChangedEgo>, SessionError> {
        match self.ego {
            None => Ok(world.own_ego().map(|name| ChangedEgo {
                name: name.to_owned(),
                change: Change::default(),
            })),
            // A training has one ego, unless the world's family gives it.
            Some("all") => Err(SessionError::Options(OptionClash::AllEgos)),
            Some(name) => {
                let egos = EgoUnderTest::find(world, name)?;
                Ok(egos.first().and_then(EgoUnderTest::as_changed))
            }
        }
    }

    /// Returns the world with the options of the resumed run where none are requested.
    fn as_begun(&self, mut world: Scenario, run: &RunDir) -> Result<Scenario, SessionError> {
        let begun = run.manifest();
        if let (None, Some(plant)) = (self.plant, begun.plant.plant()) {
            world = world.on(plant);
        }
        // A limit that does not fit the world is reported below, as a difference.
        if let (None, Some(natural)) = (world.traffic().limit(), &begun.natural)
            && let Ok(limited) = trained_naturally(&world, natural)
        {
            world = limited;
        }
        if self.goals.is_none() {
            world.goals.clone_from(&begun.goals);
        }
        // Each option that is not given again is that of the run.
        let left_out = begun
            .left_out
            .as_deref()
            .filter(|_| self.leave_out.is_none());
        if let Some(others) = left_out.and_then(|name| world.leaving_out(name)) {
            world = others;
        }
        if self.against.is_nominal()
            && let Some(family) = world.training_against(begun.against)
        {
            world = family;
        }
        let learner = begun.learner.as_ref().filter(|_| self.learner.is_none());
        if let Some(learner) = learner.and_then(|name| world.learning_by(name)) {
            world = learner;
        }
        // The learner is that of the run, even if the world has changed.
        let learner = serde_json::from_value::<LearnerConfig>(begun.settings.clone());
        Ok(match (self.decisions, learner) {
            (Some(decisions), _) => world.training_for(decisions)?,
            (None, Ok(learner)) => world.learning_with(learner),
            // Settings of an older version may be unreadable. They are reported as a
            // difference.
            (None, Err(_)) => world.training_for(begun.decisions)?,
        })
    }
}
