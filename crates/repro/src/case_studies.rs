//! Driving case studies: every world with several training seeds in one table.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use brakecheck::adversary::Ado;
use brakecheck::experiment::{EgoUnderTest, Watch, test_starts};
use brakecheck::run_dir::RequestedTraining;
use brakecheck::run_dir::{Row, RunDir, RunError};
use brakecheck::search::{Adversary, BASELINES, Experiment, SWITCHES, Search};
use brakecheck::seed::Seeds;
use brakecheck::stats::{Outcomes, paired_difference, seeds_interval};
use brakecheck::training::TrainError;
use brakecheck::world::{Scenario, TrainingEgos};
use brakecheck_training::training::train_loop::train;

/// Largest number of joint actions for a search with two switches.
///
/// Above it the search uses one switch, as its row states.
const MAX_ACTIONS: usize = 9;

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
    let seeds: Vec<u64> = request.seeds.trainings().collect();
    // Trainings are independent, and `collect` keeps the order of the seeds.
    let runs: Vec<(PathBuf, f64)> = seeds
        .par_iter()
        .map(|&seed| trained_run(scenario, seed, request.runs, watch))
        .collect::<Result<_, _>>()?;
    if watch.stopped() {
        return Ok(None);
    }
    // All ados play the same starts, so differences can be paired.
    let Some(starts) = test_starts(scenario, request.seeds.starts, request.starts, watch) else {
        return Ok(None);
    };
    let ego = EgoUnderTest::nominal(scenario);
    let mut trained = Vec::new();
    for (path, _) in &runs {
        let run = RunDir::open(path)?;
        let policy = run.policy()?;
        let ado = Ado::Trained(&*policy, run.manifest().seed);
        trained.extend(ado.play(&ego, &starts, watch).map(|cell| Row {
            warning: run.warning(),
            ..cell.row
        }));
    }
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
    let (Some(held), Some(searched)) = (others.first(), others.last()) else {
        return Ok(None);
    };
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
    let trained = train(scenario, &mut run, watch)?;
    Ok((path, trained.done.cpu_s))
}

/// Explanation of the columns, below the table.
const EXPLAINED: &str = "
- starts (trivial): test starts; on as many besides, left out, the ego fails without an adversary
- trained: success: mean share of starts from which the trained ados make the ego fail
- recall: of the starts that search solves, the share an ado solves; median over trainings (least)
- fouls: share of starts on which a trained ado broke a rule first: no success
- search: share from which some sequence of actions with at most so many switches does
- random, held; random; best constant: what ados do that learned nothing
- training CPU s: processor time of a training, on average
";

/// Formats the studies as a Markdown table.
pub fn case_studies_markdown(studies: &[CaseStudy]) -> String {
    let percent = |rate: f64| format!("{:.1} %", 100.0 * rate);
    let lines = studies.iter().map(|study| {
        let baseline = |ado: &str| {
            let row = study.rows.iter().find(|row| row.ado == ado.into());
            row.map_or("–".to_owned(), |row| percent(row.success_rate))
        };
        let [lo, hi] = study.ci95.map(|rate| 100.0 * rate);
        [
            study.world.clone(),
            format!("{} ({})", study.starts, study.trivial),
            format!("{} [{lo:.1}, {hi:.1}]", percent(study.success_rate)),
            match (study.recall_median, study.recall_min) {
                (Some(median), Some(min)) => format!("{median:.3} ({min:.3})"),
                _ => "–".to_owned(),
            },
            percent(study.foul_rate),
            format!("{} ({})", baseline("search"), study.switches),
            baseline("hold"),
            baseline("random"),
            baseline("constant"),
            format!("{:.0}", study.train_cpu_s),
        ]
    });
    let columns = [
        "world",
        "starts (trivial)",
        "trained: success [95 %]",
        "recall, median (min)",
        "fouls",
        "search (most switches)",
        "random, held",
        "random",
        "best constant",
        "training CPU s",
    ];
    let mut text = brakecheck_report::report::table::TextTable::new(columns, lines).to_markdown();
    text.push_str(EXPLAINED);
    // Warnings follow the table, so a failed training cannot be overlooked.
    for row in studies.iter().flat_map(|study| &study.rows) {
        if let (Some(warning), Some(seed)) = (&row.warning, row.train_seed) {
            text.push_str(&format!(
                "- warning: {}, training {seed}: {}\n",
                row.world, warning.what
            ));
        }
    }
    text
}
