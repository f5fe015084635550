//! The paper's central claim, measured: one trained ado on changed egos.
//!
//! Three ados per training seed, untouched after training: trained on the
//! nominal ego, trained on the family without being told (wide), and told the
//! parameters that were identified from recorded runs (conditional). Beside
//! them on the same starts: what a falsifier would have kept from the same
//! training, a tuned rule, random ados, and searches per start.

mod economy;
mod players;
mod text;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use economy::Economy;
pub use text::reuse_markdown;

use super::case_studies::trained_run;
use crate::adversary::{Heuristic, tune_heuristic};
use crate::evaluation::{Relation, ReusedOn, Summary, reused_on, summarise};
use crate::experiment::{EgoUnderTest, TestStarts, Watch, test_starts};
use crate::run_dir::{Row, RunDir, RunError};
use crate::seed::Seeds;
use crate::sysid::{
    AdaptRequest, Adapted, ENOUGH_SIMULATIONS, Identified, IdentifyError, IdentifyRequest,
    RECORDED_RUNS, adapt, identify,
};
use crate::training::TrainError;
use crate::world::{Against, Family, Member, Scenario};
use players::{Player, called};

/// Simulations per start of held-random search; the smaller ones are cut from it.
const HELD_BUDGETS: [u64; 3] = [10, 30, 100];

/// A quantity that is identified within this share of its range from its
/// nominal value is nominal.
const NEARLY: f64 = 0.005;

/// The word in rows of held-random search with a budget.
fn held_word(budget: u64) -> String {
    format!("search, held, {budget}")
}

/// The conditional ado, one simulation per start.
pub const CONDITIONAL: &str = "conditional";
/// The conditional ado, one simulation per start, told what it fares best with
/// on starts that are not reported.
pub const ADAPTED: &str = "conditional, adapted";
/// The conditional ado with a few tries.
pub const CONDITIONAL_TRIES: &str = "conditional, tries";

/// What to study.
#[derive(Clone, Copy)]
pub struct ReuseAsked<'a> {
    /// Trainings, and the stream of the test starts.
    pub seeds: Seeds,
    /// Test starts to draw.
    pub starts: usize,
    /// Runs per start of the ado that may explore, the greedy one included.
    pub tries: u64,
    /// Where the run directories go.
    pub runs: &'a Path,
}

/// How an ego was identified.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Known {
    /// The ego.
    pub ego: String,
    /// The member it was taken for.
    pub taken_for: String,
    /// Whether that member explains the recorded runs.
    pub explained: bool,
    /// Root mean square distance of that member to the recorded runs, m.
    pub residual_m: f64,
    /// The same of the nominal ego.
    pub nominal_residual_m: f64,
    /// Runs simulated and recorded for it.
    pub simulations: u64,
    /// What the conditional ado of each training seed is best told of it.
    pub adapted: Vec<String>,
    /// Runs of the ego simulated to learn that, mean over the training seeds.
    pub adapting_simulations: f64,
}

/// What the study came to.
#[derive(Clone, Debug, Serialize)]
pub struct ReuseStudied {
    /// Name of the world.
    pub world: String,
    /// Starts evaluated.
    pub starts: usize,
    /// Starts left out because the nominal ego fails without an adversary.
    pub trivial: usize,
    /// Training seeds.
    pub seeds: u64,
    /// Mean processor time of a training, by ado.
    pub train_cpu_s: Vec<(&'static str, f64)>,
    /// The egos, the nominal one first.
    pub egos: Vec<ReusedOn>,
    /// How each was identified.
    pub known: Vec<Known>,
    /// From how many starts on the conditional ado is cheaper than search.
    pub economy: Vec<Economy>,
    /// Blocks and all changed egos; differences are to the conditional ado.
    pub summary: Vec<Summary>,
    /// The same; differences are to the adapted conditional ado.
    pub summary_of_adapted: Vec<Summary>,
    /// The same; differences are to the conditional ado with a few tries.
    pub summary_of_tries: Vec<Summary>,
    /// All rows.
    pub rows: Vec<Row>,
}

/// The study could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ReuseError {
    /// The world names no family.
    #[error("`{world}` names no family of egos")]
    NoFamily {
        /// The world.
        world: String,
    },
    /// A training or a run directory.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A run directory.
    #[error(transparent)]
    Run(#[from] RunError),
    /// An ego could not be identified.
    #[error("identifying `{ego}`: {source}")]
    Identify {
        /// The ego.
        ego: String,
        /// Why.
        source: IdentifyError,
    },
}

/// The ados of one training seed.
struct Trio {
    nominal: RunDir,
    wide: RunDir,
    conditional: RunDir,
}

/// What one ego of the study came to.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Met {
    /// Its rows and what they come to.
    pub reused: ReusedOn,
    /// Its rows; they are listed beside the egos in the study.
    pub rows: Vec<Row>,
    /// How it was identified.
    pub known: Known,
}

/// A study under way: trained ados and the starts they meet every ego on.
pub struct ReuseStudy<'a> {
    scenario: &'a Scenario,
    family: &'a Family,
    asked: ReuseAsked<'a>,
    trios: Vec<Trio>,
    train_cpu_s: CpuByAdo,
    starts: TestStarts,
    heuristic: OnceLock<Option<Heuristic>>,
}

impl<'a> ReuseStudy<'a> {
    /// Trains the ados of a world; finished trainings are used as they are.
    /// `None`: stopped.
    ///
    /// # Errors
    /// There is no family, a training fails, or the disk refuses.
    pub fn begin(
        scenario: &'a Scenario,
        asked: ReuseAsked<'a>,
        watch: &Watch<'_>,
    ) -> Result<Option<ReuseStudy<'a>>, ReuseError> {
        let Some(family) = scenario.family() else {
            return Err(ReuseError::NoFamily {
                world: scenario.name.clone(),
            });
        };
        let Some((trios, train_cpu_s)) = trios(scenario, &asked, watch)? else {
            return Ok(None);
        };
        let starts = test_starts(scenario, asked.seeds.starts, asked.starts, watch);
        Ok(starts.map(|starts| ReuseStudy {
            scenario,
            family,
            asked,
            trios,
            train_cpu_s,
            starts,
            heuristic: OnceLock::new(),
        }))
    }

    /// Lets everybody meet one ego. `None`: stopped.
    ///
    /// # Errors
    /// It cannot be identified, or a run directory is damaged.
    pub fn meet(
        &self,
        tested: &EgoUnderTest,
        watch: &Watch<'_>,
    ) -> Result<Option<Met>, ReuseError> {
        let (ego, changed) = (tested.name(), tested.scenario());
        let conditional = &self.trios[0].conditional;
        let relation = tested.relation(conditional, &conditional.scenario()?);
        let Some(identified) = self.identified((ego, changed), &[], watch)? else {
            return Ok(None);
        };
        let mut known = Known {
            ego: ego.to_owned(),
            taken_for: self.family.in_words(&identified.member),
            explained: identified.explains(),
            residual_m: identified.residual_m,
            nominal_residual_m: identified.nominal_residual_m,
            simulations: identified.simulations + identified.recorded,
            adapted: Vec::new(),
            adapting_simulations: 0.0,
        };
        let player = Player {
            scenario: changed,
            ego,
            starts: &self.starts,
            watch,
        };
        let (member, told) = identified.told(self.family);
        let mut rows = Vec::new();
        for trio in &self.trios {
            rows.extend(player.ados(trio, self.family, (&member, told), self.asked.tries)?);
            let Some(found) = self.adapted(trio, changed, &member, watch)? else {
                return Ok(None);
            };
            rows.push(player.conditional(ADAPTED, trio, (&found.member, "adapted"))?);
            known.adapted.push(self.family.in_words(&found.member));
            known.adapting_simulations += found.simulations as f64 / self.trios.len() as f64;
        }
        if relation == Relation::Inside {
            let Some(left_out) = self.left_out(&player, &identified.member, &rows)? else {
                return Ok(None);
            };
            rows.extend(left_out);
        }
        let heuristic = match self.heuristic.get() {
            Some(tuned) => tuned,
            None => {
                let tuned = tune_heuristic(self.scenario, self.asked.seeds.first, watch);
                if watch.stopped() {
                    return Ok(None);
                }
                self.heuristic.get_or_init(|| tuned)
            }
        };
        rows.extend(player.rivals(&self.trios[0].nominal, heuristic.as_ref(), self.asked.tries)?);
        if let Some((reachable, others)) = rows.split_last_mut() {
            for row in others {
                row.compare_with_search(&reachable.solved);
            }
        }
        let reused = reused_on(changed, (ego, relation), &self.starts, rows.clone(), watch);
        Ok((!watch.stopped()).then_some(Met {
            reused,
            rows,
            known,
        }))
    }

    /// The member that an ego is taken for, if `fixed` quantities are not varied.
    fn identified(
        &self,
        (ego, changed): (&str, &Scenario),
        fixed: &[String],
        watch: &Watch<'_>,
    ) -> Result<Option<Identified>, ReuseError> {
        let request = IdentifyRequest {
            world: self.scenario,
            ego: changed,
            runs: RECORDED_RUNS as usize,
            at_most: u64::MAX,
            seed: 0,
            fixed,
        };
        identify(&request, watch).map_err(|source| ReuseError::Identify {
            ego: ego.to_owned(),
            source,
        })
    }

    /// What a conditional ado is best told of an ego.
    fn adapted(
        &self,
        trio: &Trio,
        ego: &Scenario,
        first: &Member,
        watch: &Watch<'_>,
    ) -> Result<Option<Adapted>, ReuseError> {
        let request = AdaptRequest {
            run: &trio.conditional,
            family: self.family,
            ego,
            first,
            simulations: ENOUGH_SIMULATIONS,
            seed: trio.conditional.manifest().seed,
        };
        Ok(adapt(&request, watch)?)
    }

    /// The conditional ados where identification knows all of the family's
    /// quantities but one, for each of them in turn.
    ///
    /// They are told the nearest member, however far it is: the ego is of the
    /// family. Where it is nominal in the one, nothing is lost with it: then they
    /// are told the same as ever, and their rows among `told` are the rows.
    fn left_out(
        &self,
        player: &Player<'_>,
        known: &Member,
        told: &[Row],
    ) -> Result<Option<Vec<Row>>, ReuseError> {
        let mut rows = Vec::new();
        for (quantity, value) in self.family.quantities.iter().zip(&known.values) {
            let name = quantity.varied.name();
            let ado = format!("{CONDITIONAL}, without {name}");
            let nominal = (value - quantity.nominal).abs() <= NEARLY * (quantity.hi - quantity.lo);
            if nominal {
                let told = told.iter().filter(|row| row.ado == CONDITIONAL);
                rows.extend(told.map(|row| called(&ado, row.clone())));
                continue;
            }
            let ego = (player.ego, player.scenario);
            let member = match self.identified(ego, &[name.to_owned()], player.watch) {
                Ok(Some(identified)) => identified.member,
                Ok(None) => return Ok(None),
                // It was the only one.
                Err(ReuseError::Identify {
                    source: IdentifyError::NothingToFit,
                    ..
                }) => self.family.nominal(known.plant),
                Err(error) => return Err(error),
            };
            for trio in &self.trios {
                rows.push(player.conditional(&ado, trio, (&member, "identified"))?);
            }
        }
        Ok(Some(rows))
    }

    /// Sums up the egos that were met, the nominal one first.
    pub fn conclude(&self, met: Vec<Met>) -> ReuseStudied {
        let known: Vec<Known> = met.iter().map(|met| met.known.clone()).collect();
        let egos: Vec<ReusedOn> = met
            .into_iter()
            .map(|met| ReusedOn {
                rows: met.rows,
                ..met.reused
            })
            .collect();
        let first = egos.first().and_then(|ego| ego.rows.first());
        let trainings = self.trios.iter().map(|trio| trio.conditional.manifest());
        let training = trainings.map(|run| run.episodes as f64).sum::<f64>();
        let training = training / self.trios.len().max(1) as f64;
        ReuseStudied {
            world: self.scenario.name.clone(),
            starts: first.map_or(0, |row| row.starts),
            trivial: first.map_or(0, |row| row.trivial),
            seeds: self.asked.seeds.count,
            train_cpu_s: self.train_cpu_s.clone(),
            economy: economy::economy(training, &egos, &known),
            summary: summarise(&egos, CONDITIONAL),
            summary_of_adapted: summarise(&egos, ADAPTED),
            summary_of_tries: summarise(&egos, CONDITIONAL_TRIES),
            rows: egos.iter().flat_map(|ego| ego.rows.clone()).collect(),
            egos,
            known,
        }
    }
}

type CpuByAdo = Vec<(&'static str, f64)>;

/// Trains what is not trained yet, in parallel.
fn trios(
    scenario: &Scenario,
    request: &ReuseAsked<'_>,
    watch: &Watch<'_>,
) -> Result<Option<(Vec<Trio>, CpuByAdo)>, ReuseError> {
    let kinds = [Against::Nominal, Against::Wide, Against::Conditional];
    let jobs: Vec<(Against, u64)> = kinds
        .into_iter()
        .flat_map(|against| request.seeds.trainings().map(move |seed| (against, seed)))
        .collect();
    let runs: Vec<(PathBuf, f64)> = jobs
        .par_iter()
        .map(|&(against, seed)| {
            let trained = scenario.training_against(against);
            let trained = trained.as_ref().unwrap_or(scenario);
            trained_run(trained, seed, request.runs, watch)
        })
        .collect::<Result<_, _>>()?;
    if watch.stopped() {
        return Ok(None);
    }
    let of = |against: Against| {
        let all = jobs.iter().zip(&runs);
        all.filter(move |((kind, _), _)| *kind == against)
            .map(|(_, run)| run)
    };
    let cpu_s = kinds.map(|kind| {
        let sum: f64 = of(kind).map(|(_, cpu_s)| cpu_s).sum();
        (kind.word(), sum / request.seeds.count.max(1) as f64)
    });
    let open = |against: Against| of(against).map(|(path, _)| RunDir::open(path));
    let trios = open(Against::Nominal)
        .zip(open(Against::Wide))
        .zip(open(Against::Conditional))
        .map(|((nominal, wide), conditional)| {
            Ok(Trio {
                nominal: nominal?,
                wide: wide?,
                conditional: conditional?,
            })
        })
        .collect::<Result<_, RunError>>()?;
    Ok(Some((trios, cpu_s.to_vec())))
}
