//! Decisions of runs, with the targets of V.

use rayon::prelude::*;

use super::record::RiskRun;
use crate::rl::LearnerRng;

/// Least value, below which no failure is expected.
pub(super) const LEAST: f64 = 1e-8;

/// Decisions without a failure of which a sweep computes targets.
const OTHERS: usize = 40_000;

/// V while it is fitted.
pub(super) trait ActionValues: Sync {
    /// Returns the number of heads.
    fn heads(&self) -> usize;

    /// Returns Σ p · V over all actions but one, of every head.
    fn means_without(&self, input: &[f32], law: &[f32], without: usize) -> Vec<f64>;
}

/// Decisions of runs as a table, with targets.
pub(super) struct Decisions<'a> {
    pub(super) runs: &'a [(&'a RiskRun, Vec<bool>)],
    /// Run and decision of each row.
    pub(super) rows: Vec<(usize, usize)>,
    /// First row of each run.
    first: Vec<usize>,
    /// Rows of runs that fail.
    failing: Vec<usize>,
    /// Runs that do not fail.
    others: Vec<usize>,
}

/// Targets of a sweep.
pub(super) struct Targets {
    /// Targets of every row and head, `[rows, heads]`.
    pub(super) values: Vec<f64>,
    /// Rows that have a target.
    pub(super) rows: Vec<usize>,
}

impl<'a> Decisions<'a> {
    pub(super) fn of(runs: &'a [(&'a RiskRun, Vec<bool>)]) -> Decisions<'a> {
        let (mut rows, mut first, mut failing) = (Vec::new(), Vec::new(), Vec::new());
        let mut others = Vec::new();
        for (run, (played, fails)) in runs.iter().enumerate() {
            first.push(rows.len());
            if !fails.contains(&true) {
                others.push(run);
            }
            for decision in 0..played.actions.len() {
                if fails.contains(&true) {
                    failing.push(rows.len());
                }
                rows.push((run, decision));
            }
        }
        Decisions {
            runs,
            rows,
            first,
            failing,
            others,
        }
    }

    /// Returns the runs of a sweep: all that fail, and some of the others.
    pub(super) fn sweep_runs(&self, dice: &mut LearnerRng) -> Vec<usize> {
        let is_other = |run: usize| self.others.binary_search(&run).is_ok();
        let mut all: Vec<usize> = (0..self.runs.len()).filter(|it| !is_other(*it)).collect();
        let other_rows = self.rows.len() - self.failing.len();
        if other_rows <= OTHERS {
            return (0..self.runs.len()).collect();
        }
        // A sweep draws few of their decisions, and targets of the rest would be wasted.
        let most = self.others.len() * OTHERS / other_rows;
        all.extend((0..most).map(|_| self.others[dice.below(self.others.len())]));
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Returns the targets of some runs under V.
    pub(super) fn targets(&self, value: &impl ActionValues, runs: &[usize]) -> Targets {
        let heads = value.heads();
        let found = runs.par_iter().map(|run| self.run_targets(value, *run));
        let found: Vec<Vec<f64>> = found.collect();
        let mut targets = Targets {
            values: vec![LEAST; self.rows.len() * heads],
            rows: Vec::new(),
        };
        for (run, found) in runs.iter().zip(found) {
            let row = self.first[*run];
            targets.values[row * heads..][..found.len()].copy_from_slice(&found);
            targets.rows.extend(row..row + found.len() / heads);
        }
        targets
    }

    /// Returns the targets of a run, `[decisions, heads]`.
    fn run_targets(&self, value: &impl ActionValues, run: usize) -> Vec<f64> {
        let (run, fails) = &self.runs[run];
        let heads = value.heads();
        let mut targets = vec![LEAST; run.actions.len() * heads];
        // Not 0, because values are compared on a logarithmic scale.
        let end = fails.iter().map(|it| if *it { 1.0 } else { LEAST });
        let mut next: Vec<f64> = end.collect();
        for decision in (0..run.actions.len()).rev() {
            targets[decision * heads..][..heads].copy_from_slice(&next);
            // No earlier decision reads the value of the first.
            if decision == 0 {
                break;
            }
            let (law, taken) = (run.law(decision), run.actions[decision] as usize);
            let means = value.means_without(run.input(decision), law, taken);
            for (next, others) in next.iter_mut().zip(means) {
                *next = (others + f64::from(law[taken]) * *next).clamp(LEAST, 1.0);
            }
        }
        targets
    }

    /// Draws the rows of a batch, half of them from runs that fail.
    pub(super) fn draw(&self, size: usize, targets: &Targets, dice: &mut LearnerRng) -> Vec<usize> {
        // Failures are rare, and a batch without them would teach only that.
        let draw = |at: usize| {
            if at.is_multiple_of(2) && !self.failing.is_empty() {
                self.failing[dice.below(self.failing.len())]
            } else {
                targets.rows[dice.below(targets.rows.len())]
            }
        };
        (0..size).map(draw).collect()
    }
}
