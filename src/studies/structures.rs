//! Egos of structures that the ado was not trained against, each learned from
//! some runs of it: what carries over, and what a plan in a surrogate adds.
//!
//! The reused policy and the plans that are made for one ego stand in columns of
//! their own: a plan per start is no reused policy.

use serde::{Deserialize, Serialize};

use crate::campaign::{AdaptedTo, AdoKind, CampaignError, EgoUnderTest, Evaluation, Watch};
use crate::run::{Outcomes, Row, RunDir};
use crate::scenario::Scenario;

/// Runs of each ego that are recorded; fewer in the second column.
pub const RUNS: u64 = 100;
const FEW_RUNS: u64 = 30;
/// Runs of each start where it may be tried again.
const TRIES: u64 = 3;
/// Most switches of the search that recall is measured against.
const SWITCHES: usize = 2;
/// With fewer starts solved by search recall says little, and is in no mean.
const TELLING: usize = 10;

/// Who met an ego, and which starts it solved.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SolvedBy {
    /// Share of the starts that search solves that it solves too; `None`: search
    /// solves none.
    pub recall: Option<f64>,
    /// Starts that it solves and search does not.
    pub beyond: usize,
    /// Starts that it solves.
    pub successes: usize,
}

impl SolvedBy {
    fn of(mut row: Row, searched: &Outcomes) -> SolvedBy {
        row.compare_with_search(searched);
        SolvedBy {
            recall: row.recall,
            beyond: row.beyond_search.unwrap_or(0),
            successes: row.successes,
        }
    }
}

/// One ego of another structure.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StructureRow {
    /// Its name in the world.
    pub ego: String,
    /// Seed of the training.
    pub seed: u64,
    /// Starts that are not trivial.
    pub starts: usize,
    /// Those that search solves.
    pub searched: usize,
    /// The policy, reused as it was trained.
    pub trained: SolvedBy,
    /// Random actions, held.
    pub held: SolvedBy,
    /// The best of the constant actions, chosen on these very starts.
    pub constant: SolvedBy,
    /// Planned in a surrogate of [`RUNS`] runs, each start played once.
    pub adapted: SolvedBy,
    /// The same, each start played at most three times.
    pub again: SolvedBy,
    /// Planned in a surrogate of 30 runs, each start played once.
    pub few: SolvedBy,
    /// How far the surrogate of the first is off two seconds ahead, and an ego
    /// that keeps its acceleration, m.
    pub off_m: Option<[f64; 2]>,
    /// The share of starts that was expected of it beforehand, and its interval.
    pub expected: (f64, [f64; 2]),
}

impl StructureRow {
    /// The share of starts that came, and whether that was to be expected.
    fn came(&self) -> (f64, bool) {
        let came = self.adapted.successes as f64 / self.starts.max(1) as f64;
        let [low, high] = self.expected.1;
        (came, low <= came && came <= high)
    }
}

/// What is asked.
#[derive(Clone, Copy)]
pub struct StructuresAsked<'a> {
    /// The run of the ado.
    pub run: &'a RunDir,
    /// Its world, on the plant to test on.
    pub nominal: &'a Scenario,
    /// Test starts to draw, and the seed of their stream.
    pub starts: (usize, u64),
}

/// The changed egos of a world that have another controller than its own.
///
/// # Errors
/// The world has no changed ego at all.
pub fn other_structures(world: &Scenario) -> Result<Vec<EgoUnderTest>, CampaignError> {
    let all = EgoUnderTest::find(world, "all")?;
    let other = all
        .into_iter()
        .filter(|ego| ego.change().controller.is_some());
    Ok(other.collect())
}

impl StructuresAsked<'_> {
    /// Everybody meets one ego. `None`: stopped.
    ///
    /// # Errors
    /// The ado cannot be played, or the ego does not run.
    pub fn meet(
        &self,
        ego: &EgoUnderTest,
        watch: &Watch<'_>,
    ) -> Result<Option<StructureRow>, CampaignError> {
        let beside = [AdoKind::Trained, AdoKind::Hold, AdoKind::Constant];
        let first = self.evaluated(ego, &beside, (RUNS, 1, Some(SWITCHES)), watch)?;
        let again = self.evaluated(ego, &[], (RUNS, TRIES, None), watch)?;
        let few = self.evaluated(ego, &[], (FEW_RUNS, 1, None), watch)?;
        let (Some(first), Some(again), Some(few)) = (first, again, few) else {
            return Ok(None);
        };
        let Some(search) = first.row("search") else {
            return Ok(None);
        };
        let searched = search.solved.clone();
        let met = |of: &Part, ado: &str| Some(SolvedBy::of(of.row(ado)?.clone(), &searched));
        let row = || {
            let told = first.told.as_ref()?;
            Some(StructureRow {
                ego: ego.name().to_owned(),
                seed: self.run.manifest().seed,
                starts: search.starts,
                searched: search.successes,
                trained: met(&first, "trained")?,
                held: met(&first, "hold")?,
                constant: met(&first, "constant")?,
                adapted: met(&first, "adapted")?,
                again: met(&again, "adapted")?,
                few: met(&few, "adapted")?,
                off_m: told
                    .learned
                    .error
                    .map(|error| [error.rms_m, error.keeps_acceleration_m]),
                expected: (told.expected, told.expected_ci95),
            })
        };
        Ok(row())
    }

    fn evaluated(
        &self,
        ego: &EgoUnderTest,
        ados: &[AdoKind],
        (runs, tries, search): (u64, u64, Option<usize>),
        watch: &Watch<'_>,
    ) -> Result<Option<Part>, CampaignError> {
        let egos = std::slice::from_ref(ego);
        let evaluation = Evaluation {
            run: self.run,
            nominal: self.nominal,
            egos,
            ados,
            context: None,
            starts: self.starts,
            search,
            tries,
            runs,
            keeps: false,
        };
        let Some(mut table) = evaluation.run(watch)? else {
            return Ok(None);
        };
        if let Some(error) = table.failure.take() {
            return Err(error);
        }
        if watch.stopped() {
            return Ok(None);
        }
        Ok(Some(Part {
            rows: table.rows(),
            told: table.adapted_to.pop(),
        }))
    }
}

/// One evaluation of an ego.
struct Part {
    rows: Vec<Row>,
    told: Option<AdaptedTo>,
}

impl Part {
    fn row(&self, ado: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.ado == ado)
    }
}

/// One world's rows as a Markdown table, with means and the worst below.
pub fn structures_markdown(world: &str, rows: &[StructureRow]) -> String {
    let mut text = format!(
        "`{world}`: recall of the starts that a search with at most {SWITCHES} switches solves. \
         *Reused*: the policy as it was trained, without a run of the ego; all others know it: \
         *adapted*, a plan per start after {RUNS} or {FEW_RUNS} runs.\n\n\
         | ego | training | search solves | reused policy | held random | best constant | \
         adapted, {RUNS} runs | at most {TRIES} tries | {FEW_RUNS} runs | beyond | off, m | expected | came |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
    );
    for row in rows {
        text.push_str(&line(row));
    }
    let telling: Vec<&StructureRow> = rows.iter().filter(|row| TELLING <= row.searched).collect();
    let over = |of: fn(&StructureRow) -> &SolvedBy| {
        let recalls: Vec<f64> = telling.iter().filter_map(|row| of(row).recall).collect();
        let mean = recalls.iter().sum::<f64>() / recalls.len().max(1) as f64;
        let worst = recalls.iter().copied().fold(f64::INFINITY, f64::min);
        match recalls.is_empty() {
            true => "–".to_owned(),
            false => format!("{mean:.2} ({worst:.2})"),
        }
    };
    text.push_str(&format!(
        "| mean (worst) of {} | | | {} | {} | {} | {} | {} | {} | | | | |\n",
        telling.len(),
        over(|row| &row.trained),
        over(|row| &row.held),
        over(|row| &row.constant),
        over(|row| &row.adapted),
        over(|row| &row.again),
        over(|row| &row.few),
    ));
    let expected = rows.iter().filter(|row| row.came().1).count();
    text.push_str(&format!(
        "\nMeans are over rows in which search solves {TELLING} starts or more. What came lies in the interval that was expected in {expected} of {} rows.\n",
        rows.len()
    ));
    text
}

fn line(row: &StructureRow) -> String {
    let recall = |met: &SolvedBy| {
        met.recall
            .map_or("–".to_owned(), |recall| format!("{recall:.2}"))
    };
    let off = row.off_m.map_or("–".to_owned(), |[own, keeping]| {
        format!("{own:.2} / {keeping:.2}")
    });
    let (expected, [low, high]) = row.expected;
    format!(
        "| {} | {} | {} of {} | {} | {} | {} | {} | {} | {} | {} | {off} | {:.0} % [{:.0}, {:.0}] | {:.0} % |\n",
        row.ego,
        row.seed,
        row.searched,
        row.starts,
        recall(&row.trained),
        recall(&row.held),
        recall(&row.constant),
        recall(&row.adapted),
        recall(&row.again),
        recall(&row.few),
        row.adapted.beyond,
        100.0 * expected,
        100.0 * low,
        100.0 * high,
        100.0 * row.came().0,
    )
}
