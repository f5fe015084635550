//! Hardening from its request to its report: search, train, search again, confirm.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use super::ado_set::{AdoSet, HardeningAdo};
use super::candidate::{Conditions, EgoCandidate, EgoMeasurement, front, worst_loss};
use super::ego_parameters::EgoParameters;
use super::error::HardenError;
use super::files::write_change;
use super::losses::{DrivingLoss, NaturalDriving, check};
use super::optimizer::{Optimizer, Slice, Trial, slices};
use super::report::{AdoRun, FrontPoint, HardenReport, NewAdo, StartCount};
use crate::experiment::{EgoUnderTest, TestStarts, Watch, consent};
use crate::risk::RiskTraffic;
use crate::run_dir::make_dir;
use crate::seed::{FIRST_SEALED, Purpose, StartKey, derived_seed};
use crate::training::{TrainRequest, TrainSession};
use crate::world::Scenario;

/// Request to harden an ego.
pub struct HardenRequest<'a> {
    /// World of the ados, on the plant of all runs.
    pub world: &'a Scenario,
    /// Parameters that may change, of the ego under test.
    pub parameters: EgoParameters,
    /// Ados of the search. Without a trained one, the first is trained now.
    pub ados: AdoSet,
    /// Traffic in which losses are measured.
    pub traffic: &'a RiskTraffic,
    /// Limits on the losses.
    pub losses: Vec<DrivingLoss>,
    /// Directory of the files, without content.
    pub dir: &'a Path,
    /// Numbers of starts, runs and decisions.
    pub settings: HardenSettings,
}

/// Numbers of a hardening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HardenSettings {
    /// Least reduction of the failures, as a share.
    pub reduction: f64,
    /// Starts of the search.
    pub search_starts: usize,
    /// Natural runs of the search.
    pub runs: usize,
    /// Sealed starts of the confirmation.
    pub sealed_starts: usize,
    /// Decisions of each training.
    pub decisions: u64,
    /// Most searches, each followed by a training.
    pub rounds: usize,
    /// Seed of all draws and trainings.
    pub seed: u64,
}

impl Default for HardenSettings {
    fn default() -> HardenSettings {
        HardenSettings {
            reduction: 0.9,
            search_starts: 60,
            runs: 120,
            sealed_starts: 300,
            decisions: 100_000,
            rounds: 3,
            seed: 0,
        }
    }
}

impl HardenRequest<'_> {
    /// Hardens the ego, and writes the changes that were found.
    ///
    /// Stopped, the report has what was found so far.
    ///
    /// # Errors
    /// The request has no possible result, the ego does not run, or the disk refuses.
    pub fn run(self, watch: &Watch<'_>) -> Result<HardenReport, HardenError> {
        self.check()?;
        make_dir(self.dir)?;
        let ego = self.parameters.base().clone();
        // The training of the first ado reads this file.
        if !ego.is_nominal() {
            write_change(&before(self.dir), "the ego as it was", ego.change())?;
        }
        let mut hardening = Hardening {
            request: self,
            ego,
            runs: Vec::new(),
            chosen: Vec::new(),
            searched: StartCount::of(&[]),
            front: Vec::new(),
            played: AtomicUsize::new(0),
        };
        if hardening.request.ados.trained.is_empty() && !hardening.train_first(watch)? {
            return Ok(hardening.report(None, watch));
        }
        hardening.search(watch)?;
        // Without an ado of its own, a candidate cannot be confirmed.
        if hardening.chosen.is_empty() || hardening.chosen.iter().any(|it| it.ado.is_none()) {
            return Ok(hardening.report(None, watch));
        }
        hardening.confirmed(watch)
    }

    /// Refuses requests without a possible result before anything is played.
    fn check(&self) -> Result<(), HardenError> {
        let world = self.world;
        let name = || world.name().to_owned();
        if world.starts().is_some() {
            return Err(HardenError::ListedStarts { world: name() });
        }
        let trains = |driving: crate::world::DriveScenario<'_>| {
            driving.spec().action_sets().next().is_some()
        };
        if !world.drive().is_some_and(trains) {
            return Err(HardenError::NoAdo { world: name() });
        }
        check(world, &self.losses)?;
        consent(world, std::slice::from_ref(self.parameters.base()))?;
        let has_content = std::fs::read_dir(self.dir).is_ok_and(|mut it| it.next().is_some());
        if has_content {
            return Err(HardenError::Taken {
                path: self.dir.to_owned(),
            });
        }
        Ok(())
    }
}

fn before(dir: &Path) -> PathBuf {
    dir.join("before.ron")
}

/// Candidate that is confirmed, with the ado that was trained against it.
pub(super) struct Chosen {
    pub(super) candidate: EgoCandidate,
    pub(super) file: PathBuf,
    pub(super) size: f64,
    /// True if it meets the conditions on the starts of the search.
    pub(super) is_feasible: bool,
    /// Position of its own ado among the trained ones, and facts about it.
    ///
    /// `None`: stopped, it does not meet the conditions, or no start shows that it does.
    pub(super) ado: Option<(usize, NewAdo)>,
}

/// Hardening in progress.
pub(super) struct Hardening<'a> {
    pub(super) request: HardenRequest<'a>,
    pub(super) ego: EgoUnderTest,
    pub(super) runs: Vec<AdoRun>,
    pub(super) chosen: Vec<Chosen>,
    pub(super) searched: StartCount,
    pub(super) front: Vec<FrontPoint>,
    pub(super) played: AtomicUsize,
}

/// Starts, draws and ados of a round, as the trial of its candidates.
struct SearchRound<'a> {
    parameters: &'a EgoParameters,
    ados: &'a AdoSet,
    starts: &'a TestStarts,
    driving: &'a NaturalDriving<'a>,
    played: &'a AtomicUsize,
    watch: Watch<'a>,
}

impl Trial for SearchRound<'_> {
    fn play(&self, values: &[f64], slice: &Slice) -> Option<EgoMeasurement> {
        let ego = self.parameters.ego("candidate", values).ok()?;
        if slice.starts.start == 0 {
            // A candidate plays its first slice once, however far it comes.
            self.played.fetch_add(1, Ordering::Relaxed);
        }
        let part = TestStarts {
            seed: self.starts.seed,
            starts: self.starts.starts[slice.starts.clone()].to_vec(),
            trivial: self.starts.trivial[slice.starts.clone()].to_vec(),
        };
        let mut outcomes = self.ados.outcomes_of_search(&ego, &part, &self.watch)?;
        // Kept crashes belong to the first stage, as the most telling starts.
        if slice.starts.start == 0 {
            outcomes.extend(self.ados.kept_outcomes(&ego, &self.watch)?);
        }
        let runs = self
            .driving
            .measure(ego.scenario(), slice.runs.clone(), &self.watch)?;
        Some(EgoMeasurement { outcomes, runs })
    }
}

impl Hardening<'_> {
    /// Trains the first ado, against the ego as it is. Returns whether it was finished.
    fn train_first(&mut self, watch: &Watch<'_>) -> Result<bool, HardenError> {
        let own = self.ego.clone();
        let file = (!own.is_nominal()).then(|| before(self.request.dir));
        Ok(self.train(file.as_deref(), watch)?.is_some())
    }

    /// Trains an ado against a changed ego, which joins the others. `None`: stopped.
    fn train(
        &mut self,
        change: Option<&Path>,
        watch: &Watch<'_>,
    ) -> Result<Option<(usize, NewAdo)>, HardenError> {
        let settings = self.request.settings;
        let number = self.runs.len() as u64;
        let name = format!("ado-{number}");
        let path = self.request.dir.join(&name);
        let seed = derived_seed(settings.seed, number);
        let ego = change.map(|file| file.display().to_string());
        let training = TrainRequest {
            seed: Some(seed),
            decisions: Some(settings.decisions),
            ego: ego.as_deref(),
            ..TrainRequest::default()
        };
        // The consent of the command line holds for the changes that it makes.
        let allowed = self.ego.scenario().may_start_programs();
        let world = self.request.world.allow_programs(allowed);
        let mut session = TrainSession::begin(&world, &path, &training)?;
        if session.train(&watch.unnumbered())?.interrupted {
            return Ok(None);
        }
        let run = session.run();
        let manifest = run.manifest();
        let about = NewAdo {
            ado: name.clone(),
            decisions: manifest.decisions_done,
            failing: None,
            search: manifest.calibration.map(|it| [it.searched, it.starts]),
            recall: manifest.calibration.and_then(|it| it.recall()),
        };
        let policy = run.policy()?;
        let at = self.request.ados.trained.len();
        self.request.ados.trained.push(HardeningAdo {
            name: name.clone(),
            policy,
            seed,
        });
        self.runs.push(AdoRun {
            ado: name,
            run: path,
        });
        Ok(Some((at, about)))
    }

    /// Searches and trains until an ado that is trained anew finds nothing more, and then
    /// trains one for the other candidate.
    fn search(&mut self, watch: &Watch<'_>) -> Result<(), HardenError> {
        let settings = self.request.settings;
        watch.phase("drawing the starts of the search");
        let quiet = watch.quiet();
        let Some(starts) = self.search_starts(&quiet) else {
            return Ok(());
        };
        if starts.starts.is_empty() {
            return Err(HardenError::NoStarts);
        }
        let (world, traffic) = (self.request.world, self.request.traffic);
        let (losses, runs) = (self.request.losses.clone(), settings.runs);
        let seed = settings.seed;
        let driving = NaturalDriving::new(world, traffic, &losses, runs, seed, &quiet)?;
        let Some(driving) = driving else {
            return Ok(());
        };
        for round in 0..settings.rounds {
            watch.phase("searching for changes (egos)");
            let from = self.chosen.first().map(|it| it.candidate.values.clone());
            let Some(found) = self.round((round, from), &starts, &driving, watch) else {
                return Ok(());
            };
            // The candidates of the last round fail against the ado
            // that has joined since.
            self.chosen.clear();
            let Some((smallest, others)) = found.split_first() else {
                return Ok(());
            };
            // A candidate that fails already needs no ado that shows it.
            if !self.choose(smallest, watch)? || !smallest.is_feasible {
                return Ok(());
            }
            match self.withstands(&starts, &quiet) {
                None => return Ok(()),
                Some(Some(true)) => {
                    for other in others {
                        self.choose(other, watch)?;
                    }
                    return Ok(());
                }
                Some(None) => {
                    watch
                        .note("no start of the search has a result with the change that was found");
                    // Without its ado, the candidate stays unconfirmed.
                    self.chosen.iter_mut().for_each(|it| it.ado = None);
                    return Ok(());
                }
                Some(Some(false)) => {}
            }
            watch.note(&format!(
                "the ado that was trained against the change of round {} makes it fail again, \
                 and joins the others",
                round + 1
            ));
        }
        Ok(())
    }

    /// Writes a candidate and trains an ado against it. Returns whether it was not stopped.
    fn choose(&mut self, one: &SizedCandidate, watch: &Watch<'_>) -> Result<bool, HardenError> {
        let file = self.write(&one.candidate.values)?;
        // Stopped, a candidate is written, and stays unconfirmed.
        let ado = if one.is_feasible && !watch.stopped() {
            self.train(Some(&file), watch)?
        } else {
            None
        };
        let is_whole = ado.is_some() || !one.is_feasible;
        self.chosen.push(Chosen {
            candidate: one.candidate.clone(),
            file,
            size: one.size,
            is_feasible: one.is_feasible,
            ado,
        });
        Ok(is_whole)
    }

    /// Draws starts that no result reports, without those that are trivial. `None`: stopped.
    fn search_starts(&self, watch: &Watch<'_>) -> Option<TestStarts> {
        let settings = self.request.settings;
        let bench = self.request.world.bench();
        let draw = |index| {
            let key = StartKey {
                purpose: Purpose::Calibration,
                seed: settings.seed.wrapping_add(FIRST_SEALED),
                index,
            };
            (bench.draw(key), bench.noise_of(key))
        };
        let drawn = (0..settings.search_starts as u64).map(draw).collect();
        let tried = TestStarts::tried(self.request.world, settings.seed, drawn, watch)?;
        self.judged(tried, watch)
    }

    /// Returns starts without the trivial ones, which each ego may have of its own.
    pub(super) fn judged(&self, tried: TestStarts, watch: &Watch<'_>) -> Option<TestStarts> {
        let (own, _) = tried.for_ego(self.request.world, &self.ego, None, watch)?;
        // Only the number is unlimited: trivial starts are left out.
        Some(own.first(usize::MAX))
    }

    /// Plays a round of the search. `None`: stopped.
    ///
    /// It is empty if the ego as it is never fails.
    fn round(
        &mut self,
        begin: (usize, Option<Vec<f64>>),
        starts: &TestStarts,
        driving: &NaturalDriving<'_>,
        watch: &Watch<'_>,
    ) -> Option<Vec<SizedCandidate>> {
        let (round, from) = begin;
        let settings = self.request.settings;
        let trial = SearchRound {
            parameters: &self.request.parameters,
            ados: &self.request.ados,
            starts,
            driving,
            played: &self.played,
            watch: watch.quiet(),
        };
        let slices = slices(starts.starts.len(), settings.runs);
        let mut own = EgoMeasurement::default();
        for slice in &slices {
            // In the slices of the candidates, so that each stage compares
            // equal starts and runs.
            own.extend(trial.play(&self.request.parameters.own(), slice)?);
        }
        self.searched = StartCount::of(&own.outcomes);
        // An ego without failures leaves no reduction to measure.
        if own.failing() == 0 {
            return Some(Vec::new());
        }
        let conditions = Conditions {
            parameters: &self.request.parameters.list,
            losses: &self.request.losses,
            own: &own,
            remaining: 1.0 - settings.reduction,
        };
        let optimizer = Optimizer {
            conditions: &conditions,
            trial: &trial,
            slices,
            watch,
            seed: settings.seed,
            round,
            from,
        };
        let all = optimizer.search();
        let on_front = front(&conditions, &all);
        let point = |it: &EgoCandidate| FrontPoint {
            values: self.differing(&it.values),
            size: conditions.size(&it.values),
            failing: it.measured.failing(),
            loss: worst_loss(&conditions, &it.measured),
        };
        let points = on_front.iter().map(point).collect();
        let picked = picked(&conditions, &all, &on_front);
        self.front = points;
        Some(picked)
    }

    /// Returns whether the latest candidate withstands its own ado on the search's starts.
    ///
    /// The outer `None`: stopped. The inner one: no start has a result.
    fn withstands(&self, starts: &TestStarts, watch: &Watch<'_>) -> Option<Option<bool>> {
        let chosen = self.chosen.last()?;
        let (parameters, ados) = (&self.request.parameters, &self.request.ados);
        let ego = parameters.ego("candidate", &chosen.candidate.values).ok()?;
        let outcomes = StartCount::of(&ados.outcomes(&ego, starts, watch)?);
        let allowed = (1.0 - self.request.settings.reduction) * self.searched.share();
        Some(outcomes.is_at_most(allowed))
    }

    /// Writes the change of a candidate, and returns its file.
    fn write(&self, values: &[f64]) -> Result<PathBuf, HardenError> {
        // Numbered as the ado that is trained against it, whose run names the file.
        let number = self.runs.len();
        let file = self.request.dir.join(format!("hardened-{number}.ron"));
        let ego = self.request.parameters.ego("hardened", values)?;
        let about = format!(
            "`{}` of `{}`, hardened",
            self.ego.name(),
            self.request.world.name()
        );
        write_change(&file, &about, ego.change())?;
        Ok(file)
    }
}

/// Candidate with the size of its change.
struct SizedCandidate {
    candidate: EgoCandidate,
    size: f64,
    /// True if it meets the conditions of the search.
    is_feasible: bool,
}

/// Returns the candidates to confirm: the smallest that meets the conditions, and that of
/// the front with the fewest failures.
///
/// Without one that meets them, it is the latter alone.
fn picked(
    conditions: &Conditions<'_>,
    all: &[EgoCandidate],
    on_front: &[EgoCandidate],
) -> Vec<SizedCandidate> {
    let sized = |candidate: &EgoCandidate| SizedCandidate {
        candidate: candidate.clone(),
        size: conditions.size(&candidate.values),
        is_feasible: conditions.is_feasible(candidate),
    };
    let smallest = all.first().filter(|it| conditions.is_feasible(it));
    let by_failures = |a: &&EgoCandidate, b: &&EgoCandidate| {
        let failing = |it: &EgoCandidate| it.measured.failing();
        failing(a).cmp(&failing(b))
    };
    // The front is ordered by size, and the first of equal ones is the smallest.
    let safest = on_front.iter().min_by(by_failures);
    let mut picked: Vec<SizedCandidate> = Vec::new();
    for one in [smallest, safest].into_iter().flatten() {
        if picked.iter().all(|it| it.candidate.values != one.values) {
            picked.push(sized(one));
        }
    }
    picked
}
