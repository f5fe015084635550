//! Summary of a merged campaign: rates, gates and maps.

use serde::Serialize;

use super::dir::PlanDir;
use super::file::RequestedStarts;
use super::plan::{Plan, PlannedAdo, Unit};
use crate::evaluation::GateOn;
use crate::run_dir::ClosingSpeed;
use crate::scene::Dynamics;
use crate::stats::{Flips, Outcomes, StartOutcome, at_most, seeds_interval, wilson};

/// Largest number of starts named in a gate.
const NAMED: usize = 100;

/// Counts over the rows of a unit.
pub(super) struct UnitCounts {
    /// Outcome per start.
    outcomes: Vec<StartOutcome>,
    /// Per start, whether CC_LATCHED or FSM would have avoided the failure.
    preventable: Vec<Option<bool>>,
    /// Closing speeds of the successes.
    closing_mps: Vec<f64>,
    contacts: usize,
    simulations: u64,
    physics_steps: u64,
}

impl UnitCounts {
    /// Returns an empty tally.
    pub(super) fn of(unit: &Unit) -> UnitCounts {
        UnitCounts {
            outcomes: vec![StartOutcome::NotReached; unit.starts],
            preventable: vec![None; unit.starts],
            closing_mps: Vec::new(),
            contacts: 0,
            simulations: 0,
            physics_steps: 0,
        }
    }

    /// Counts a row.
    pub(super) fn count(
        &mut self,
        start: usize,
        outcome: StartOutcome,
        (contact, closing_mps): (bool, Option<f64>),
        preventable: Option<bool>,
        (simulations, physics_steps): (u64, u64),
    ) {
        if let Some(one) = self.outcomes.get_mut(start) {
            *one = outcome;
        }
        if let Some(one) = self.preventable.get_mut(start) {
            *one = preventable;
        }
        // Contacts without a success, such as those of a foul, have no part in the statistics.
        if outcome == StartOutcome::Solved {
            self.closing_mps.extend(closing_mps);
        }
        self.contacts += usize::from(contact);
        self.simulations += simulations;
        self.physics_steps += physics_steps;
    }

    fn of_kind(&self, kind: StartOutcome) -> usize {
        let outcomes = self.outcomes.iter();
        outcomes.filter(|one| **one == kind).count()
    }

    /// Returns the outcomes in the form of rows of other verbs.
    fn marks(&self) -> Outcomes {
        self.outcomes.iter().copied().collect()
    }
}

/// Pair of an ego and an ado in a world, or the mean over its trainings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SummaryRow {
    /// Name of the world.
    pub world: String,
    /// The plant.
    pub plant: Dynamics,
    /// Name of the ego.
    pub ego: String,
    /// Name of the ado.
    pub ado: String,
    /// Seed of the training.
    ///
    /// `None`: no training, or several ([`SummaryRow::trainings`]).
    pub train_seed: Option<u64>,
    /// Number of trainings that the row averages.
    pub trainings: usize,
    /// Valid starts that are not trivial.
    pub starts: usize,
    /// Starts left out, because the nominal ego fails there by itself.
    pub trivial: usize,
    /// Starts from which the ego fails.
    pub fails: usize,
    /// fails / starts.
    pub success_rate: f64,
    /// 95 % interval of the rate.
    pub ci95: [f64; 2],
    /// Exact 95 % upper bound of the rate, if no start fails.
    pub at_most: Option<f64>,
    /// Share of the starts solved by the unit's search that fail here too.
    ///
    /// `None`: no search played this ego, or it solves no start.
    pub recall: Option<f64>,
    /// Starts on which the ado broke a rule.
    pub fouls: usize,
    /// Starts on which a violation does not count.
    pub uncounted: usize,
    /// Starts that ended in contact.
    pub(crate) contacts: usize,
    /// Successes that CC_LATCHED or FSM would have avoided. `None`: not judged.
    pub preventable: Option<usize>,
    /// Closing speed of the successes that end in contact.
    pub closing_mps: Option<ClosingSpeed>,
    /// Starts with a fault of the ego or the physics.
    pub invalid: usize,
    /// Number of episodes.
    pub simulations: u64,
    /// Number of physics steps.
    pub physics_steps: u64,
}

/// Comparison of a changed ego with the baseline, start by start.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GateVerdict {
    /// Name of the world.
    pub world: String,
    /// The plant.
    pub plant: Dynamics,
    /// Name of the ado.
    pub ado: String,
    /// Seed of its training.
    pub train_seed: Option<u64>,
    /// Name of the changed ego.
    pub ego: String,
    /// Name of the baseline ego.
    pub baseline: String,
    /// Starts that are valid and not trivial for both.
    pub compared: usize,
    /// Starts from which the ego fails and the baseline does not.
    pub newly_failing: usize,
    /// Such starts that CC_LATCHED or FSM would have survived.
    pub(crate) newly_preventable: usize,
    /// First newly failing starts.
    pub first: Vec<usize>,
    /// Starts from which the baseline fails and the ego does not.
    pub newly_fixed: usize,
    /// Exact two-sided p-value of McNemar's test.
    pub p_value: f64,
    /// Whether the gate blocks the change.
    pub held_up: bool,
}

/// Grid of starts, cell by cell, over its last two axes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct CellMap {
    /// Name of the world.
    pub world: String,
    /// The plant.
    pub plant: Dynamics,
    /// Name of the ego.
    pub ego: String,
    /// Axis x: name, unit, values.
    pub x: (String, String, Vec<f64>),
    /// Axis y: name, unit, values.
    pub y: (String, String, Vec<f64>),
    /// Name and value of each further axis, if the grid has more than two.
    pub at: Vec<(String, f64)>,
    /// Position of its first cell among the starts.
    pub first: usize,
    /// Names of the ados, in order.
    pub ados: Vec<String>,
    /// Outcome per ado and cell, row by row from the smallest y.
    pub outcomes: Vec<Vec<StartOutcome>>,
    /// Per ado and cell, whether CC_LATCHED or FSM would have avoided the failure.
    pub preventable: Vec<Vec<Option<bool>>>,
}

/// Summary of a merged campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CampaignSummary {
    /// Row per unit, and a row per ado with several trainings.
    pub rows: Vec<SummaryRow>,
    /// Comparison per changed ego. Empty: the campaign has no gate.
    pub gates: Vec<GateVerdict>,
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
            let PlannedAdo::Training { .. } = unit.ado else {
                continue;
            };
            let is_mate = |other: &&(&Unit, &UnitCounts)| {
                (other.0.world, &other.0.ego) == (unit.world, &unit.ego)
                    && matches!(other.0.ado, PlannedAdo::Training { .. })
            };
            let mates: Vec<&(&Unit, &UnitCounts)> = units.iter().filter(is_mate).collect();
            // The mean follows the last training of its group, so rows stay in plan order.
            let is_last = units[nth + 1..].iter().all(|other| !is_mate(&other));
            if 1 < mates.len() && is_last {
                let of: Vec<SummaryRow> =
                    mates.iter().map(|(u, t)| row(dir, &units, u, t)).collect();
                let marks: Vec<Outcomes> = mates.iter().map(|(_, tally)| tally.marks()).collect();
                rows.push(mean(&of, &marks));
            }
        }
        let gates = match &plan.gate {
            Some((baseline, on)) => gates(dir, &units, baseline, *on),
            None => Vec::new(),
        };
        CampaignSummary {
            rows,
            gates,
            maps: maps(dir, &units),
        }
    }

    /// Returns whether a gate of the campaign blocks a change.
    pub fn is_held_up(&self) -> bool {
        self.gates.iter().any(|gate| gate.held_up)
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

fn train_seed(plan: &Plan, unit: &Unit) -> Option<u64> {
    match unit.ado {
        PlannedAdo::Trained { run } => plan.ados.get(run).map(|run| run.seed),
        PlannedAdo::Training { training } => plan.trainings.get(training).map(|it| it.seed),
        _ => None,
    }
}

/// Returns the plant of a unit, as in rows.
fn plant(dir: &PlanDir, unit: &Unit) -> Dynamics {
    match unit.ego.change.plant {
        // A changed ego may name its own plant.
        Some(plant) => plant.into(),
        None => dir.played(unit).plant(),
    }
}

/// Returns the share of the starts solved by a search that an ado solves too.
fn recall(units: &[(&Unit, &UnitCounts)], unit: &Unit, tally: &UnitCounts) -> Option<f64> {
    let is_search = |(other, _): &&(&Unit, &UnitCounts)| {
        (other.world, &other.ego) == (unit.world, &unit.ego)
            && matches!(other.ado, PlannedAdo::Search { .. })
    };
    let (_, searched) = units.iter().find(is_search)?;
    let fails = |one: &StartOutcome| *one == StartOutcome::Solved;
    let pairs = searched.outcomes.iter().zip(&tally.outcomes);
    let (both, solved) = pairs
        .filter(|(theirs, _)| fails(theirs))
        .fold((0usize, 0usize), |(both, solved), (_, mine)| {
            (both + usize::from(fails(mine)), solved + 1)
        });
    (0 < solved).then(|| both as f64 / solved as f64)
}

fn row(
    dir: &PlanDir,
    units: &[(&Unit, &UnitCounts)],
    unit: &Unit,
    tally: &UnitCounts,
) -> SummaryRow {
    let plan = dir.plan();
    let fails = tally.of_kind(StartOutcome::Solved);
    let [held, fouls, uncounted] = [
        StartOutcome::Held,
        StartOutcome::RuleViolation,
        StartOutcome::Uncounted,
    ]
    .map(|kind| tally.of_kind(kind));
    let starts = fails + held + fouls + uncounted;
    let judged = plan.preventability;
    let avoided = tally.preventable.iter().filter(|it| **it == Some(true));
    SummaryRow {
        world: dir.world(unit).name().to_owned(),
        plant: plant(dir, unit),
        ego: unit.ego.name.clone(),
        ado: unit.ado.word(),
        train_seed: train_seed(plan, unit),
        trainings: usize::from(train_seed(plan, unit).is_some()),
        starts,
        trivial: tally.of_kind(StartOutcome::Trivial),
        fails,
        success_rate: fails as f64 / starts.max(1) as f64,
        ci95: wilson(fails, starts),
        at_most: (fails == 0 && 0 < starts).then(|| at_most(starts)),
        recall: match unit.ado {
            PlannedAdo::Search { .. } => None,
            _ => recall(units, unit, tally),
        },
        fouls,
        uncounted,
        contacts: tally.contacts,
        preventable: judged.then(|| avoided.count()),
        closing_mps: ClosingSpeed::of(tally.closing_mps.clone()),
        invalid: tally.of_kind(StartOutcome::Invalid),
        simulations: tally.simulations,
        physics_steps: tally.physics_steps,
    }
}

/// Returns the mean over trainings on the same starts.
fn mean(rows: &[SummaryRow], marks: &[Outcomes]) -> SummaryRow {
    let sum = |of: fn(&SummaryRow) -> usize| rows.iter().map(of).sum::<usize>();
    let marks: Vec<&Outcomes> = marks.iter().collect();
    let (starts, fails) = (sum(|row| row.starts), sum(|row| row.fails));
    let rates = rows.iter().map(|row| row.success_rate);
    SummaryRow {
        train_seed: None,
        trainings: rows.len(),
        starts,
        // Trivial starts depend on the world only, so they are equal in all rows.
        trivial: rows[0].trivial,
        fails,
        success_rate: rates.sum::<f64>() / rows.len().max(1) as f64,
        // The interval covers both the starts and the seeds of the trainings.
        ci95: seeds_interval(&marks),
        at_most: None,
        recall: {
            // A mean over some trainings only would compare different ados.
            let all: Option<Vec<f64>> = rows.iter().map(|row| row.recall).collect();
            all.map(|all| all.iter().sum::<f64>() / all.len().max(1) as f64)
        },
        fouls: sum(|row| row.fouls),
        uncounted: sum(|row| row.uncounted),
        contacts: sum(|row| row.contacts),
        preventable: rows[0]
            .preventable
            .map(|_| sum(|row| row.preventable.unwrap_or(0))),
        closing_mps: None,
        invalid: sum(|row| row.invalid),
        simulations: rows.iter().map(|row| row.simulations).sum(),
        physics_steps: rows.iter().map(|row| row.physics_steps).sum(),
        ..rows[0].clone()
    }
}

fn gates(
    dir: &PlanDir,
    units: &[(&Unit, &UnitCounts)],
    baseline: &str,
    on: GateOn,
) -> Vec<GateVerdict> {
    let mut gates = Vec::new();
    for (unit, tally) in units.iter().filter(|(unit, _)| unit.ego.name != baseline) {
        let is_before = |(other, _): &&(&Unit, &UnitCounts)| {
            other.ego.name == baseline && other.world == unit.world && other.ado == unit.ado
        };
        let Some((_, before)) = units.iter().find(is_before) else {
            continue;
        };
        let flips = Flips::of(&tally.outcomes, &before.outcomes);
        let preventable = || {
            let starts = flips.newly_failing.iter();
            starts.map(|start| tally.preventable[*start])
        };
        gates.push(GateVerdict {
            world: dir.world(unit).name().to_owned(),
            plant: plant(dir, unit),
            ado: unit.ado.word(),
            train_seed: train_seed(dir.plan(), unit),
            ego: unit.ego.name.clone(),
            baseline: baseline.to_owned(),
            compared: flips.compared,
            newly_failing: flips.newly_failing.len(),
            newly_preventable: preventable().filter(|it| *it == Some(true)).count(),
            first: flips.newly_failing.iter().copied().take(NAMED).collect(),
            newly_fixed: flips.newly_fixed.len(),
            p_value: flips.p_value(),
            held_up: on.blocks(preventable()),
        });
    }
    gates
}

fn maps(dir: &PlanDir, units: &[(&Unit, &UnitCounts)]) -> Vec<CellMap> {
    let RequestedStarts::Grid { axes, .. } = &dir.plan().starts else {
        return Vec::new();
    };
    // A grid with fewer than two axes has no map.
    let [others @ .., y, x] = &axes[..] else {
        return Vec::new();
    };
    let mut maps: Vec<CellMap> = Vec::new();
    let cells = x.1.len() * y.1.len();
    let slices: usize = others.iter().map(|(_, values)| values.len()).product();
    let mut seen: Vec<(usize, &str)> = Vec::new();
    for (unit, _) in units {
        let key = (unit.world, unit.ego.name.as_str());
        if seen.contains(&key) {
            continue;
        }
        seen.push(key);
        let of_key =
            |(other, _): &&(&Unit, &UnitCounts)| (other.world, other.ego.name.as_str()) == key;
        let all: Vec<&(&Unit, &UnitCounts)> = units.iter().filter(of_key).collect();
        let world = dir.world(unit);
        let unit_of = |name: &str| {
            let axes = world.axes();
            let axis = axes.iter().find(|axis| axis.name == name);
            axis.map_or("", |axis| axis.unit).to_owned()
        };
        for slice in 0..slices {
            let mut left = slice;
            let mut at = Vec::new();
            // The last of these axes varies fastest between slices, as in `point`.
            for (name, values) in others.iter().rev() {
                at.push((name.clone(), values[left % values.len()]));
                left /= values.len();
            }
            at.reverse();
            let cut = |nth: usize| slice * cells + nth;
            let outcome = |tally: &UnitCounts, nth| {
                let outcome = tally.outcomes.get(cut(nth)).copied();
                // A missing outcome is shown as unknown.
                let known = outcome.filter(|outcome| *outcome != StartOutcome::NotReached);
                known.unwrap_or(StartOutcome::Invalid)
            };
            let outcomes = |(_, tally): &&(&Unit, &UnitCounts)| -> Vec<StartOutcome> {
                (0..cells).map(|nth| outcome(tally, nth)).collect()
            };
            let preventable = |(_, tally): &&(&Unit, &UnitCounts)| -> Vec<Option<bool>> {
                let one = |nth: usize| tally.preventable.get(cut(nth)).copied().flatten();
                (0..cells).map(one).collect()
            };
            maps.push(CellMap {
                world: world.name().to_owned(),
                plant: plant(dir, unit),
                ego: unit.ego.name.clone(),
                x: (x.0.clone(), unit_of(&x.0), x.1.clone()),
                y: (y.0.clone(), unit_of(&y.0), y.1.clone()),
                at,
                first: slice * cells,
                ados: all.iter().map(|(unit, _)| unit.ado.word()).collect(),
                outcomes: all.iter().map(outcomes).collect(),
                preventable: all.iter().map(preventable).collect(),
            });
        }
    }
    maps
}
