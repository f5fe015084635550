//! Summary of a merged campaign: rates, gates and maps.

use serde::Serialize;

use super::cell_map::CellMap;
use super::dir::PlanDir;
use super::plan::Unit;
use super::unit_counts::{UnitCounts, plant};
use super::unit_gate::UnitGate;
use crate::preventability::Avoidability;
use crate::run_dir::{AdversaryId, ClosingSpeed, adversary_keys};
use crate::scene::Dynamics;
use crate::stats::{Outcomes, StartOutcome, at_most, seeds_interval, wilson};

/// Pair of an ego and an ado in a world, or the mean over its trainings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SummaryRow {
    /// Name of the world.
    pub world: String,
    /// The plant.
    pub plant: Dynamics,
    /// Name of the ego.
    pub ego: String,
    /// Ado, which JSON has as `adversary` and with its caption as `ado`.
    #[serde(flatten, serialize_with = "adversary_keys::serialize")]
    pub ado: AdversaryId,
    /// Seed of the training.
    ///
    /// `None`: no training, or several ([`SummaryRow::trainings`]).
    pub train_seed: Option<u64>,
    /// Number of trainings of the row.
    pub trainings: usize,
    /// Trainings without a valid start, left out of the mean rate and recall.
    pub unrated: usize,
    /// Valid starts that are not trivial.
    pub starts: usize,
    /// Starts left out, because the nominal ego fails there by itself.
    pub trivial: usize,
    /// Starts from which the ego fails.
    pub successes: usize,
    /// successes / starts.
    pub success_rate: f64,
    /// 95 % interval of the rate.
    pub ci95: [f64; 2],
    /// Exact 95 % upper bound of the rate, if no start fails.
    pub at_most: Option<f64>,
    /// Share of the starts solved by the unit's search that fail here too.
    ///
    /// `None`: no search played this ego, or it solves no start.
    pub recall: Option<f64>,
    /// Share of starts on which the ado broke a rule.
    pub foul_rate: f64,
    /// Starts on which a violation does not count.
    pub uncounted: usize,
    /// Share of starts that ended in contact.
    pub contact_rate: f64,
    /// Successes that CC_LATCHED or FSM would have avoided. `None`: not judged.
    pub preventable: Option<usize>,
    /// Closing speed of the successes that end in contact.
    pub success_closing_mps: Option<ClosingSpeed>,
    /// Starts with a fault of the ego or the physics.
    pub invalid: usize,
    /// Mean number of simulations per start.
    pub sims_per_start: f64,
    /// Number of physics steps.
    pub physics_steps: u64,
}

/// Summary of a merged campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CampaignSummary {
    /// Row per unit, and a row per ado with several trainings.
    pub rows: Vec<SummaryRow>,
    /// Comparison per changed ego. Empty: the campaign has no gate.
    pub gates: Vec<UnitGate>,
    /// Maps of a grid of starts. They are not in the JSON, because the rows are.
    #[serde(skip)]
    pub(crate) maps: Vec<CellMap>,
}

impl CampaignSummary {
    pub(super) fn of(dir: &PlanDir, tallies: Vec<UnitCounts>) -> CampaignSummary {
        let plan = dir.plan();
        let units: Vec<(&Unit, &UnitCounts)> = plan.units.iter().zip(&tallies).collect();
        let mut rows = Vec::new();
        for (nth, (unit, tally)) in units.iter().enumerate() {
            rows.push(row(dir, &units, unit, tally));
            if unit.ado.training.is_none() {
                continue;
            }
            let is_mate = |other: &&(&Unit, &UnitCounts)| {
                (other.0.world, &other.0.ego) == (unit.world, &unit.ego)
                    && other.0.ado.training.is_some()
            };
            // The mean follows the last training of its group, so rows stay in plan order.
            if units[nth + 1..].iter().any(|other| is_mate(&other)) {
                continue;
            }
            let mates: Vec<&(&Unit, &UnitCounts)> = units.iter().filter(is_mate).collect();
            if mates.len() > 1 {
                let of: Vec<SummaryRow> =
                    mates.iter().map(|(u, t)| row(dir, &units, u, t)).collect();
                let marks: Vec<Outcomes> = mates.iter().map(|(_, tally)| tally.marks()).collect();
                rows.push(mean(&of, &marks));
            }
        }
        let gates = match &plan.gate {
            Some((baseline, on)) => UnitGate::all(dir, &units, baseline, on),
            None => Vec::new(),
        };
        CampaignSummary {
            rows,
            gates,
            maps: CellMap::all(dir, &units),
        }
    }

    /// Returns whether a gate of the campaign blocks a change.
    pub fn has_closed_gate(&self) -> bool {
        self.gates.iter().any(|gate| gate.decided.is_closed())
    }

    /// Returns whether there are gates, and none of them compares a start.
    pub fn is_unanswered(&self) -> bool {
        !self.gates.is_empty() && self.gates.iter().all(UnitGate::is_unanswered)
    }

    /// Returns the largest share of invalid starts in a row.
    pub fn invalid_share(&self) -> f64 {
        let share = |row: &SummaryRow| {
            let all = row.starts + row.invalid;
            row.invalid as f64 / all.max(1) as f64
        };
        self.rows.iter().map(share).fold(0.0, f64::max)
    }
}

/// Returns the share of the starts solved by a search that an ado solves too.
fn recall(units: &[(&Unit, &UnitCounts)], unit: &Unit, tally: &UnitCounts) -> Option<f64> {
    let is_search = |(other, _): &&(&Unit, &UnitCounts)| {
        (other.world, &other.ego) == (unit.world, &unit.ego) && other.ado.id.is_search()
    };
    // The first search of the plan is the yardstick, so all ados of an ego are measured
    // alike.
    let (_, searched) = units.iter().find(is_search)?;
    let fails = |one: &StartOutcome| *one == StartOutcome::Solved;
    let pairs = searched.outcomes.iter().zip(&tally.outcomes);
    let (both, solved) = pairs
        .filter(|(theirs, _)| fails(theirs))
        .fold((0usize, 0usize), |(both, solved), (_, mine)| {
            (both + usize::from(fails(mine)), solved + 1)
        });
    (solved > 0).then(|| both as f64 / solved as f64)
}

fn row(
    dir: &PlanDir,
    units: &[(&Unit, &UnitCounts)],
    unit: &Unit,
    tally: &UnitCounts,
) -> SummaryRow {
    let plan = dir.plan();
    let train_seed = plan.train_seed(&unit.ado);
    let fails = tally.of_kind(StartOutcome::Solved);
    let [held, fouls, uncounted] = [
        StartOutcome::Held,
        StartOutcome::RuleViolation,
        StartOutcome::Uncounted,
    ]
    .map(|kind| tally.of_kind(kind));
    // Invalid starts are no evidence in either direction, so no rate has them in its
    // base.
    let starts = fails + held + fouls + uncounted;
    let per_start = |count: f64| count / starts.max(1) as f64;
    let judged = plan.preventability;
    let avoided = tally
        .avoidability
        .iter()
        .filter(|it| **it == Avoidability::Preventable);
    let closing = tally.success_contacts.values();
    SummaryRow {
        world: dir.world(unit).name().to_owned(),
        plant: plant(dir, unit),
        ego: unit.ego.name.clone(),
        ado: unit.ado.id.clone(),
        train_seed,
        trainings: usize::from(train_seed.is_some()),
        unrated: 0,
        starts,
        trivial: tally.of_kind(StartOutcome::Trivial),
        successes: fails,
        success_rate: per_start(fails as f64),
        ci95: wilson(fails, starts),
        // Without a start the exact bound does not exist, and 0 failures of 0 prove
        // nothing.
        at_most: (fails == 0 && starts > 0).then(|| at_most(starts)),
        recall: (!unit.ado.id.is_search())
            .then(|| recall(units, unit, tally))
            .flatten(),
        foul_rate: per_start(fouls as f64),
        uncounted,
        contact_rate: per_start(tally.contacts as f64),
        preventable: judged.then(|| avoided.count()),
        success_closing_mps: ClosingSpeed::of(closing.map(|it| it.closing_mps).collect()),
        invalid: tally.of_kind(StartOutcome::Invalid),
        sims_per_start: per_start(tally.simulations as f64),
        physics_steps: tally.physics_steps,
    }
}

/// Returns the mean over trainings on the same starts.
fn mean(rows: &[SummaryRow], marks: &[Outcomes]) -> SummaryRow {
    let sum = |of: fn(&SummaryRow) -> usize| rows.iter().map(of).sum::<usize>();
    // A training without a valid start has no rate, and its 0 would lower the mean.
    let (rated, rated_marks): (Vec<&SummaryRow>, Vec<&Outcomes>) = rows
        .iter()
        .zip(marks)
        .filter(|(row, _)| row.starts > 0)
        .unzip();
    // Trainings play the same starts, of which some may be invalid for one of them only.
    let mean = |of: fn(&SummaryRow) -> f64| {
        let weighted = rows.iter().map(|row| row.starts as f64 * of(row));
        weighted.sum::<f64>() / sum(|row| row.starts).max(1) as f64
    };
    let rates = rated.iter().map(|row| row.success_rate);
    SummaryRow {
        train_seed: None,
        trainings: rows.len(),
        unrated: rows.len() - rated.len(),
        starts: sum(|row| row.starts),
        // Trivial starts depend on the world only, so they are equal in all rows.
        trivial: rows[0].trivial,
        successes: sum(|row| row.successes),
        success_rate: rates.sum::<f64>() / rated.len().max(1) as f64,
        // The interval covers both the starts and the seeds of the trainings.
        ci95: seeds_interval(&rated_marks),
        // The exact bound is for one policy, and a mean has several.
        at_most: None,
        recall: {
            // A mean over some trainings only would compare different ados.
            let all: Option<Vec<f64>> = rated.iter().map(|row| row.recall).collect();
            all.filter(|all| !all.is_empty())
                .map(|all| all.iter().sum::<f64>() / all.len() as f64)
        },
        foul_rate: mean(|row| row.foul_rate),
        uncounted: sum(|row| row.uncounted),
        contact_rate: mean(|row| row.contact_rate),
        preventable: rows[0]
            .preventable
            .map(|_| sum(|row| row.preventable.unwrap_or(0))),
        // Quantiles of trainings cannot be averaged.
        success_closing_mps: None,
        invalid: sum(|row| row.invalid),
        sims_per_start: mean(|row| row.sims_per_start),
        physics_steps: rows.iter().map(|row| row.physics_steps).sum(),
        ..rows[0].clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn training(starts: usize, successes: usize) -> SummaryRow {
        SummaryRow {
            world: String::new(),
            plant: Dynamics::Kinematic,
            ego: String::new(),
            ado: AdversaryId::Hold,
            train_seed: Some(1),
            trainings: 1,
            unrated: 0,
            starts,
            trivial: 0,
            successes,
            success_rate: successes as f64 / starts.max(1) as f64,
            ci95: wilson(successes, starts),
            at_most: None,
            recall: Some(if starts > 0 { 0.5 } else { 0.0 }),
            foul_rate: 0.0,
            uncounted: 0,
            contact_rate: 0.0,
            preventable: None,
            success_closing_mps: None,
            invalid: 4 - starts,
            sims_per_start: 1.0,
            physics_steps: 0,
        }
    }

    fn marks(text: &str) -> Outcomes {
        text.parse().expect("marks")
    }

    #[test]
    fn a_training_without_a_valid_start_does_not_lower_the_mean() {
        let rows = [training(4, 4), training(0, 0), training(4, 2)];
        let mean_row = mean(&rows, &[marks("1111"), marks("xxxx"), marks("1010")]);
        assert_eq!((mean_row.trainings, mean_row.unrated), (3, 1));
        assert_eq!((mean_row.starts, mean_row.invalid), (8, 4));
        assert_eq!((mean_row.success_rate, mean_row.recall), (0.75, Some(0.5)));
        let of_rated = mean(
            &[training(4, 4), training(4, 2)],
            &[marks("1111"), marks("1010")],
        );
        assert_eq!(mean_row.ci95, of_rated.ci95);
        assert!(mean_row.cells()[1].ends_with("mean of 3, 1 without a valid start"));
        let none = mean(
            &[training(0, 0), training(0, 0)],
            &[marks("xxxx"), marks("xxxx")],
        );
        assert_eq!(
            (none.unrated, none.recall, none.ci95),
            (2, None, [0.0, 1.0])
        );
        assert_eq!(of_rated.cells()[1].matches("without").count(), 0);
        let dashes = |row: &SummaryRow| row.cells().iter().filter(|cell| *cell == "–").count();
        // Rate, interval, fouls and contacts are unknown, beside what is not recorded.
        assert_eq!(dashes(&none), 7);
        assert_eq!(dashes(&of_rated), 2);
    }
}
