//! Driving case studies: every world with several training seeds in one table.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use brakecheck::adversary::Ado;
use brakecheck::ego::ReferenceDriver;
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch, test_starts};
use brakecheck::run_dir::{ClosingSpeed, RequestedTraining, Row, RunDir, RunError};
use brakecheck::search::{Adversary, BASELINES, Experiment, ExperimentCell, SWITCHES, Search};
use brakecheck::seed::Seeds;
use brakecheck::stats::{Outcomes, paired_difference, seeds_interval};
use brakecheck::training::TrainError;
use brakecheck::world::{Scenario, TrainingEgos};

use brakecheck_experiment::experiment::episode_loop::EpisodeLoop;
use brakecheck_training::training::train_loop::train;

/// Largest number of joint actions for a search with two switches.
///
/// Above it the search uses one switch, as its row states.
const MAX_ACTIONS: usize = 6;
/// Competent driver of UN R157 that observes the next lane and keeps braking.
const COMPETENT: ReferenceDriver = ReferenceDriver::CcLatched;
/// Switches of the deeper search.
const DEEPER: usize = 3;
/// Largest number of joint actions for it.
const DEEPER_ACTIONS: usize = 3;
/// Number of starts of it.
const DEEPER_STARTS: usize = 30;

/// Request of the case studies.
pub struct CaseStudies<'a> {
    /// Training seeds, and the stream of the test starts.
    pub seeds: Seeds,
    /// Number of test starts.
    pub starts: usize,
    /// Directory of the run directories.
    pub runs: &'a Path,
}

/// Results of a world.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CaseStudy {
    /// Name of the world.
    pub world: String,
    /// Number of evaluated starts.
    pub starts: usize,
    /// Starts left out, because the ego fails without an adversary.
    pub trivial: usize,
    /// Number of training seeds.
    pub seeds: usize,
    /// Mean success rate of the trained ados.
    pub success_rate: f64,
    /// Interval of the rate over trainings and starts (docs/background/intervals.md).
    pub ci95: [f64; 2],
    /// Median over seeds of the recall.
    pub recall_median: Option<f64>,
    /// Recall of the worst seed.
    pub recall_min: Option<f64>,
    /// Largest number of switches of the search that recall refers to.
    pub switches: usize,
    /// Mean share of starts on which a rule was broken.
    pub foul_rate: f64,
    /// Success of trained minus held random ados, with its interval.
    pub over_held: (f64, [f64; 2]),
    /// Success of trained ados minus the best constant, with its interval.
    pub over_constant: (f64, [f64; 2]),
    /// Mean processor time of a training, s.
    pub train_cpu_s: f64,
    /// Rows behind the results: trained ados by seed, then baselines and search.
    pub rows: Vec<Row>,
}

/// Trains and evaluates a world. Existing runs are used as they are.
///
/// Returns `None` if stopped from outside. Finished trainings are kept.
///
/// # Errors
/// Returns an error if a training fails or a file cannot be written.
pub fn case_study(
    scenario: &Scenario,
    request: &CaseStudies<'_>,
    watch: &Watch<'_>,
) -> Result<Option<CaseStudy>, TrainError> {
    let Some(runs) = finished_runs(scenario, request, watch)? else {
        return Ok(None);
    };
    // All ados play the same starts, so differences can be paired.
    let Some(starts) = test_starts(scenario, request.seeds.starts, request.starts, watch) else {
        return Ok(None);
    };
    let ego = EgoUnderTest::nominal(scenario);
    let played = cells(&runs, &ego, &starts, watch)?;
    let mut trained: Vec<Row> = played.into_iter().map(|cell| cell.row).collect();
    // Each switch multiplies the number of sequences by actions and decisions.
    let switches = match scenario.world().spaces().actions {
        // Two switches define the reachable starts wherever they can be searched.
        ..=MAX_ACTIONS => SWITCHES,
        _ => 1,
    };
    let search: &dyn Adversary = &Search::switches(switches);
    let experiment = Experiment {
        ego: &ego,
        adversaries: BASELINES.into_iter().chain([search]).collect(),
        starts: &starts,
    };
    let others = experiment.rows(watch);
    // `BASELINES` begins with held random actions, and the search was added last.
    let (Some(held), Some(searched)) = (others.first(), others.last()) else {
        return Ok(None);
    };
    // A stop leaves rows of some starts, whose rates would look like results.
    if watch.stopped() {
        return Ok(None);
    }
    for row in &mut trained {
        row.compare_with_search(&searched.solved);
    }
    let mean = |of: fn(&Row) -> f64| trained.iter().map(of).sum::<f64>() / trained.len() as f64;
    let mut recalls: Vec<f64> = trained.iter().filter_map(|row| row.recall).collect();
    // A recall is missing if the search solves no start.
    recalls.sort_by(f64::total_cmp);
    let study = CaseStudy {
        world: scenario.name().to_owned(),
        starts: held.starts,
        trivial: held.trivial,
        seeds: trained.len(),
        success_rate: mean(|row| row.success_rate),
        // Intervals are computed below, from the finished rows.
        ci95: [0.0, 1.0],
        // The upper one of two in the middle, so that it belongs to a training.
        recall_median: recalls.get(recalls.len() / 2).copied(),
        recall_min: recalls.first().copied(),
        switches,
        foul_rate: mean(|row| row.foul_rate),
        over_held: (0.0, [-1.0, 1.0]),
        over_constant: (0.0, [-1.0, 1.0]),
        train_cpu_s: runs.iter().map(|(_, cpu_s)| cpu_s).sum::<f64>() / runs.len() as f64,
        rows: Vec::new(),
    };
    let mut rows = trained;
    rows.extend(others);
    Ok(Some(CaseStudy { rows, ..study }.with_intervals()))
}

impl CaseStudy {
    /// Returns the processor time of all trainings and rows, also of kept runs.
    pub fn cpu_s(&self) -> f64 {
        let rows: f64 = self.rows.iter().map(|row| row.cpu_s).sum();
        rows + self.train_cpu_s * self.seeds as f64
    }

    /// Computes the intervals again from the rows.
    ///
    /// A stored study may hold those of an earlier version.
    pub fn with_intervals(mut self) -> CaseStudy {
        let of = |ado: &str| -> Vec<&Outcomes> {
            let rows = self.rows.iter().filter(|row| row.ado == ado.into());
            rows.map(|row| &row.solved).collect()
        };
        let trained = of("trained");
        let ci95 = seeds_interval(&trained);
        let over_held = paired_difference(&trained, &of("hold"));
        let over_constant = paired_difference(&trained, &of("constant"));
        (self.ci95, self.over_held, self.over_constant) = (ci95, over_held, over_constant);
        self
    }
}

/// Plays the trained ados of some runs.
fn cells(
    runs: &[(PathBuf, f64)],
    ego: &EgoUnderTest,
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Result<Vec<ExperimentCell>, TrainError> {
    let mut cells = Vec::new();
    for (path, _) in runs {
        let run = RunDir::open(path)?;
        let policy = run.policy()?;
        let ado = Ado::Trained(&*policy, run.manifest().seed);
        cells.extend(ado.play(ego, starts, watch).map(|mut cell| {
            cell.row.warning = run.warning();
            cell
        }));
    }
    Ok(cells)
}

/// Returns finished runs of all trainings. `None`: stopped.
fn finished_runs(
    scenario: &Scenario,
    request: &CaseStudies<'_>,
    watch: &Watch<'_>,
) -> Result<Option<Vec<(PathBuf, f64)>>, TrainError> {
    let seeds: Vec<u64> = request.seeds.trainings().collect();
    // Trainings are independent, and `collect` keeps the order of the seeds.
    let runs = seeds
        .par_iter()
        .map(|&seed| trained_run(scenario, seed, request.runs, watch))
        .collect::<Result<_, _>>()?;
    // A stopped training returns as well, but without a policy to play.
    Ok((!watch.stopped()).then_some(runs))
}

/// Contacts that end successes of trained ados.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TrainedContacts {
    /// Successes of all trainings.
    pub successes: usize,
    /// Successes that end in a contact.
    pub contacts: usize,
    /// Closing speeds of those contacts.
    pub closing_mps: Option<ClosingSpeed>,
    /// Contacts to which the competent driver applies.
    pub judged: usize,
    /// Contacts that the competent driver avoids in the ego's place.
    pub avoided: usize,
}

/// Plays the successes of trained ados again, and puts CC_LATCHED into the ego's place.
///
/// The others move as recorded. `None`: stopped.
///
/// # Errors
/// Returns an error if a training fails or a file cannot be read.
pub fn trained_contacts(
    scenario: &Scenario,
    request: &CaseStudies<'_>,
    watch: &Watch<'_>,
) -> Result<Option<TrainedContacts>, TrainError> {
    let Some(runs) = finished_runs(scenario, request, watch)? else {
        return Ok(None);
    };
    let Some(starts) = test_starts(scenario, request.seeds.starts, request.starts, watch) else {
        return Ok(None);
    };
    let ego = EgoUnderTest::nominal(scenario);
    let (mut successes, mut closing, mut answers) = (0, Vec::new(), Vec::new());
    for cell in cells(&runs, &ego, &starts, watch)? {
        let solved = cell.solved();
        successes += solved.len();
        let all = EpisodeLoop::uncounted(watch);
        let bench = || scenario.bench();
        let looked = all.each(&solved, bench, |bench, start, _| {
            let episode = cell.replay(bench, *start);
            // A success without a contact is no crash, so no driver can avoid it.
            let closing = episode.contact.as_ref()?.closing_speed_mps;
            Some((closing, scenario.is_avoided_by_any(&episode, &[COMPETENT])))
        });
        for (speed, avoided) in looked.into_iter().flatten() {
            closing.push(speed);
            // A contact to which the driver does not apply is in neither number.
            answers.extend(avoided);
        }
    }
    Ok((!watch.stopped()).then(|| TrainedContacts {
        successes,
        contacts: closing.len(),
        closing_mps: ClosingSpeed::of(closing),
        judged: answers.len(),
        avoided: answers.iter().filter(|avoided| **avoided).count(),
    }))
}

/// Search with more switches, on fewer starts.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DeeperSearch {
    /// Largest number of switches. `None`: the world has too many actions.
    pub switches: Option<usize>,
    /// Number of starts that are not trivial.
    pub starts: usize,
    /// Starts that it solves.
    pub solved: usize,
    /// Median over trainings of the recall.
    pub recall_median: Option<f64>,
}

/// Compares trained ados with a search of three switches. `None`: stopped.
///
/// # Errors
/// Returns an error if a training fails or a file cannot be read.
pub fn deeper_search(
    scenario: &Scenario,
    request: &CaseStudies<'_>,
    watch: &Watch<'_>,
) -> Result<Option<DeeperSearch>, TrainError> {
    let mut deeper = DeeperSearch {
        switches: None,
        starts: 0,
        solved: 0,
        recall_median: None,
    };
    // Before the trainings, because this answer needs none.
    if scenario.world().spaces().actions > DEEPER_ACTIONS {
        return Ok(Some(deeper));
    }
    let Some(runs) = finished_runs(scenario, request, watch)? else {
        return Ok(None);
    };
    // Three switches multiply the sequences, so fewer starts are searched.
    let count = request.starts.min(DEEPER_STARTS);
    let Some(starts) = test_starts(scenario, request.seeds.starts, count, watch) else {
        return Ok(None);
    };
    let ego = EgoUnderTest::nominal(scenario);
    let Some(searched) = Search::switches(DEEPER).play(&ego, &starts, watch) else {
        return Ok(None);
    };
    let mut recalls = Vec::new();
    for mut cell in cells(&runs, &ego, &starts, watch)? {
        cell.row.compare_with_search(&searched.row.solved);
        recalls.extend(cell.row.recall);
    }
    recalls.sort_by(f64::total_cmp);
    deeper.switches = Some(DEEPER);
    deeper.starts = searched.row.starts;
    deeper.solved = searched.row.successes;
    // As in `case_study`, the upper one of two in the middle.
    deeper.recall_median = recalls.get(recalls.len() / 2).copied();
    Ok((!watch.stopped()).then_some(deeper))
}

/// Row of a world on the page.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WorldResult {
    /// Name of the world.
    pub world: String,
    /// Number of evaluated starts.
    pub starts: usize,
    /// Starts left out, because the ego fails without an adversary.
    pub trivial: usize,
    /// Number of trainings.
    pub trainings: usize,
    /// Mean success rate of the trained ados, with its interval.
    pub success: (f64, [f64; 2]),
    /// Contacts of their successes.
    pub contacts: TrainedContacts,
    /// Mean share of starts on which a rule was broken.
    pub fouls: f64,
    /// Recall: median and minimum over trainings.
    pub recall: Option<[f64; 2]>,
    /// Success of the search, with its largest number of switches.
    pub search: (f64, usize),
    /// Search with more switches.
    pub deeper: DeeperSearch,
    /// Success of held random, random and the best constant actions.
    pub baselines: [f64; 3],
    /// Mean processor time of a training, s.
    pub train_cpu_s: f64,
    /// Trainings that ended with a warning.
    pub warned: usize,
}

impl WorldResult {
    /// Collects the row of a world from its pieces.
    pub fn of(study: &CaseStudy, contacts: &TrainedContacts, deeper: DeeperSearch) -> WorldResult {
        let rate = |ado: &str| {
            let row = study.rows.iter().find(|row| row.ado == ado.into());
            row.map_or(0.0, |row| row.success_rate)
        };
        WorldResult {
            world: study.world.clone(),
            starts: study.starts,
            trivial: study.trivial,
            trainings: study.seeds,
            success: (study.success_rate, study.ci95),
            contacts: contacts.clone(),
            fouls: study.foul_rate,
            recall: study
                .recall_median
                .zip(study.recall_min)
                .map(<[f64; 2]>::from),
            search: (rate("search"), study.switches),
            deeper,
            baselines: [rate("hold"), rate("random"), rate("constant")],
            train_cpu_s: study.train_cpu_s,
            warned: study
                .rows
                .iter()
                .filter(|row| row.warning.is_some())
                .count(),
        }
    }
}

/// Trains the run of a seed, as far as it does not exist yet.
///
/// # Errors
/// Returns an error if training fails, if a file cannot be written, or if a run of another
/// world, plant or length has the same name.
pub fn trained_run(
    scenario: &Scenario,
    seed: u64,
    runs: &Path,
    watch: &Watch<'_>,
) -> Result<(PathBuf, f64), TrainError> {
    let path = runs.join(match scenario.against() {
        // Runs against a family have names of their own, so both kinds can coexist.
        TrainingEgos::Nominal => format!("{}-{seed}", scenario.name()),
        family => format!("{}-{family}-{seed}", scenario.name()),
    });
    let mut run = match RunDir::resume(&path) {
        Ok(run) => run,
        // Other errors are reported, because a damaged run must not be overwritten.
        Err(RunError::NotARun { .. }) => RunDir::create(&path, scenario, seed)?,
        Err(error) => return Err(error.into()),
    };
    // A run with other settings must not be continued or reported under this name.
    run.must_be_of(RequestedTraining {
        scenario,
        seed,
        ego: None,
    })?;
    // A finished run is returned as it is, so kept runs cost no training.
    let trained = train(scenario, &mut run, watch)?;
    Ok((path, trained.done.cpu_s))
}
