//! Candidates: values of the parameters, and what was measured with them.

use super::ego_parameters::EgoParameter;
use super::losses::DrivingLoss;
use crate::stats::StartOutcome;

/// Share of the allowed failures that a search accepts.
///
/// Starts that it has not seen, and ados trained anew, are harder.
const FAILURE_MARGIN: f64 = 0.5;
/// Share of the allowed loss that a search accepts.
const LOSS_MARGIN: f64 = 0.8;
/// Excess of a loss, in its allowances, that counts as much as all failures, and at most.
const MOST_EXCESS: f64 = 1.0;
/// Weight of the change among candidates that fail a condition.
const TIE: f64 = 1e-3;

/// Outcomes of an ego on some starts, and its values in some natural runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct EgoMeasurement {
    /// Outcome of each start, or of each kept crash, against all ados.
    pub(super) outcomes: Vec<StartOutcome>,
    /// Values of each run, per loss. `None`: outside the ranges, or invalid.
    pub(super) runs: Vec<Option<Vec<f64>>>,
}

impl EgoMeasurement {
    pub(super) fn extend(&mut self, more: EgoMeasurement) {
        self.outcomes.extend(more.outcomes);
        self.runs.extend(more.runs);
    }

    /// Returns the first part, of as many starts and runs as `other` has.
    fn as_long_as(&self, other: &EgoMeasurement) -> EgoMeasurement {
        let (starts, runs) = (other.outcomes.len(), other.runs.len());
        EgoMeasurement {
            outcomes: self.outcomes[..starts.min(self.outcomes.len())].to_vec(),
            runs: self.runs[..runs.min(self.runs.len())].to_vec(),
        }
    }

    /// Returns the number of starts from which the ego fails.
    pub(super) fn failing(&self) -> usize {
        let all = self.outcomes.iter();
        all.filter(|it| **it == StartOutcome::Solved).count()
    }

    /// Returns the number of starts with a result.
    pub(super) fn valid(&self) -> usize {
        let all = self.outcomes.iter();
        all.filter(|it| it.score().is_some()).count()
    }

    /// Returns the share of the starts that fail, NaN without any.
    pub(super) fn share(&self) -> f64 {
        self.failing() as f64 / self.valid() as f64
    }

    /// Returns the values of a loss in the runs that both have.
    pub(super) fn paired(&self, own: &EgoMeasurement, nth: usize) -> [Vec<f64>; 2] {
        let pairs = self.runs.iter().zip(&own.runs);
        // Different runs would be compared otherwise, if only one of both egos was
        // invalid.
        let both = pairs.filter_map(|(one, own)| Some((one.as_ref()?[nth], own.as_ref()?[nth])));
        let (of_one, of_own): (Vec<f64>, Vec<f64>) = both.unzip();
        [of_one, of_own]
    }
}

/// Conditions on a candidate, relative to the ego as it is.
pub(super) struct Conditions<'a> {
    pub(super) parameters: &'a [EgoParameter],
    pub(super) losses: &'a [DrivingLoss],
    /// The ego as it is, on all starts and runs.
    pub(super) own: &'a EgoMeasurement,
    /// Greatest failures, as a share of those of the ego as it is.
    pub(super) remaining: f64,
}

/// Values of the parameters, with what was measured so far.
#[derive(Clone, Debug)]
pub(super) struct EgoCandidate {
    pub(super) values: Vec<f64>,
    pub(super) measured: EgoMeasurement,
    /// Stages of the starts that were played.
    pub(super) stages: usize,
}

/// How far a candidate is from a condition, 0 where it is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Excess {
    /// Failures beyond the allowed ones, as a share of those of the ego as it is.
    pub(super) failures: f64,
    /// Greatest excess of a loss, in its allowances.
    pub(super) losses: f64,
}

impl Excess {
    pub(super) fn is_none(self) -> bool {
        self.failures == 0.0 && self.losses == 0.0
    }
}

impl Conditions<'_> {
    /// Returns the size of a change: the sum of its shares of the ranges.
    pub(super) fn size(&self, values: &[f64]) -> f64 {
        let pairs = self.parameters.iter().zip(values);
        pairs.map(|(one, value)| one.share(*value)).sum()
    }

    /// Returns the excess with the margins of a search, or without any.
    ///
    /// `None` if the failures or a loss have no value, as without runs.
    pub(super) fn excess(&self, measured: &EgoMeasurement, is_search: bool) -> Option<Excess> {
        // A candidate of an early stage is compared with the ego as it is on the same
        // starts.
        let own = self.own.as_long_as(measured);
        let margin = if is_search { FAILURE_MARGIN } else { 1.0 };
        let allowed = margin * self.remaining * own.share();
        // NaN where no start has a result, which is no evidence.
        let beyond = measured.share() - allowed;
        if beyond.is_nan() {
            return None;
        }
        let failures = if beyond > 0.0 {
            // A baseline without failures must not divide by 0.
            beyond / own.share().max(f64::MIN_POSITIVE)
        } else {
            0.0
        };
        let mut losses: f64 = 0.0;
        for (nth, loss) in self.losses.iter().enumerate() {
            let [one, own] = measured.paired(&own, nth);
            let (value, own) = (loss.value(&one)?, loss.value(&own)?);
            let whole = loss.limit.of(own);
            let margin = if is_search { LOSS_MARGIN } else { 1.0 };
            // An ego beyond an absolute limit is allowed no margin.
            let allowed = whole.min(own + margin * (whole - own).max(0.0));
            // An allowance of about 0 would make every excess infinite, and all
            // candidates equal.
            let scale = (whole - own).abs().max(1e-3 * own.abs()).max(1e-9);
            losses = losses.max((value - allowed) / scale);
        }
        Some(Excess { failures, losses })
    }

    /// Returns the number by which candidates are ordered, the best one first.
    ///
    /// Below 1 all conditions are met, and it is the size. Unknown is last.
    pub(super) fn cost(&self, candidate: &EgoCandidate) -> f64 {
        let size = self.size(&candidate.values);
        let share = size / self.parameters.len().max(1) as f64;
        match self.excess(&candidate.measured, true) {
            None => f64::INFINITY,
            Some(excess) if excess.is_none() => share,
            Some(excess) => {
                // Capped, so a loss never hides a difference in failures altogether.
                let losses = (excess.losses / MOST_EXCESS).min(1.0);
                1.0 + excess.failures + losses + TIE * share
            }
        }
    }

    /// Returns whether a candidate fails from more starts already than all of them allow.
    pub(super) fn is_lost(&self, candidate: &EgoCandidate) -> bool {
        // The whole set decides here, because the failures so far can only grow.
        let allowed = FAILURE_MARGIN * self.remaining * self.own.share();
        candidate.measured.failing() as f64 > allowed * self.own.valid() as f64
    }

    /// Returns whether a candidate meets all conditions of a search.
    pub(super) fn is_feasible(&self, candidate: &EgoCandidate) -> bool {
        self.excess(&candidate.measured, true)
            .is_some_and(Excess::is_none)
    }
}

/// Returns the candidates that none is better than in size, failures and loss.
///
/// Only those that keep the limits and fail less than the ego as it is are compared.
pub(super) fn front(conditions: &Conditions<'_>, all: &[EgoCandidate]) -> Vec<EgoCandidate> {
    let own = conditions.own.failing();
    let scores: Vec<(usize, [f64; 3])> = all
        .iter()
        .enumerate()
        .filter_map(|(at, candidate)| {
            let excess = conditions.excess(&candidate.measured, false)?;
            let failing = candidate.measured.failing();
            // Limits are those of the confirmation, so the front may have what a search
            // rejects.
            let is_useful = excess.losses == 0.0 && failing < own;
            let size = conditions.size(&candidate.values);
            let loss = worst_loss(conditions, &candidate.measured);
            is_useful.then_some((at, [size, failing as f64, loss]))
        })
        .collect();
    // Better in one number and worse in none, so equal candidates do
    // not remove each other.
    let is_beaten = |mine: &[f64; 3]| {
        scores.iter().any(|(_, other)| {
            let pairs = || other.iter().zip(mine);
            pairs().all(|(other, mine)| other <= mine) && pairs().any(|(other, mine)| other < mine)
        })
    };
    let mut kept: Vec<&(usize, [f64; 3])> =
        scores.iter().filter(|(_, mine)| !is_beaten(mine)).collect();
    // By size, because callers take the first of equal failures for the smallest change.
    kept.sort_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]));
    kept.iter().map(|(at, _)| all[*at].clone()).collect()
}

/// Returns the loss that is nearest to its limit, 1 at the limit.
pub(super) fn worst_loss(conditions: &Conditions<'_>, measured: &EgoMeasurement) -> f64 {
    let own = conditions.own.as_long_as(measured);
    let all = conditions.losses.iter().enumerate().map(|(nth, loss)| {
        let [one, own] = measured.paired(&own, nth);
        // Without a value nothing shows that the limit is kept.
        let Some((value, own)) = loss.value(&one).zip(loss.value(&own)) else {
            return f64::INFINITY;
        };
        // A limit may be what the ego has already, and nothing is left to divide by.
        let allowance = (loss.limit.of(own) - own).max(1e-9);
        (value - own) / allowance
    });
    // Less loss than the ego as it is is welcome, and no reason for a larger change.
    all.fold(0.0, f64::max)
}
