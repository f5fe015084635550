//! Reuse study: a trained ado against changed egos, the paper's central claim.
//!
//! Every training seed has two ados, which stay unchanged after training. One is trained
//! on the nominal ego, and one on the family (wide).
//! Baselines on the same starts are the counterexamples of a falsifier from the same
//! training, a tuned rule, random ados, and searches per start.

mod ado_rows;
mod cost_comparison;
mod text;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub(crate) use cost_comparison::CostComparison;
pub use text::reuse_markdown;

use super::case_studies::trained_run;
use ado_rows::EgoOnStarts;
use brakecheck::adversary::{Heuristic, tune_heuristic};
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch, test_starts};
use brakecheck::run_dir::{Row, RunDir, RunError};
use brakecheck::seed::Seeds;
use brakecheck::training::TrainError;
use brakecheck::world::{Scenario, TrainingEgos};
use brakecheck_evaluation::evaluation::reuse::{Relation, ReusedOn, Summary, reused_on, summarise};

/// Budgets of held random search, the smaller of which are cut from the largest.
const HELD_BUDGETS: [u64; 3] = [10, 30, 100];

/// Returns the name in rows of held random search with a budget.
fn held_word(budget: u64) -> String {
    format!("search, held, {budget}")
}

/// Name in rows of the wide ado with one simulation per start.
pub(crate) const WIDE: &str = "wide";
/// Name in rows of the wide ado with a few tries.
pub(crate) const WIDE_TRIES: &str = "wide, tries";

/// Request of the study.
#[derive(Clone, Copy)]
pub struct ReuseStudyConfig<'a> {
    /// Training seeds, and the stream of the test starts.
    pub seeds: Seeds,
    /// Number of test starts.
    pub starts: usize,
    /// Runs per start of the exploring ado, including the greedy run.
    pub tries: u64,
    /// Directory of the run directories.
    pub runs: &'a Path,
}

/// Results of the study.
#[derive(Clone, Debug, Serialize)]
pub struct ReuseReport {
    /// Name of the world.
    pub world: String,
    /// Number of evaluated starts.
    pub starts: usize,
    /// Starts left out, because the nominal ego fails without an adversary.
    pub trivial: usize,
    /// Number of training seeds.
    pub seeds: u64,
    /// Mean processor time of a training by ado, s.
    pub train_cpu_s: Vec<(&'static str, f64)>,
    /// Results by ego, the nominal ego first.
    pub egos: Vec<ReusedOn>,
    /// Starts from which the wide ado is cheaper than search.
    #[serde(rename = "economy")]
    pub costs: Vec<CostComparison>,
    /// Summary by block and over all changed egos, relative to the wide ado.
    pub summary: Vec<Summary>,
    /// Same summary, relative to the wide ado with a few tries.
    pub summary_of_tries: Vec<Summary>,
    /// All rows of the study.
    pub rows: Vec<Row>,
}

/// Means of the study on the page.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ReuseBlocks {
    /// Name of the world.
    pub world: String,
    /// Number of evaluated starts.
    pub starts: usize,
    /// Number of training seeds.
    pub seeds: u64,
    /// Egos inside the family, and outside, of which search solves enough.
    pub egos: [usize; 2],
    /// Mean processor time of a training by ado, s.
    pub train_cpu_s: Vec<(String, f64)>,
    /// Every ado, in the order of the rows.
    pub ados: Vec<ReusedAdo>,
    /// Starts per ego from which the wide ado is cheaper than held search on all egos.
    pub cheaper_from: Option<f64>,
}

/// Mean recall of an ado.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ReusedAdo {
    /// Name of the ado.
    pub ado: String,
    /// Mean recall inside the family, and outside.
    pub recall: [Option<f64>; 2],
    /// Least recall inside the family, with the ego, and outside.
    pub least: [Option<(f64, String)>; 2],
    /// Mean simulations per start over all changed egos.
    pub sims_per_start: f64,
}

impl ReuseReport {
    /// Returns the means inside the family and outside, ado by ado.
    pub fn blocks(&self) -> ReuseBlocks {
        let block = |relation: Relation| {
            let all = self.summary.iter();
            all.filter(move |sum| sum.relation == relation)
        };
        let blocks = [Relation::Inside, Relation::Outside];
        // With a single relation, its block has all changed egos.
        let [inside, outside] = blocks;
        let mut relations = [Relation::Changed, inside, outside].into_iter();
        let whole = relations.find(|relation| block(*relation).next().is_some());
        let ados = block(whole.unwrap_or(Relation::Changed)).map(|changed| {
            let of = |relation: Relation| block(relation).find(|sum| sum.ado == changed.ado);
            ReusedAdo {
                ado: changed.ado.to_string(),
                recall: blocks.map(|it| of(it)?.recall_mean),
                least: blocks.map(|it| of(it)?.recall_min.clone()),
                sims_per_start: changed.sims_per_start,
            }
        });
        ReuseBlocks {
            world: self.world.clone(),
            starts: self.starts,
            seeds: self.seeds,
            // Whether search solves enough depends on the ego alone, so any ado has this
            // number.
            egos: blocks.map(|it| block(it).next().map_or(0, |sum| sum.egos_with_recall)),
            train_cpu_s: self
                .train_cpu_s
                .iter()
                .map(|(ado, cpu_s)| ((*ado).to_owned(), *cpu_s))
                .collect(),
            ados: ados.collect(),
            // With several egos the line of all of them is the last one.
            cheaper_from: self.costs.last().and_then(|all| all.starts),
        }
    }
}

/// Error of the study.
#[derive(Debug, thiserror::Error)]
pub enum ReuseError {
    /// The world has no family.
    #[error("`{world}` names no family of egos")]
    NoFamily {
        /// Name of the world.
        world: String,
    },
    /// A training or its run directory failed.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A run directory failed.
    #[error(transparent)]
    Run(#[from] RunError),
}

/// Ados of a training seed.
struct SeedPolicies {
    nominal: RunDir,
    wide: RunDir,
}

/// Results of an ego of the study.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EgoResult {
    /// Summary of its rows.
    pub reused: ReusedOn,
    /// Rows of the ego, which the study lists beside the egos.
    pub rows: Vec<Row>,
}

/// Unfinished study: trained ados and the starts of every ego.
pub struct ReuseStudy<'a> {
    scenario: &'a Scenario,
    config: ReuseStudyConfig<'a>,
    trainings: Vec<SeedPolicies>,
    train_cpu_s: CpuByAdo,
    starts: TestStarts,
    heuristic: OnceLock<Option<Heuristic>>,
}

impl<'a> ReuseStudy<'a> {
    /// Trains the ados of a world, or uses finished trainings. `None`: stopped.
    ///
    /// # Errors
    /// Returns an error without a family, if a training fails, or if a file cannot be written.
    pub fn begin(
        scenario: &'a Scenario,
        config: ReuseStudyConfig<'a>,
        watch: &Watch<'_>,
    ) -> Result<Option<ReuseStudy<'a>>, ReuseError> {
        if scenario.family().is_none() {
            return Err(ReuseError::NoFamily {
                world: scenario.name().to_owned(),
            });
        }
        let Some((trainings, train_cpu_s)) = trainings(scenario, &config, watch)? else {
            return Ok(None);
        };
        let starts = test_starts(scenario, config.seeds.starts, config.starts, watch);
        Ok(starts.map(|starts| ReuseStudy {
            scenario,
            config,
            trainings,
            train_cpu_s,
            starts,
            heuristic: OnceLock::new(),
        }))
    }

    /// Plays all ados against an ego. `None`: stopped.
    ///
    /// # Errors
    /// Returns an error if a run directory is damaged.
    pub fn evaluate(
        &self,
        tested: &EgoUnderTest,
        watch: &Watch<'_>,
    ) -> Result<Option<EgoResult>, ReuseError> {
        // All seeds train against the same family, so any run gives the relation.
        let wide = &self.trainings[0].wide;
        // The relation depends on the family that the wide ado was trained on.
        let relation = Relation::of(tested, wide, &wide.scenario()?);
        let on_starts = EgoOnStarts {
            ego: tested,
            starts: &self.starts,
            watch,
        };
        let mut rows = Vec::new();
        for policies in &self.trainings {
            rows.extend(on_starts.ados(policies, self.config.tries)?);
        }
        // The rule is tuned on the nominal ego once and reused for every ego.
        let heuristic = match self.heuristic.get() {
            Some(tuned) => tuned,
            None => {
                let tuned = tune_heuristic(self.scenario, self.config.seeds.first, watch);
                // A stopped tuning gives no rule, and `None` would be kept for all
                // further egos.
                if watch.stopped() {
                    return Ok(None);
                }
                self.heuristic.get_or_init(|| tuned)
            }
        };
        // These need no training but the counterexamples of one, so the first run serves
        // all.
        rows.extend(on_starts.rivals(
            &self.trainings[0].nominal,
            heuristic.as_ref(),
            self.config.tries,
        )?);
        // The search is the last row, and all other rows are compared with it.
        Row::compare_with_last(&mut rows);
        let mut reused = reused_on(tested, relation, &self.starts, rows, watch);
        // Their starts on which the ego fails alone are known only now.
        let rows = std::mem::take(&mut reused.rows);
        Ok((!watch.stopped()).then_some(EgoResult { reused, rows }))
    }

    /// Concludes the study from the egos' results, the nominal ego first.
    pub fn conclude(&self, results: Vec<EgoResult>) -> ReuseReport {
        // A result is stored without the rows inside, and they are put back here.
        let egos: Vec<ReusedOn> = results
            .into_iter()
            .map(|result| ReusedOn {
                rows: result.rows,
                ..result.reused
            })
            .collect();
        let first = egos.first().and_then(|ego| ego.rows.first());
        // An episode of the training is a simulation of the ego.
        let trainings = self
            .trainings
            .iter()
            .map(|policies| policies.wide.manifest());
        let episodes = trainings.map(|run| run.episodes as f64).sum::<f64>();
        // The comparison counts the mean training, because each seed is a training.
        let training = episodes / self.trainings.len().max(1) as f64;
        ReuseReport {
            world: self.scenario.name().to_owned(),
            starts: first.map_or(0, |row| row.starts),
            trivial: first.map_or(0, |row| row.trivial),
            seeds: self.config.seeds.count,
            train_cpu_s: self.train_cpu_s.clone(),
            costs: cost_comparison::compare_costs(training, &egos),
            summary: summarise(&egos, &WIDE.into()),
            summary_of_tries: summarise(&egos, &WIDE_TRIES.into()),
            rows: egos.iter().flat_map(|ego| ego.rows.clone()).collect(),
            egos,
        }
    }
}

type CpuByAdo = Vec<(&'static str, f64)>;

/// Trains the ados in parallel, as far as they are not trained yet.
fn trainings(
    scenario: &Scenario,
    request: &ReuseStudyConfig<'_>,
    watch: &Watch<'_>,
) -> Result<Option<(Vec<SeedPolicies>, CpuByAdo)>, ReuseError> {
    // All trainings form one parallel loop, so no thread waits for a kind to finish.
    let kinds = [TrainingEgos::Nominal, TrainingEgos::Randomized];
    let jobs: Vec<(TrainingEgos, u64)> = kinds
        .into_iter()
        .flat_map(|against| request.seeds.trainings().map(move |seed| (against, seed)))
        .collect();
    let runs: Vec<(PathBuf, f64)> = jobs
        .par_iter()
        .map(|&(against, seed)| {
            let changed = scenario.training_against(against);
            // The nominal training uses the world as it is.
            let world = changed.as_ref().unwrap_or(scenario);
            trained_run(world, seed, request.runs, watch)
        })
        .collect::<Result<_, _>>()?;
    if watch.stopped() {
        return Ok(None);
    }
    let of = |against: TrainingEgos| {
        let all = jobs.iter().zip(&runs);
        all.filter(move |((kind, _), _)| *kind == against)
            .map(|(_, run)| run)
    };
    let cpu_s = kinds.map(|kind| {
        let sum: f64 = of(kind).map(|(_, cpu_s)| cpu_s).sum();
        (kind.word(), sum / request.seeds.count.max(1) as f64)
    });
    let open = |against: TrainingEgos| of(against).map(|(path, _)| RunDir::open(path));
    // Runs of all kinds are ordered by seed, so they can be zipped.
    let trainings = open(TrainingEgos::Nominal)
        .zip(open(TrainingEgos::Randomized))
        .map(|(nominal, wide)| {
            Ok(SeedPolicies {
                nominal: nominal?,
                wide: wide?,
            })
        })
        .collect::<Result<_, RunError>>()?;
    Ok(Some((trainings, cpu_s.to_vec())))
}
