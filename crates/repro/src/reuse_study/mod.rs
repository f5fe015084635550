//! Reuse study: a trained ado against changed egos, the paper's central claim.
//!
//! Every training seed has three ados, which stay unchanged after training. One is trained
//! on the nominal ego, one on the family (wide), and one on the family with its parameters
//! (conditional). The parameters are identified from recorded runs.
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
use ado_rows::{EgoOnStarts, called};
use brakecheck::adversary::{Heuristic, tune_heuristic};
use brakecheck::evaluation::{Relation, ReusedOn, Summary, reused_on, summarise};
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch, test_starts};
use brakecheck::run_dir::{Row, RunDir, RunError};
use brakecheck::seed::Seeds;
use brakecheck::sysid::{Identified, IdentifyError, IdentifyRequest, RECORDED_RUNS, identify};
use brakecheck::training::TrainError;
use brakecheck::world::{EgoSample, Family, Scenario, TrainingEgos};

/// Budgets of held random search, the smaller of which are cut from the largest.
const HELD_BUDGETS: [u64; 3] = [10, 30, 100];

/// Difference from the nominal value that counts as none, as a share of the range.
const NEARLY: f64 = 0.005;

/// Returns the name in rows of held random search with a budget.
fn held_word(budget: u64) -> String {
    format!("search, held, {budget}")
}

/// Name in rows of the conditional ado with one simulation per start.
pub(crate) const CONDITIONAL: &str = "conditional";
/// Name in rows of the conditional ado with a few tries.
pub(crate) const CONDITIONAL_TRIES: &str = "conditional, tries";

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

/// Identification of an ego.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EgoIdentification {
    /// Name of the ego.
    pub ego: String,
    /// Identified member, in words.
    pub taken_for: String,
    /// Whether that member explains the recorded runs.
    pub explained: bool,
    /// Root mean square distance of that member from the recorded runs, m.
    pub residual_m: f64,
    /// Root mean square distance of the nominal ego, m.
    pub nominal_residual_m: f64,
    /// Simulated and recorded runs of the identification.
    pub simulations: u64,
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
    /// Identification of each ego.
    pub known: Vec<EgoIdentification>,
    /// Starts from which the conditional ado is cheaper than search.
    #[serde(rename = "economy")]
    pub costs: Vec<CostComparison>,
    /// Summary by block and over all changed egos, relative to the conditional ado.
    pub summary: Vec<Summary>,
    /// Same summary, relative to the conditional ado with a few tries.
    pub summary_of_tries: Vec<Summary>,
    /// All rows of the study.
    pub rows: Vec<Row>,
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
    /// An ego could not be identified.
    #[error("identifying `{ego}`: {source}")]
    Identify {
        /// Name of the ego.
        ego: String,
        /// Reason of the failure.
        source: IdentifyError,
    },
}

/// Ados of a training seed.
struct SeedPolicies {
    nominal: RunDir,
    wide: RunDir,
    conditional: RunDir,
}

/// Results of an ego of the study.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EgoResult {
    /// Summary of its rows.
    pub reused: ReusedOn,
    /// Rows of the ego, which the study lists beside the egos.
    pub rows: Vec<Row>,
    /// Identification of the ego.
    pub known: EgoIdentification,
}

/// Unfinished study: trained ados and the starts of every ego.
pub struct ReuseStudy<'a> {
    scenario: &'a Scenario,
    family: &'a Family,
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
        let Some(family) = scenario.family() else {
            return Err(ReuseError::NoFamily {
                world: scenario.name().to_owned(),
            });
        };
        let Some((trainings, train_cpu_s)) = trainings(scenario, &config, watch)? else {
            return Ok(None);
        };
        let starts = test_starts(scenario, config.seeds.starts, config.starts, watch);
        Ok(starts.map(|starts| ReuseStudy {
            scenario,
            family,
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
    /// Returns an error if the ego cannot be identified or a run directory is damaged.
    pub fn evaluate(
        &self,
        tested: &EgoUnderTest,
        watch: &Watch<'_>,
    ) -> Result<Option<EgoResult>, ReuseError> {
        let (ego, changed) = (tested.name(), tested.scenario());
        // All seeds train against the same family, so any run gives the relation.
        let conditional = &self.trainings[0].conditional;
        // The relation depends on the family that the conditional ado was trained on.
        let relation = tested.relation(conditional, &conditional.scenario()?);
        let Some(identified) = self.identified((ego, changed), &[], watch)? else {
            return Ok(None);
        };
        let known = EgoIdentification {
            ego: ego.to_owned(),
            taken_for: self.family.in_words(&identified.member),
            explained: identified.explains(),
            residual_m: identified.residual_m,
            nominal_residual_m: identified.nominal_residual_m,
            simulations: identified.simulations + identified.recorded,
        };
        let on_starts = EgoOnStarts {
            ego: tested,
            starts: &self.starts,
            watch,
        };
        let (member, context) = identified.context(self.family);
        let mut rows = Vec::new();
        for policies in &self.trainings {
            rows.extend(on_starts.ados(
                policies,
                self.family,
                (&member, context),
                self.config.tries,
            )?);
        }
        // Only an ego of the family has parameters that identification can miss.
        if relation == Relation::Inside {
            let Some(left_out) = self.left_out(&on_starts, &identified.member, &rows)? else {
                return Ok(None);
            };
            rows.extend(left_out);
        }
        // The rule is tuned on the nominal ego once and reused for every ego.
        let heuristic = match self.heuristic.get() {
            Some(tuned) => tuned,
            None => {
                let tuned = tune_heuristic(self.scenario, self.config.seeds.first, watch);
                if watch.stopped() {
                    return Ok(None);
                }
                self.heuristic.get_or_init(|| tuned)
            }
        };
        rows.extend(on_starts.rivals(
            &self.trainings[0].nominal,
            heuristic.as_ref(),
            self.config.tries,
        )?);
        // The search is the last row, and all other rows are compared with it.
        Row::compare_with_last(&mut rows);
        let reused = reused_on(tested, relation, &self.starts, rows.clone(), watch);
        Ok((!watch.stopped()).then_some(EgoResult {
            reused,
            rows,
            known,
        }))
    }

    /// Identifies an ego while the quantities in `fixed` stay nominal.
    fn identified(
        &self,
        (ego, changed): (&str, &Scenario),
        fixed: &[String],
        watch: &Watch<'_>,
    ) -> Result<Option<Identified>, ReuseError> {
        // The study has no limit on recorded runs and reports their number. The fixed seed
        // keeps the recorded runs the same for every training seed.
        let request =
            IdentifyRequest::new(self.scenario, changed, RECORDED_RUNS as usize).fixed(fixed);
        identify(&request, watch).map_err(|source| ReuseError::Identify {
            ego: ego.to_owned(),
            source,
        })
    }

    /// Plays the conditional ados with one quantity left out of the identification.
    ///
    /// Each quantity is left out in turn. The ados are conditioned on the nearest member, even
    /// if it is distant, because the ego belongs to the family.
    /// If the quantity is nominal, leaving it out changes nothing, so the rows are those
    /// of the ado with all quantities.
    fn left_out(
        &self,
        on_starts: &EgoOnStarts<'_>,
        known: &EgoSample,
        rows_of_all: &[Row],
    ) -> Result<Option<Vec<Row>>, ReuseError> {
        let mut rows = Vec::new();
        for (quantity, value) in self.family.quantities.iter().zip(&known.values) {
            let name = quantity.varied.name();
            let ado = format!("{CONDITIONAL}, without {name}");
            let nominal = (value - quantity.nominal).abs() <= NEARLY * (quantity.hi - quantity.lo);
            if nominal {
                let conditional = rows_of_all
                    .iter()
                    .filter(|row| row.ado == CONDITIONAL.into());
                rows.extend(conditional.map(|row| called(&ado, row.clone())));
                continue;
            }
            let ego = (on_starts.ego.name(), on_starts.ego.scenario());
            let member = match self.identified(ego, &[name.to_owned()], on_starts.watch) {
                Ok(Some(identified)) => identified.member,
                Ok(None) => return Ok(None),
                // The left-out quantity was the only quantity.
                Err(ReuseError::Identify {
                    source: IdentifyError::NothingToFit,
                    ..
                }) => self.family.nominal(known.plant),
                Err(error) => return Err(error),
            };
            for policies in &self.trainings {
                rows.push(on_starts.conditional(&ado, policies, (&member, "identified"))?);
            }
        }
        Ok(Some(rows))
    }

    /// Concludes the study from the egos' results, the nominal ego first.
    pub fn conclude(&self, results: Vec<EgoResult>) -> ReuseReport {
        let known: Vec<EgoIdentification> =
            results.iter().map(|result| result.known.clone()).collect();
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
            .map(|policies| policies.conditional.manifest());
        let training = trainings.map(|run| run.episodes as f64).sum::<f64>();
        // The comparison counts the mean training, because each seed is a training.
        let training = training / self.trainings.len().max(1) as f64;
        ReuseReport {
            world: self.scenario.name().to_owned(),
            starts: first.map_or(0, |row| row.starts),
            trivial: first.map_or(0, |row| row.trivial),
            seeds: self.config.seeds.count,
            train_cpu_s: self.train_cpu_s.clone(),
            costs: cost_comparison::compare_costs(training, &egos, &known),
            summary: summarise(&egos, &CONDITIONAL.into()),
            summary_of_tries: summarise(&egos, &CONDITIONAL_TRIES.into()),
            rows: egos.iter().flat_map(|ego| ego.rows.clone()).collect(),
            egos,
            known,
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
    let kinds = [
        TrainingEgos::Nominal,
        TrainingEgos::Randomized,
        TrainingEgos::Conditioned,
    ];
    let jobs: Vec<(TrainingEgos, u64)> = kinds
        .into_iter()
        .flat_map(|against| request.seeds.trainings().map(move |seed| (against, seed)))
        .collect();
    let runs: Vec<(PathBuf, f64)> = jobs
        .par_iter()
        .map(|&(against, seed)| {
            let trained = scenario.training_against(against);
            // The nominal training uses the world as it is.
            let trained = trained.as_ref().unwrap_or(scenario);
            trained_run(trained, seed, request.runs, watch)
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
        .zip(open(TrainingEgos::Conditioned))
        .map(|((nominal, wide), conditional)| {
            Ok(SeedPolicies {
                nominal: nominal?,
                wide: wide?,
                conditional: conditional?,
            })
        })
        .collect::<Result<_, RunError>>()?;
    Ok(Some((trainings, cpu_s.to_vec())))
}
