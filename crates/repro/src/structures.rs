//! Egos of other structures than in training, learned from some runs.
//!
//! The study separates the transfer of the reused policy from the benefit of plans in a
//! surrogate. A plan per start is not a reused policy, so both have columns of their own.

use std::num::NonZeroU64;

use serde::{Deserialize, Serialize};

use brakecheck::evaluation::AdaptedTo;
use brakecheck::evaluation::{Evaluation, EvaluationError};
use brakecheck::experiment::{EgoError, EgoUnderTest, Watch};
use brakecheck::run_dir::{AdversaryId, Row, RunDir};
use brakecheck::stats::Outcomes;
use brakecheck::world::Scenario;
use brakecheck_report::report::table::TextTable;

/// Number of recorded runs per ego, and the smaller number of the second column.
pub const RUNS: u64 = 100;
const FEW_RUNS: u64 = 30;
/// Largest number of runs per start with repeated tries.
const TRIES: u64 = 3;
/// Largest number of switches of the search that recall refers to.
const SWITCHES: usize = 2;
/// Groups of related kinds of controllers.
///
/// A group is left out as a whole, because a related controller would fit almost as well.
const KIN: [&[&str]; 4] = [
    &[
        "Acc",
        "FilteredAcc",
        "PoliteAcc",
        "IsoAcc",
        "YellowLight",
        "YellowLightFixed",
    ],
    &["Gipps", "Krauss"],
    &["Aeb", "PurePursuit", "Merge"],
    &["CcDriver", "CcLaneDriver", "CcLatchedDriver", "RegDriver"],
];
/// World with the changed egos that are played in every world.
const STRUCTURES: &str = "acc_structures";
/// Number of starts solved by search from which recall enters the means.
const LEAST_SEARCHED: usize = 10;

/// Starts that an ado solves, compared with a search.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SolvedBy {
    /// Share of the starts solved by search that the ado solves too.
    ///
    /// `None`: search solves no start.
    pub recall: Option<f64>,
    /// Starts that the ado solves and search does not.
    pub beyond: usize,
    /// Starts that the ado solves.
    pub successes: usize,
}

impl SolvedBy {
    fn of(mut row: Row, searched: &Outcomes) -> SolvedBy {
        row.compare_with_search(searched);
        SolvedBy {
            recall: row.recall,
            // An interrupted row has no such number, and is not recorded.
            beyond: row.beyond_search.unwrap_or(0),
            successes: row.successes,
        }
    }
}

/// Results of an ego of another structure.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StructureRow {
    /// Name of the ego in the world.
    pub ego: String,
    /// Seed of the training.
    pub seed: u64,
    /// Starts that are not trivial.
    pub starts: usize,
    /// Starts that search solves.
    pub searched: usize,
    /// Policy as trained.
    pub trained: SolvedBy,
    /// Held random actions.
    pub held: SolvedBy,
    /// Best constant action, chosen on these starts.
    pub constant: SolvedBy,
    /// Best of six ados that accelerate and then brake, chosen on these starts.
    pub switch: SolvedBy,
    /// Plans in a surrogate of [`RUNS`] runs, with one run per start.
    ///
    /// The ego's kind of controller and related kinds are not compared with the ego.
    pub adapted: SolvedBy,
    /// Same plans with at most three runs per start.
    pub again: SolvedBy,
    /// Plans in a surrogate of 30 runs, with one run per start.
    pub few: SolvedBy,
    /// Plans as in `adapted`, with all stock controllers compared.
    pub known: SolvedBy,
    /// Most similar kind in that case.
    pub like: Option<String>,
    /// Error of the first surrogate and of constant acceleration, two seconds ahead, m.
    pub off_m: Option<[f64; 2]>,
    /// Expected share of solved starts, with its interval.
    pub expected: (f64, [f64; 2]),
}

impl StructureRow {
    /// Returns the share of solved starts and whether it was in the expected interval.
    fn observed(&self) -> (f64, bool) {
        let observed = self.adapted.successes as f64 / self.starts.max(1) as f64;
        let [low, high] = self.expected.1;
        // The expectation was fixed before the test starts were played.
        (observed, low <= observed && observed <= high)
    }
}

/// Mean recalls of a world on the page.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StructureMeans {
    /// Name of the world.
    pub world: String,
    /// Rows over which the means are, of which search solves enough starts.
    pub egos: usize,
    /// Policy as trained.
    pub trained: Option<f64>,
    /// Held random actions.
    pub held: Option<f64>,
    /// Best constant action.
    pub constant: Option<f64>,
    /// Best of six ados that accelerate and then brake.
    pub switch: Option<f64>,
    /// Plans in a surrogate of [`RUNS`] runs.
    pub adapted: Option<f64>,
    /// Same plans with at most three runs per start.
    pub again: Option<f64>,
    /// Plans in a surrogate of 30 runs.
    pub few: Option<f64>,
    /// Rows whose result was in the expected interval, of all rows.
    pub expected: Option<[usize; 2]>,
}

impl StructureMeans {
    /// Returns the means over rows in which search solves enough starts.
    pub fn of(world: &str, rows: &[StructureRow]) -> StructureMeans {
        let reachable = || rows.iter().filter(|row| row.searched >= LEAST_SEARCHED);
        let mean = |of: fn(&StructureRow) -> &SolvedBy| {
            let recalls: Vec<f64> = reachable().filter_map(|row| of(row).recall).collect();
            let sum: f64 = recalls.iter().sum();
            (!recalls.is_empty()).then(|| sum / recalls.len() as f64)
        };
        StructureMeans {
            world: world.to_owned(),
            egos: reachable().count(),
            trained: mean(|row| &row.trained),
            held: mean(|row| &row.held),
            constant: mean(|row| &row.constant),
            switch: mean(|row| &row.switch),
            adapted: mean(|row| &row.adapted),
            again: mean(|row| &row.again),
            few: mean(|row| &row.few),
            // The expectation is of a rate and not of a recall, so no row is left out
            // here.
            expected: Some([
                rows.iter().filter(|row| row.observed().1).count(),
                rows.len(),
            ]),
        }
    }
}

/// Request of the study.
#[derive(Clone, Copy)]
pub struct StructureStudy<'a> {
    /// Run of the ado.
    pub run: &'a RunDir,
    /// World of the run, on the plant to test on.
    pub nominal: &'a Scenario,
    /// Number of test starts and seed of their stream.
    pub starts: (usize, u64),
}

/// Returns the controllers of `acc_structures` in the place of a world's ego.
///
/// Controllers of the ego's own kind are left out.
///
/// # Errors
/// Returns an error if the world has no driving scene.
pub fn other_structures(world: &Scenario) -> Result<Vec<EgoUnderTest>, EgoError> {
    // Invariant: a shipped world is always read.
    let Some(Ok(structures)) = Scenario::shipped(STRUCTURES) else {
        return Ok(Vec::new());
    };
    let own = world.controller().map(|own| own.controller.kind());
    let others = structures.reuse().iter().filter(|(_, change)| {
        let kind = change.controller.as_ref().map(|it| it.controller.kind());
        // Changes without a controller keep the structure of the ego.
        kind.is_some() && kind != own
    });
    let help = "a controller drives the ego of a driving world";
    others
        .map(|(name, change)| EgoUnderTest::changed(world, name, change, help))
        .collect()
}

/// Returns the kind of an ego's controller with its related kinds.
fn kin(ego: &EgoUnderTest) -> Vec<&'static str> {
    let controller = ego.change().controller.as_ref();
    let Some(kind) = controller.map(|it| it.controller.kind()) else {
        // An ego that keeps the world's controller has no kind to leave out here.
        return Vec::new();
    };
    let line = KIN.iter().find(|line| line.contains(&kind));
    line.map_or_else(|| vec![kind], |line| line.to_vec())
}

impl StructureStudy<'_> {
    /// Plays all ados against an ego. `None`: stopped.
    ///
    /// # Errors
    /// Returns an error if the ado cannot be played or the ego does not run.
    pub fn evaluate(
        &self,
        ego: &EgoUnderTest,
        watch: &Watch<'_>,
    ) -> Result<Option<StructureRow>, EvaluationError> {
        use AdversaryId::{BestConstant, BestSwitch, Hold, Trained};
        let kin = kin(ego);
        let evaluated = |adapted: AdaptedAdo<'_>| self.evaluated(ego, adapted, watch);
        let base = AdaptedAdo {
            ados: &[],
            runs: RUNS,
            tries: 1,
            search: None,
            unknown: &kin,
        };
        // The baselines and the search are played once, with the first surrogate.
        let first = evaluated(AdaptedAdo {
            ados: &[Trained, Hold, BestConstant, BestSwitch],
            search: Some(SWITCHES),
            ..base
        })?;
        // The learned ego is stored with the run, so this evaluation reuses it.
        let tries = TRIES;
        let again = evaluated(AdaptedAdo { tries, ..base })?;
        let runs = FEW_RUNS;
        let few = evaluated(AdaptedAdo { runs, ..base })?;
        // Without unknown kinds the ego's own controller is compared too.
        let unknown = &[];
        let known = evaluated(AdaptedAdo { unknown, ..base })?;
        let (Some(first), Some(again), Some(few), Some(known)) = (first, again, few, known) else {
            return Ok(None);
        };
        let Some(search) = first.row("search") else {
            return Ok(None);
        };
        let searched = search.solved.clone();
        let solved_by =
            |of: &StructureRows, ado: &str| Some(SolvedBy::of(of.row(ado)?.clone(), &searched));
        let row = || {
            let adapted_to = first.adapted_to.as_ref()?;
            Some(StructureRow {
                ego: ego.name().to_owned(),
                seed: self.run.manifest().seed,
                starts: search.starts,
                searched: search.successes,
                trained: solved_by(&first, "trained")?,
                held: solved_by(&first, "hold")?,
                constant: solved_by(&first, "constant")?,
                switch: solved_by(&first, "switch")?,
                adapted: solved_by(&first, "adapted")?,
                again: solved_by(&again, "adapted")?,
                few: solved_by(&few, "adapted")?,
                known: solved_by(&known, "adapted")?,
                like: known.adapted_to.as_ref().and_then(|record| {
                    let like = record.learned.nearest.first()?;
                    Some(like.controller.controller.kind().to_owned())
                }),
                off_m: adapted_to
                    .learned
                    .error
                    .map(|error| [error.rms_m, error.keeps_acceleration_m]),
                expected: (adapted_to.expected, adapted_to.expected_ci95),
            })
        };
        Ok(row())
    }

    fn evaluated(
        &self,
        ego: &EgoUnderTest,
        adapted: AdaptedAdo<'_>,
        watch: &Watch<'_>,
    ) -> Result<Option<StructureRows>, EvaluationError> {
        let egos = std::slice::from_ref(ego);
        let AdaptedAdo {
            ados,
            runs,
            tries,
            search,
            unknown,
        } = adapted;
        let evaluation = Evaluation {
            ados,
            starts: self.starts,
            search,
            tries,
            runs: NonZeroU64::new(runs),
            unknown,
            ..Evaluation::new(self.run, self.nominal, egos)
        };
        let Some(mut table) = evaluation.run(watch)? else {
            return Ok(None);
        };
        // A failed ego would leave a row with gaps.
        if let Some(error) = table.failure.take() {
            return Err(error);
        }
        // A stopped evaluation may have rows of some starts only.
        if watch.stopped() {
            return Ok(None);
        }
        Ok(Some(StructureRows {
            rows: table.rows(),
            // One ego was asked for, so this is the only entry.
            adapted_to: table.adapted_to.pop(),
        }))
    }
}

/// Settings of an ado that adapts to an ego, and the ados and the search beside it.
#[derive(Clone, Copy)]
struct AdaptedAdo<'a> {
    ados: &'a [AdversaryId],
    /// Runs of the ego that its surrogate is learned from.
    runs: u64,
    /// Tries per start.
    tries: u64,
    /// Largest number of switches of the search, if any.
    search: Option<usize>,
    /// Kinds of controllers that are not compared with the ego.
    unknown: &'a [&'a str],
}

/// Evaluation of an ego.
struct StructureRows {
    rows: Vec<Row>,
    adapted_to: Option<AdaptedTo>,
}

impl StructureRows {
    fn row(&self, ado: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.ado == ado.into())
    }
}

/// Formats a world's rows as a Markdown table, with means and minima.
pub fn structures_markdown(world: &str, rows: &[StructureRow]) -> String {
    let mut text = format!(
        "`{world}`: recall of the starts that a search with at most {SWITCHES} switches solves. \
         *Reused*: the policy as it was trained, without a run of the ego. *Best constant* and \
         *best switch* are the best of all constants, and of six that accelerate and then brake, \
         on these very starts. *Adapted*: made for the ego, start by start, after {RUNS} or {FEW_RUNS} runs of an ego of \
         unknown structure, neither its kind nor relatives of it among the stock controllers that it \
         is likened to; *kind known*: all of them.\n\n"
    );
    let columns = [
        "ego".to_owned(),
        "training".to_owned(),
        "search solves".to_owned(),
        "reused policy".to_owned(),
        "held random".to_owned(),
        "best constant".to_owned(),
        "best switch".to_owned(),
        format!("adapted, {RUNS} runs"),
        format!("at most {TRIES} tries"),
        format!("{FEW_RUNS} runs"),
        "kind known".to_owned(),
        "most like".to_owned(),
        "beyond".to_owned(),
        "off, m".to_owned(),
        "expected".to_owned(),
        "came".to_owned(),
    ];
    // A recall over a few starts would dominate the mean by chance.
    let reachable: Vec<&StructureRow> = rows
        .iter()
        .filter(|row| row.searched >= LEAST_SEARCHED)
        .collect();
    let over = |of: fn(&StructureRow) -> &SolvedBy| {
        let recalls: Vec<f64> = reachable.iter().filter_map(|row| of(row).recall).collect();
        let mean = recalls.iter().sum::<f64>() / recalls.len().max(1) as f64;
        let worst = recalls.iter().copied().fold(f64::INFINITY, f64::min);
        // Without a recall the sum is 0 and the minimum infinite, and neither is shown.
        if recalls.is_empty() {
            "–".to_owned()
        } else {
            format!("{mean:.2} ({worst:.2})")
        }
    };
    let mut mean = vec![String::new(); columns.len()];
    mean[0] = format!("mean (worst) of {}", reachable.len());
    // Three columns precede those of the ados.
    mean[3..][..ADOS.len()].clone_from_slice(&ADOS.map(over));
    let lines = rows.iter().map(line).chain([mean]);
    text.push_str(&TextTable::new(columns, lines).to_markdown());
    let expected = rows.iter().filter(|row| row.observed().1).count();
    text.push_str(&format!(
        "\nMeans are over rows in which search solves {LEAST_SEARCHED} starts or more. What came lies in the interval that was expected in {expected} of {} rows.\n",
        rows.len()
    ));
    text
}

/// Results of the ados, in the order of their columns.
const ADOS: [fn(&StructureRow) -> &SolvedBy; 8] = [
    |row| &row.trained,
    |row| &row.held,
    |row| &row.constant,
    |row| &row.switch,
    |row| &row.adapted,
    |row| &row.again,
    |row| &row.few,
    |row| &row.known,
];

fn line(row: &StructureRow) -> Vec<String> {
    let recall = |of: fn(&StructureRow) -> &SolvedBy| {
        let recall = of(row).recall;
        recall.map_or("–".to_owned(), |recall| format!("{recall:.2}"))
    };
    let off = row.off_m.map_or("–".to_owned(), |[own, keeping]| {
        format!("{own:.2} / {keeping:.2}")
    });
    let (expected, [low, high]) = row.expected;
    let [expected, low, high, observed] =
        [expected, low, high, row.observed().0].map(|share| 100.0 * share);
    let named = [
        row.ego.clone(),
        row.seed.to_string(),
        format!("{} of {}", row.searched, row.starts),
    ];
    let known = [
        row.like.clone().unwrap_or("–".to_owned()),
        row.adapted.beyond.to_string(),
        off,
        format!("{expected:.0} % [{low:.0}, {high:.0}]"),
        format!("{observed:.0} %"),
    ];
    let cells = named.into_iter().chain(ADOS.map(recall)).chain(known);
    cells.collect()
}
