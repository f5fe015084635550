//! Search for the smallest change: sweeps, cross-entropy, successive halving, shrinking.
//!
//! Sweeps over single parameters find a change of one of them. A cross-entropy search
//! finds those of several. Both play all candidates on a few starts, and only the better
//! half on more: successive halving (Jamieson, Talwalkar 2016). All play equal starts with
//! equal noise. The best one is then shrunk: a parameter whose own value does as well has
//! it again, and the others go back as far as they can.

use std::cell::{Cell, RefCell};
use std::ops::Range;

use super::EgoParameter;
use super::candidate::{Conditions, EgoCandidate, EgoMeasurement};
use crate::experiment::Watch;
use crate::seed;
use crate::stats::CrossEntropySearch;

/// Shares of the starts and runs after each stage.
const STAGES: [f64; 3] = [0.25, 0.5, 1.0];
/// Share of the candidates that goes on to the next stage, as its reciprocal.
const KEPT: usize = 2;
/// Cost of a stage that was not played, above that of any candidate that fails at most
/// eight times as often as the ego as it is.
const UNPLAYED: f64 = 10.0;
/// Halvings of a change towards the ego as it is, per parameter.
const HALVINGS: usize = 5;
/// Passes over the parameters.
const PASSES: usize = 2;

/// Starts and natural runs of a stage.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Slice {
    pub(super) starts: Range<usize>,
    pub(super) runs: Range<usize>,
}

/// Measurement of an ego with some values.
pub(super) trait Trial {
    /// Plays a slice. `None`: stopped, or the values do not fit.
    fn play(&self, values: &[f64], slice: &Slice) -> Option<EgoMeasurement>;
}

/// Search for the smallest change that meets the conditions.
pub(super) struct Optimizer<'a> {
    pub(super) conditions: &'a Conditions<'a>,
    pub(super) trial: &'a dyn Trial,
    pub(super) slices: Vec<Slice>,
    pub(super) watch: &'a Watch<'a>,
    /// Seed of the request, and number of the search among those of the request.
    pub(super) seed: u64,
    pub(super) round: usize,
    /// Values to begin with, the result of an earlier search against fewer ados.
    pub(super) from: Option<Vec<f64>>,
}

/// Number of the candidates that were begun, of those that are planned.
struct Planned {
    done: Cell<usize>,
    total: usize,
}

impl Planned {
    fn advance(&self, watch: &Watch<'_>) {
        self.done.set((self.done.get() + 1).min(self.total));
        (watch.progress)(self.done.get() as u64, self.total as u64);
    }
}

/// Returns the slices of so many starts and runs.
pub(super) fn slices(starts: usize, runs: usize) -> Vec<Slice> {
    let (mut from_start, mut from_run) = (0, 0);
    let slice = |share: &f64| {
        // Rounded up, so the first stage of a tiny request has a start.
        let to_start = (share * starts as f64).ceil() as usize;
        let to_run = (share * runs as f64).ceil() as usize;
        let slice = Slice {
            starts: from_start..to_start,
            runs: from_run..to_run,
        };
        (from_start, from_run) = (to_start, to_run);
        slice
    };
    STAGES.iter().map(slice).collect()
}

impl Optimizer<'_> {
    /// Searches, and returns every candidate that was played on all starts.
    ///
    /// The first one is the smallest that meets the conditions, if any does. Stopped, it
    /// returns those found so far.
    pub(super) fn search(&self) -> Vec<EgoCandidate> {
        // Of one parameter, a sweep is the whole search.
        let is_single = self.conditions.parameters.len() < 2;
        // A sweep of one parameter is cheap and complete, so it begins anew.
        let from = self.from.as_ref().filter(|_| !is_single);
        let (first, search) = match from {
            // One more ado moves the result a little, so the search stays
            // near the earlier one.
            Some(values) => (vec![self.point(values)], CrossEntropySearch::COARSE_NEAR),
            None => (self.swept(), CrossEntropySearch::COARSE),
        };
        let all = RefCell::new(Vec::<EgoCandidate>::new());
        // Of a single parameter nothing is left to search after the sweep.
        let more = if is_single { 0 } else { search.points() };
        let progress = Planned {
            done: Cell::new(0),
            total: first.len() + more,
        };
        let measure = |points: &[Vec<f64>]| -> Vec<f64> {
            let values = points.iter().map(|point| self.values(point));
            let candidates = self.halve(values.collect(), &all.borrow(), Some(&progress));
            let costs = candidates.iter().map(|it| self.cost(it)).collect();
            all.borrow_mut().extend(candidates);
            costs
        };
        // The sweeps come first, because their best point is the middle of the search.
        measure(&first);
        let best = self.best(&all.borrow());
        let middle = best.map_or_else(|| self.own(), |best| self.point(&best.values));
        // By both numbers: their sum is that of the next seed in the round before.
        let mut dice = seed::generator("harden", &[self.seed, self.round as u64]);
        if !is_single && !self.watch.stopped() {
            search.run(middle, &mut dice, &measure);
        }
        let mut found = all.into_inner();
        if let Some(best) = self
            .best(&found)
            .filter(|it| self.conditions.is_feasible(it))
        {
            self.shrink(best, &mut found);
        }
        // Candidates of early stages were judged on the easy part, perhaps by luck.
        found.retain(|it| it.stages == self.slices.len());
        // Those that meet all conditions cost least, and the smallest
        // of them comes first.
        found.sort_by(|a, b| self.cost(a).total_cmp(&self.cost(b)));
        let mut distinct: Vec<EgoCandidate> = Vec::new();
        for one in found {
            if distinct.iter().all(|other| other.values != one.values) {
                distinct.push(one);
            }
        }
        distinct
    }

    /// Returns the points of a sweep over each parameter.
    fn swept(&self) -> Vec<Vec<f64>> {
        let own = self.own();
        let parameters = self.conditions.parameters.iter().enumerate();
        let points = parameters.flat_map(|(at, one)| {
            // A sweep of a single step would divide by 0.
            let last = one.steps.saturating_sub(1).max(1) as f64;
            let own = own.clone();
            (0..one.steps).map(move |step| {
                let mut point = own.clone();
                point[at] = 2.0 * step as f64 / last - 1.0;
                point
            })
        });
        points.collect()
    }

    fn own(&self) -> Vec<f64> {
        let parameters = self.conditions.parameters.iter();
        parameters.map(|one| one.x_of(one.own)).collect()
    }

    fn values(&self, point: &[f64]) -> Vec<f64> {
        let pairs = self.conditions.parameters.iter().zip(point);
        // The point of the own value has it to the last digit.
        let is_own = |one: &EgoParameter, x: f64| x == one.x_of(one.own);
        let values = pairs.map(|(one, x)| if is_own(one, *x) { one.own } else { one.at(*x) });
        values.collect()
    }

    fn point(&self, values: &[f64]) -> Vec<f64> {
        let pairs = self.conditions.parameters.iter().zip(values);
        pairs.map(|(one, value)| one.x_of(*value)).collect()
    }

    /// Returns the cost, in which every stage that was not played adds more than a usual
    /// excess.
    fn cost(&self, candidate: &EgoCandidate) -> f64 {
        let unplayed = (self.slices.len() - candidate.stages) as f64;
        self.conditions.cost(candidate) + UNPLAYED * unplayed
    }

    fn best(&self, all: &[EgoCandidate]) -> Option<EgoCandidate> {
        let by_cost = |a: &&EgoCandidate, b: &&EgoCandidate| self.cost(a).total_cmp(&self.cost(b));
        all.iter().min_by(by_cost).cloned()
    }

    /// Plays candidates stage by stage, and drops the worse ones after each.
    fn halve(
        &self,
        values: Vec<Vec<f64>>,
        known: &[EgoCandidate],
        progress: Option<&Planned>,
    ) -> Vec<EgoCandidate> {
        let begun = values.into_iter().map(|values| self.known(values, known));
        let mut all: Vec<EgoCandidate> = begun.collect();
        let mut alive: Vec<usize> = (0..all.len()).collect();
        for stage in 0..self.slices.len() {
            for at in &alive {
                self.advance(&mut all[*at], stage + 1);
                // Later stages continue the same candidates, so only the first stage
                // counts them.
                if let (0, Some(planned)) = (stage, progress) {
                    planned.advance(self.watch);
                }
            }
            if self.watch.stopped() {
                break;
            }
            // Equal costs keep the order of the draws: a stable sort.
            alive.sort_by(|a, b| self.cost(&all[*a]).total_cmp(&self.cost(&all[*b])));
            // Rounded up, so a single candidate reaches the last stage.
            alive.truncate(alive.len().div_ceil(KEPT));
        }
        all
    }

    /// Returns a candidate with what is known of it, so that no start is played twice.
    fn known(&self, values: Vec<f64>, known: &[EgoCandidate]) -> EgoCandidate {
        let equal = known.iter().filter(|it| it.values == values);
        // The longest measurement spares most runs.
        let before = equal.max_by_key(|it| it.stages).cloned();
        before.unwrap_or(EgoCandidate {
            values,
            measured: EgoMeasurement::default(),
            stages: 0,
        })
    }

    /// Plays a candidate up to a stage. It stays as it is if stopped.
    fn advance(&self, candidate: &mut EgoCandidate, to: usize) {
        while candidate.stages < to {
            let slice = &self.slices[candidate.stages];
            let Some(more) = self.trial.play(&candidate.values, slice) else {
                return;
            };
            candidate.measured.extend(more);
            candidate.stages += 1;
        }
    }

    /// Returns values played on all starts, if they meet the conditions.
    fn feasible(&self, values: Vec<f64>, all: &mut Vec<EgoCandidate>) -> Option<EgoCandidate> {
        let mut candidate = self.known(values, all);
        while candidate.stages < self.slices.len() {
            let before = candidate.stages;
            self.advance(&mut candidate, before + 1);
            // Stopped, or with more failures already than all starts may have.
            if candidate.stages == before || self.conditions.is_lost(&candidate) {
                break;
            }
        }
        all.push(candidate.clone());
        let is_whole = candidate.stages == self.slices.len();
        (is_whole && self.conditions.is_feasible(&candidate)).then_some(candidate)
    }

    /// Makes a change smaller, as long as the conditions are met.
    ///
    /// Parameters get their own value back first, the least changed one before the others,
    /// because a change that is just enough leaves no room for it.
    fn shrink(&self, best: EgoCandidate, all: &mut Vec<EgoCandidate>) {
        let mut smallest = best;
        for at in self.by_share(&smallest) {
            let own = self.conditions.parameters[at].own;
            if let Some(without) = self.feasible_at(&smallest, at, own, all) {
                smallest = without;
            }
        }
        for _ in 0..PASSES {
            let before = smallest.values.clone();
            // The largest change first, because it gains most.
            for at in self.by_share(&smallest).into_iter().rev() {
                smallest = self.halved(smallest, at, all);
            }
            if smallest.values == before {
                break;
            }
        }
    }

    /// Returns the changed parameters, the least changed one first.
    fn by_share(&self, candidate: &EgoCandidate) -> Vec<usize> {
        let parameters = self.conditions.parameters;
        let share = |at: &usize| parameters[*at].share(candidate.values[*at]);
        let mut order: Vec<usize> = (0..parameters.len()).filter(|at| share(at) > 0.0).collect();
        order.sort_by(|a, b| share(a).total_cmp(&share(b)));
        order
    }

    /// Returns a candidate with another value of a parameter, if it meets the conditions.
    fn feasible_at(
        &self,
        candidate: &EgoCandidate,
        at: usize,
        value: f64,
        all: &mut Vec<EgoCandidate>,
    ) -> Option<EgoCandidate> {
        let mut values = candidate.values.clone();
        values[at] = value;
        self.feasible(values, all)
    }

    /// Halves the change of a parameter, until the conditions are just met.
    fn halved(&self, best: EgoCandidate, at: usize, all: &mut Vec<EgoCandidate>) -> EgoCandidate {
        let one = &self.conditions.parameters[at];
        let (mut fails, mut smallest) = (one.own, best);
        for _ in 0..HALVINGS {
            let middle = one.at(0.5 * (one.x_of(fails) + one.x_of(smallest.values[at])));
            // Neighbouring values have no value between them.
            let is_new = middle != fails && middle != smallest.values[at];
            if !is_new || self.watch.stopped() {
                break;
            }
            match self.feasible_at(&smallest, at, middle, all) {
                Some(smaller) => smallest = smaller,
                None => fails = middle,
            }
        }
        smallest
    }
}

#[cfg(test)]
mod tests;
