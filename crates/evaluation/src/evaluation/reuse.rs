//! Summary of an ado's rows on many egos, as in a reuse table (Sec. IV).
//!
//! Rows are grouped by the relation of their ego to the training. Ados are compared by
//! mean success, by mean recall, and by the paired difference to a reference ado. The
//! recall counts only egos that an adversary can make fail.

use serde::{Deserialize, Serialize};

use crate::adversary::{Ado, eval};
use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::run_dir::{AdversaryId, ChangedEgo, FailsAlone, Row, RunDir, adversary_keys};
use crate::search::ExperimentCell;
use crate::stats::{Outcomes, StartOutcome, mean_difference};
use crate::world::{Scenario, TrainingEgos};

/// Least share of starts that a search must solve for a recall of an ego.
///
/// Below it a few starts would determine the recall.
pub const LEAST_REACHABLE: f64 = 0.10;

/// Relation of an ego to the training of an ado.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Relation {
    /// The very ego it was trained against.
    Trained,
    /// Not part of the training, which had the nominal ego only (the paper's claim).
    ZeroShot,
    /// Inside the family of egos it was trained against.
    Inside,
    /// Outside that family.
    Outside,
    /// Every changed ego, inside or outside: a block of summaries only.
    Changed,
}

impl Relation {
    /// The heading of its block in tables.
    pub fn heading(&self) -> &'static str {
        match self {
            Relation::Trained => "the ego it was trained against",
            Relation::ZeroShot => "trained on the nominal ego, reused zero-shot",
            Relation::Inside => "inside the family it was trained against",
            Relation::Outside => "outside that family",
            Relation::Changed => "all changed egos",
        }
    }
}

impl Relation {
    /// Returns the relation of the ego to the ado of a run, whose world is `nominal`.
    pub fn of(ego: &EgoUnderTest, run: &RunDir, nominal: &Scenario) -> Relation {
        let trained = run.manifest().ego.as_ref();
        if ego.is_own() || trained.is_some_and(ChangedEgo::is_own) {
            // Of such an ego nothing is known but its name.
            return if ego.is_own() && trained.is_some_and(|other| other.name == ego.name()) {
                Relation::Trained
            } else {
                Relation::ZeroShot
            };
        }
        let trained = trained.map(|ego| &ego.change);
        // An ego is compared by its changes, because names can differ.
        if *ego.change() == trained.cloned().unwrap_or_default() {
            return Relation::Trained;
        }
        match (nominal.against, nominal.family()) {
            (TrainingEgos::Nominal, _) | (_, None) => Relation::ZeroShot,
            (_, Some(family)) if family.covers(ego.change()) => Relation::Inside,
            _ => Relation::Outside,
        }
    }
}

/// One ego of a reuse table.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ReusedOn {
    /// Name of the ego, as rows call it.
    pub ego: String,
    /// Relation of the ego to the training.
    pub relation: Relation,
    /// Share of all drawn starts from which this ego fails while the ados coast.
    ///
    /// Trivial starts are included. `None` here and below: interrupted.
    pub fails_without_adversary: Option<f64>,
    /// Share of the evaluated starts that search solves, if it ran.
    pub reachable: Option<f64>,
    /// Share solved by search or by any ado of the table.
    pub union: Option<f64>,
    /// Rows of the ego. JSON has them beside the egos, not inside.
    #[serde(skip)]
    pub rows: Vec<Row>,
}

/// Collects the rows of an ego, and plays it once with coasting ados.
///
/// `starts` are those of `rows`.
pub fn reused_on(
    ego: &EgoUnderTest,
    relation: Relation,
    starts: &TestStarts,
    rows: Vec<Row>,
    watch: &Watch<'_>,
) -> ReusedOn {
    reused_with_coasting(ego, relation, starts, rows, watch).0
}

/// Collects the rows of an ego, with its cell of coasting ados over all starts.
pub(super) fn reused_with_coasting(
    ego: &EgoUnderTest,
    relation: Relation,
    starts: &TestStarts,
    mut rows: Vec<Row>,
    watch: &Watch<'_>,
) -> (ReusedOn, ExperimentCell) {
    let all = TestStarts {
        // All starts are played here, the trivial starts of the nominal ego included.
        trivial: vec![false; starts.starts.len()],
        ..starts.clone()
    };
    let evaluated = eval(&ego.against(Ado::Neutral, &all), watch);
    let alone = ExperimentCell::evaluated(ego, &all, evaluated);
    let coasting = &alone.row;
    let whole = coasting.partial.is_none();
    for row in &mut rows {
        row.fails_alone = (whole && !row.is_unrepeatable()).then_some(FailsAlone {
            starts: coasting.successes,
            left_out: false,
        });
    }
    let search = rows
        .iter()
        .find(|row| row.ado.is_search())
        // An interrupted search has not tried all starts, so its share is unknown. So is
        // that of an ego that never ran.
        .filter(|row| row.partial.is_none() && row.starts > 0);
    let reused = ReusedOn {
        ego: ego.name().to_owned(),
        relation,
        fails_without_adversary: (whole && coasting.starts > 0).then_some(coasting.success_rate),
        reachable: search.map(|row| row.success_rate),
        union: union(&rows),
        rows,
    };
    (reused, alone)
}

/// Share of the starts with a result in some row that any row solves.
///
/// Rows may have different numbers of starts. `None`: a row was interrupted.
fn union(rows: &[Row]) -> Option<f64> {
    if rows.iter().any(|row| row.partial.is_some()) {
        return None;
    }
    let most = rows.iter().map(|row| row.solved.len()).max().unwrap_or(0);
    let outcomes = |start: usize| rows.iter().filter_map(move |row| row.solved.get(start));
    let is_solved = |start: &usize| outcomes(*start).any(|it| *it == StartOutcome::Solved);
    let has_result = |start: &usize| outcomes(*start).any(|it| it.score().is_some());
    let solved = (0..most).filter(is_solved).count();
    let evaluated = (0..most).filter(has_result).count();
    // Without starts the share is 0, not NaN.
    Some(solved as f64 / evaluated.max(1) as f64)
}

/// Summary of an ado on the egos of a block.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Relation of the block's egos to the training.
    pub relation: Relation,
    /// Adversary, with the keys that rows have.
    #[serde(flatten, serialize_with = "adversary_keys::serialize")]
    pub ado: AdversaryId,
    /// Egos in the block on which it was played.
    pub egos: usize,
    /// Mean success rate over them.
    pub success_rate: f64,
    /// Egos of which [`LEAST_REACHABLE`] or more is reachable.
    pub egos_with_recall: usize,
    /// Mean recall over those.
    pub recall_mean: Option<f64>,
    /// The least recall among them, and on which ego.
    pub recall_min: Option<(f64, String)>,
    /// Reference ado minus this ado: mean difference of their success rates.
    ///
    /// The mean is over the block's egos, paired on starts, with its 95 % interval.
    pub reference_minus: Option<(f64, [f64; 2])>,
    /// Mean simulations per start.
    pub sims_per_start: f64,
}

/// Sums up every block of a reuse table, ado by ado, in the rows' order.
///
/// Where changed egos are in several blocks, one more block has all of them.
pub fn summarise(egos: &[ReusedOn], reference: &AdversaryId) -> Vec<Summary> {
    let mut relations: Vec<Relation> = egos.iter().map(|ego| ego.relation).collect();
    // The order of the enum is that of the blocks in the table.
    relations.sort();
    relations.dedup();
    let changed = |relation: &Relation| *relation != Relation::Trained;
    // With a single relation the block of all changed egos would repeat it.
    if relations.iter().copied().filter(changed).count() > 1 {
        relations.push(Relation::Changed);
    }
    let mut summaries = Vec::new();
    for relation in relations {
        let of_block = |ego: &&ReusedOn| match relation {
            Relation::Changed => changed(&ego.relation),
            one => ego.relation == one,
        };
        let block: Vec<&ReusedOn> = egos.iter().filter(of_block).collect();
        for ado in ados(&block) {
            summaries.push(summary(relation, &block, &ado, reference));
        }
    }
    summaries
}

/// The ados of a block, each once, in the order of the rows.
fn ados(block: &[&ReusedOn]) -> Vec<AdversaryId> {
    let mut ados: Vec<AdversaryId> = Vec::new();
    for row in block.iter().flat_map(|ego| &ego.rows) {
        if !ados.contains(&row.ado) {
            ados.push(row.ado.clone());
        }
    }
    ados
}

fn summary(
    relation: Relation,
    block: &[&ReusedOn],
    ado: &AdversaryId,
    reference: &AdversaryId,
) -> Summary {
    let of = |ego: &ReusedOn, ado: &AdversaryId| -> Vec<Row> {
        // Interrupted rows, rows without a valid start and those of an ego that depends on
        // more than the episode have no rate to average.
        let has_rate =
            |row: &&Row| row.partial.is_none() && row.starts > 0 && !row.is_unrepeatable();
        let rows = ego
            .rows
            .iter()
            .filter(has_rate)
            .filter(|row| row.ado == *ado);
        rows.cloned().collect()
    };
    let played: Vec<(&ReusedOn, Vec<Row>)> = block
        .iter()
        .map(|ego| (*ego, of(ego, ado)))
        .filter(|(_, rows)| !rows.is_empty())
        .collect();
    // Egos that no search can make fail would have a recall by chance.
    let reachable = played
        .iter()
        .filter(|(ego, _)| ego.reachable.is_some_and(|share| share >= LEAST_REACHABLE));
    let recalls: Vec<(f64, String)> = reachable
        .filter_map(|(ego, rows)| {
            let recalls: Option<Vec<f64>> = rows.iter().map(|row| row.recall).collect();
            // An ego without a recall in every training has no mean.
            Some((mean(recalls?.into_iter())?, ego.ego.clone()))
        })
        .collect();
    let rows = || played.iter().flat_map(|(_, rows)| rows);
    let compared: Vec<(Vec<Row>, &Vec<Row>)> = played
        .iter()
        .map(|(ego, rows)| (of(ego, reference), rows))
        // The reference minus itself would be 0 in every table.
        .filter(|(compared, _)| ado != reference && !compared.is_empty())
        .collect();
    let pairs: Vec<(Vec<&Outcomes>, Vec<&Outcomes>)> = compared
        .iter()
        .map(|(compared, rows)| (solved(compared), solved(rows)))
        .collect();
    Summary {
        relation,
        ado: ado.clone(),
        egos: played.len(),
        success_rate: mean(rows().map(|row| row.success_rate)).unwrap_or(0.0),
        egos_with_recall: recalls.len(),
        recall_mean: mean(recalls.iter().map(|(recall, _)| *recall)),
        recall_min: recalls.iter().min_by(|a, b| a.0.total_cmp(&b.0)).cloned(),
        reference_minus: (!pairs.is_empty()).then(|| mean_difference(&pairs)),
        sims_per_start: mean(rows().map(|row| row.sims_per_start)).unwrap_or(0.0),
    }
}

fn solved(rows: &[Row]) -> Vec<&Outcomes> {
    rows.iter().map(|row| &row.solved).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(solved: &str) -> Row {
        let json = serde_json::json!({
            "world": "acc", "plant": "Kinematic", "judge": "UntilViolation", "ego": "nominal",
            "ado": "hold", "method": "some", "train_seed": null, "start_seed": 0,
            "starts": solved.len(), "trivial": 0, "successes": 0, "success_rate": 0.0,
            "ci95": [0.0, 1.0], "foul_rate": 0.0, "contact_rate": 0.0, "invalid": 0,
            "sims_per_start": 1.0, "physics_steps": 0, "cpu_s": 0.0, "solved": solved,
        });
        serde_json::from_value(json).expect("a row")
    }

    #[test]
    fn a_union_counts_every_start_of_rows_of_any_length() {
        let union = |solved: &[&str]| {
            let rows: Vec<Row> = solved.iter().map(|it| row(it)).collect();
            super::union(&rows)
        };
        assert_eq!(union(&["1000", "0100"]), Some(0.5));
        assert_eq!(union(&["1000", "01"]), Some(0.5));
        assert_eq!(union(&["01", "1000"]), Some(0.5));
        // A trivial start has no result, and an invalid one may have one in another row.
        assert_eq!(union(&["t1x0", "t010"]), Some(2.0 / 3.0));
        assert_eq!(union(&[]), Some(0.0));
    }
}
