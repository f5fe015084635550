//! The paper's central claim, measured: one trained ado on changed egos.
//!
//! Three ados per training seed, untouched after training: trained on the
//! nominal ego, trained on the family without being told (wide), and told the
//! parameters that were identified from recorded runs (conditional). Beside
//! them on the same starts: what a falsifier would have kept from the same
//! training, a tuned rule, random ados, and searches per start.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use super::case_studies::trained_run;
use super::eval::{Ado, EvalRequest, TestStarts, best_constant, eval, test_starts};
use super::heuristic::{Heuristic, tune_heuristic};
use super::identify::{IdentifyError, IdentifyRequest, identify};
use super::reuse::{Relation, ReusedOn, Summary, reused_on, summarise};
use super::search::{Found, Method, SearchRequest, Searched, search};
use super::train::TrainError;
use super::tries::{Tries, other_members};
use super::{Watch, eval::count_solved};
use crate::rl::Policy;
use crate::run::{Row, RunDir, RunError, Stored};
use crate::scenario::{Against, Change, Family, Member, Scenario};

/// Runs of an ego that are recorded to identify it.
const RECORDED_RUNS: usize = 10;
/// Switches of the search that defines the reachable share.
const SWITCHES: usize = 2;
/// Simulations per start of held-random search; the smaller ones are cut from it.
const HELD_BUDGETS: [u64; 3] = [10, 30, 100];

/// The conditional ado, one simulation per start.
pub const CONDITIONAL: &str = "conditional";
/// The conditional ado with a few tries.
pub const CONDITIONAL_TRIES: &str = "conditional, tries";

/// What to study.
pub struct ReuseStudy<'a> {
    /// Training seeds 1 ..= `seeds`.
    pub seeds: u64,
    /// Test starts to draw, of stream seed 0.
    pub starts: usize,
    /// Runs per start of the ado that may explore, the greedy one included.
    pub tries: u64,
    /// Where the run directories go.
    pub runs: &'a Path,
}

/// How an ego was identified.
#[derive(Clone, Debug, Serialize)]
pub struct Known {
    /// The ego.
    pub ego: String,
    /// The member it was taken for.
    pub taken_for: String,
    /// Whether that member explains the recorded runs.
    pub explained: bool,
    /// Root mean square distance to the recorded runs, of member and nominal.
    pub residual_m: f64,
    /// The same of the nominal ego.
    pub nominal_residual_m: f64,
    /// Runs simulated and recorded for it.
    pub simulations: u64,
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
    /// Blocks and all changed egos; differences are to the conditional ado.
    pub summary: Vec<Summary>,
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

/// Makes the study of one world; finished trainings are used as they are.
///
/// `egos` are the changed ones, each with its world. `None`: stopped.
///
/// # Errors
/// There is no family, a training fails, or the disk refuses.
pub fn reuse_study(
    scenario: &Scenario,
    egos: &[(String, Change, Scenario)],
    request: &ReuseStudy<'_>,
    watch: &Watch<'_>,
) -> Result<Option<ReuseStudied>, ReuseError> {
    let Some(family) = scenario.family() else {
        return Err(ReuseError::NoFamily {
            world: scenario.name.clone(),
        });
    };
    let Some((trios, train_cpu_s)) = trios(scenario, request, watch)? else {
        return Ok(None);
    };
    let Some(starts) = test_starts(scenario, 0, request.starts, watch) else {
        return Ok(None);
    };
    let heuristic = tune_heuristic(scenario, 1, watch);
    let mut studied = Vec::new();
    let mut known = Vec::new();
    let nominal = ("nominal".to_owned(), Change::default(), scenario.clone());
    for (ego, change, changed) in std::iter::once(&nominal).chain(egos) {
        let relation = match (ego == "nominal", family.covers(change)) {
            (true, _) => Relation::Trained,
            (_, true) => Relation::Inside,
            (_, false) => Relation::Outside,
        };
        let asked = IdentifyRequest {
            world: scenario,
            ego: changed,
            runs: RECORDED_RUNS,
            seed: 0,
            fixed: &[],
        };
        let identified = identify(&asked, watch).map_err(|source| ReuseError::Identify {
            ego: ego.clone(),
            source,
        })?;
        let Some(identified) = identified else {
            return Ok(None);
        };
        known.push(Known {
            ego: ego.clone(),
            taken_for: family.in_words(&identified.member),
            explained: identified.explains(),
            residual_m: identified.residual_m,
            nominal_residual_m: identified.nominal_residual_m,
            simulations: identified.simulations + identified.recorded,
        });
        let player = Player {
            scenario: changed,
            ego,
            starts: &starts,
            watch,
        };
        let mut rows = Vec::new();
        for trio in &trios {
            rows.extend(player.ados(trio, family, &identified.member, request.tries)?);
        }
        rows.extend(player.rivals(&trios[0].nominal, heuristic.as_ref(), request.tries)?);
        if watch.stopped() {
            return Ok(None);
        }
        if let Some((reachable, others)) = rows.split_last_mut() {
            for row in others {
                row.compare_with_search(&reachable.solved);
            }
        }
        studied.push(reused_on(changed, (ego, relation), &starts, rows, watch));
    }
    let first = studied.first().and_then(|ego| ego.rows.first());
    Ok(Some(ReuseStudied {
        world: scenario.name.clone(),
        starts: first.map_or(0, |row| row.starts),
        trivial: first.map_or(0, |row| row.trivial),
        seeds: request.seeds,
        train_cpu_s,
        summary: summarise(&studied, CONDITIONAL),
        summary_of_tries: summarise(&studied, CONDITIONAL_TRIES),
        rows: studied.iter().flat_map(|ego| ego.rows.clone()).collect(),
        egos: studied,
        known,
    }))
}

type CpuByAdo = Vec<(&'static str, f64)>;

/// Trains what is not trained yet, in parallel.
fn trios(
    scenario: &Scenario,
    request: &ReuseStudy<'_>,
    watch: &Watch<'_>,
) -> Result<Option<(Vec<Trio>, CpuByAdo)>, ReuseError> {
    let kinds = [Against::Nominal, Against::Wide, Against::Conditional];
    let jobs: Vec<(Against, u64)> = kinds
        .into_iter()
        .flat_map(|against| (1..=request.seeds).map(move |seed| (against, seed)))
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
        (kind.word(), sum / request.seeds.max(1) as f64)
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

/// The study as Markdown: every ego, then the means of every block.
pub fn reuse_markdown(studies: &[ReuseStudied]) -> String {
    studies.iter().map(one_markdown).collect()
}

/// Ados of the table of egos, and how its header calls them.
const SHOWN: [(&str, &str); 8] = [
    ("nominal ado", "nominal ado"),
    ("wide", "wide"),
    (CONDITIONAL, "conditional"),
    (CONDITIONAL_TRIES, "conditional, tries"),
    ("replays", "10 replays"),
    ("heuristic", "heuristic"),
    ("search, held, 100", "held search, 100"),
    ("constant", "best constant"),
];

fn one_markdown(study: &ReuseStudied) -> String {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let trained: Vec<String> = study
        .train_cpu_s
        .iter()
        .map(|(ado, cpu_s)| format!("{ado} {cpu_s:.0} s"))
        .collect();
    let mut text = format!(
        "## {}\n\n{} starts ({} trivial), {} training seeds; training, processor time each: {}.\n\n\
         | ego | relation | fails without an adversary | reachable |",
        study.world,
        study.starts,
        study.trivial,
        study.seeds,
        trained.join(", ")
    );
    for (_, header) in SHOWN {
        text.push_str(&format!(" {header} |"));
    }
    text.push_str(" recall of conditional |\n|");
    text.push_str(&" --- |".repeat(SHOWN.len() + 5));
    text.push('\n');
    for ego in &study.egos {
        let reachable = ego.reachable.map_or("–".to_owned(), percent);
        text.push_str(&format!(
            "| {} | {:?} | {} | {reachable} |",
            ego.ego,
            ego.relation,
            percent(ego.fails_without_adversary),
        ));
        for (word, _) in SHOWN {
            let rate = mean_of(ego, word, |row| Some(row.success_rate));
            text.push_str(&format!(" {} |", rate.map_or("–".to_owned(), percent)));
        }
        let recall = mean_of(ego, CONDITIONAL, |row| row.recall);
        let recall = recall.map_or("–".to_owned(), |recall| format!("{recall:.3}"));
        text.push_str(&format!(" {recall} |\n"));
    }
    for (reference, summaries) in [
        (CONDITIONAL, &study.summary),
        (CONDITIONAL_TRIES, &study.summary_of_tries),
    ] {
        text.push_str(&format!(
            "\n| block | ado | egos | mean success | `{reference}` − it [95 %] | \
             mean recall (egos) | least recall | simulations per start |\n\
             | --- | --- | --- | --- | --- | --- | --- | --- |\n"
        ));
        for sum in summaries {
            text.push_str(&summary_line(sum));
        }
    }
    text.push('\n');
    text
}

/// Mean over the training seeds of an ado's rows on one ego.
fn mean_of(ego: &ReusedOn, ado: &str, of: fn(&Row) -> Option<f64>) -> Option<f64> {
    let rows = ego.rows.iter().filter(|row| row.ado == ado);
    let values: Vec<f64> = rows.filter_map(of).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn summary_line(sum: &Summary) -> String {
    let difference = sum.reference_minus.map(|(mean, [lo, hi])| {
        let [mean, lo, hi] = [mean, lo, hi].map(|share| 100.0 * share);
        format!("{mean:+.1} [{lo:+.1}, {hi:+.1}]")
    });
    let recall = sum
        .recall_mean
        .map(|recall| format!("{recall:.3} ({})", sum.egos_with_recall));
    let least = sum
        .recall_min
        .as_ref()
        .map(|(recall, ego)| format!("{recall:.3} ({ego})"));
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    format!(
        "| {} | {} | {} | {:.1} % | {} | {} | {} | {:.1} |\n",
        sum.relation.heading(),
        sum.ado,
        sum.egos,
        100.0 * sum.success_rate,
        or_dash(difference),
        or_dash(recall),
        or_dash(least),
        sum.sims_per_start,
    )
}

/// One ego and the starts on which everybody meets it.
struct Player<'a> {
    scenario: &'a Scenario,
    ego: &'a str,
    starts: &'a TestStarts,
    watch: &'a Watch<'a>,
}

impl Player<'_> {
    /// The rows of one training seed.
    fn ados(
        &self,
        trio: &Trio,
        family: &Family,
        member: &Member,
        tries: u64,
    ) -> Result<Vec<Row>, RunError> {
        let seed = trio.conditional.manifest().seed;
        let told = trio.conditional.policy_told(member)?;
        let others = other_members(&trio.conditional, family, member.plant)?;
        let tried = Tries {
            request: self.request(Ado::Trained(&*told, seed)),
            policy: &*told,
            others: &others,
            tries,
        };
        let mut rows = vec![
            self.trained("nominal ado", &*trio.nominal.policy()?, seed),
            self.trained("wide", &*trio.wide.policy()?, seed),
            self.trained(CONDITIONAL, &*told, seed),
            called(CONDITIONAL_TRIES, tried.run(self.watch).evaluated.row),
        ];
        rows[1].method = "dqn, wide".to_owned();
        for row in &mut rows[2..] {
            row.told = Some("identified".to_owned());
        }
        Ok(rows)
    }

    /// The rows of everybody who was not trained.
    fn rivals(
        &self,
        run: &RunDir,
        heuristic: Option<&Heuristic>,
        tries: u64,
    ) -> Result<Vec<Row>, RunError> {
        let stored: Stored = run.counterexamples()?;
        let mut ados = vec![Ado::Replays(&stored, 1), Ado::Replays(&stored, 10)];
        ados.extend(heuristic.map(Ado::Heuristic));
        ados.extend([Ado::Held, Ado::Random]);
        let rows = ados.into_iter();
        let mut rows: Vec<Row> = rows
            .map(|ado| eval(&self.request(ado), self.watch).row)
            .collect();
        rows.push(best_constant(self.scenario, self.ego, self.starts, self.watch).row);
        let most = HELD_BUDGETS[HELD_BUDGETS.len() - 1];
        let held = self.searched(Method::Hold, most);
        for budget in HELD_BUDGETS {
            rows.push(called(
                &format!("search, held, {budget}"),
                cut(&held, budget),
            ));
        }
        let mutated = self.searched(Method::Mutate(&stored), tries);
        rows.push(called(&format!("mutate, {tries}"), mutated.row));
        rows.push(self.searched(Method::Switches(SWITCHES), 0).row);
        Ok(rows)
    }

    fn request<'b>(&'b self, ado: Ado<'b>) -> EvalRequest<'b> {
        EvalRequest {
            scenario: self.scenario,
            ego: self.ego,
            ado,
            starts: self.starts,
        }
    }

    fn trained(&self, word: &str, policy: &dyn Policy, seed: u64) -> Row {
        let request = self.request(Ado::Trained(policy, seed));
        called(word, eval(&request, self.watch).row)
    }

    fn searched(&self, method: Method<'_>, budget: u64) -> Searched {
        let request = SearchRequest {
            scenario: self.scenario,
            ego: self.ego,
            method,
            budget,
            starts: self.starts,
        };
        search(&request, self.watch)
    }
}

/// A row under another word.
fn called(word: &str, row: Row) -> Row {
    Row {
        ado: word.to_owned(),
        ..row
    }
}

/// The row of a search that stopped after fewer simulations per start.
fn cut(searched: &Searched, budget: u64) -> Row {
    let marks = searched.row.solved.bytes().zip(&searched.found);
    let within = |found: &Found| found.within(budget);
    let solved = marks.map(|(mark, found)| match (mark, found) {
        (b'1', Some(found)) if !within(found).1 => '0',
        (mark, _) => char::from(mark),
    });
    let mut row = searched.row.clone();
    row.solved = solved.collect();
    count_solved(&mut row);
    let spent: u64 = searched.found.iter().flatten().map(|f| within(f).0).sum();
    row.sims_per_start = spent as f64 / row.starts.max(1) as f64;
    row.method = format!("hold, {budget} simulations");
    row.anytime.clear();
    row
}
