//! Counts of natural runs, of which there may be millions.

use indexmap::IndexMap;

use super::pool::RiskEstimate;
use super::record::{DriverAnswer, RiskRun, RunEnd};
use super::run_faults::RunFaults;

/// First natural runs, whose rules are judged.
pub(super) const JUDGED: usize = 2000;
/// Most failures of which every decision is stored.
const STORED: usize = 1000;

/// Natural runs of an ego, as counts.
#[derive(Clone, Debug, Default)]
pub(super) struct NaturalCounts {
    outside: usize,
    /// All runs, and those that ended in a fault.
    pub(super) faults: RunFaults,
    /// Of the first runs: those that keep every rule, and those that keep them or do not.
    judged: [usize; 2],
    /// Faults among the first runs.
    judged_faults: usize,
    /// Failures by kind.
    pub(super) modes: IndexMap<String, usize>,
    /// Failures with every rule kept.
    pub(super) lawful: usize,
    /// Failures that a reference driver avoids.
    pub(super) preventable: usize,
    /// Failures to which no reference driver applies.
    pub(super) unjudged: usize,
    /// First failures, from as many runs as `stored_of`.
    pub(super) stored: Vec<RiskRun>,
    stored_of: usize,
    /// Faults among as many runs as `stored_of`.
    stored_faults: usize,
}

/// Reading of runs that ended in a fault, whose continuation is unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FaultsAs {
    /// No fault would have been a failure.
    Held,
    /// Every fault would have been a failure.
    Failing,
}

impl FaultsAs {
    /// Returns the failures that a number of faults stands for.
    fn failures(self, faults: usize) -> usize {
        match self {
            FaultsAs::Held => 0,
            FaultsAs::Failing => faults,
        }
    }
}

impl NaturalCounts {
    /// Adds runs in the order of their numbers.
    pub(super) fn add(&mut self, runs: Vec<RiskRun>) {
        for run in runs {
            let is_judged = self.len() < JUDGED;
            self.faults.add(std::slice::from_ref(&run));
            let lawful = match &run.end {
                RunEnd::Outside | RunEnd::Impossible => {
                    self.outside += 1;
                    None
                }
                RunEnd::Invalid { .. } => {
                    self.judged_faults += usize::from(is_judged);
                    None
                }
                RunEnd::Held { lawful } => *lawful,
                RunEnd::Failed(failure) => {
                    *self.modes.entry(failure.mode.clone()).or_default() += 1;
                    self.lawful += usize::from(failure.lawful);
                    let answer = failure.preventable;
                    self.preventable += usize::from(answer == Some(DriverAnswer::Avoids));
                    self.unjudged += usize::from(answer == Some(DriverAnswer::NoAnswer));
                    Some(failure.lawful)
                }
            };
            // Later failures are judged too, but beside them no run that held.
            if let Some(lawful) = lawful.filter(|_| is_judged) {
                self.judged[0] += usize::from(lawful);
                self.judged[1] += 1;
            }
            // The first failures instead of a choice, so that shares among them are
            // unbiased.
            if self.stored.len() < STORED {
                // Once the list is full, both stay at the run of its last failure.
                (self.stored_of, self.stored_faults) = (self.len(), self.faults.invalid);
                if run.failure().is_some() {
                    self.stored.push(run);
                }
            }
        }
    }

    /// Returns the number of runs.
    ///
    /// Starts outside X_init count here, as they do in every mean of a round.
    pub(super) fn len(&self) -> usize {
        self.faults.runs
    }

    /// Returns the number of runs from starts inside X_init, faults included.
    pub(super) fn inside(&self) -> usize {
        self.len() - self.outside
    }

    /// Returns the number of failures.
    pub(super) fn failures(&self) -> usize {
        self.modes.values().sum()
    }

    /// Returns how many of the stored failures have a property, and of how many runs.
    pub(super) fn stored_with(&self, has: impl Fn(&RiskRun) -> bool) -> (usize, usize) {
        let found = self.stored.iter().filter(|run| has(run)).count();
        (found, self.stored_of)
    }

    /// Returns the faults among the runs of [`NaturalCounts::stored_with`].
    pub(super) fn stored_faults(&self) -> usize {
        self.stored_faults
    }

    /// Returns the estimate of some failures per run from a start inside X_init.
    pub(super) fn rate(&self, failures: usize, faults: FaultsAs) -> RiskEstimate {
        let failures = failures + faults.failures(self.faults.invalid);
        RiskEstimate::counted(failures, self.inside())
    }

    /// Returns the rate at which natural runs keep every rule.
    ///
    /// With [`FaultsAs::Failing`], runs that ended in a fault keep them too.
    pub(super) fn lawful_rate(&self, faults: FaultsAs) -> RiskEstimate {
        let lawful = self.judged[0] + faults.failures(self.judged_faults);
        RiskEstimate::counted(lawful, self.judged[1] + self.judged_faults)
    }

    /// Returns the number of runs whose rules were judged, faults included.
    pub(super) fn judged(&self) -> usize {
        self.judged[1] + self.judged_faults
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::EgoFailure;
    use super::*;
    use crate::ego::Fault;

    fn failed(lawful: bool, preventable: Option<DriverAnswer>) -> RiskRun {
        RiskRun::ending(RunEnd::Failed(EgoFailure {
            mode: format!("contact, {lawful}"),
            lawful,
            preventable,
        }))
    }

    fn fault() -> RiskRun {
        RiskRun::ending(RunEnd::Invalid {
            fault: Fault::error("x"),
        })
    }

    #[test]
    fn failures_beyond_the_stored_ones_are_counted() {
        let mut counts = NaturalCounts::default();
        // Of ten runs, three fail, one is outside and one has a fault.
        for _ in 0..1000 {
            let held = (0..5).map(|_| RiskRun::ending(RunEnd::Held { lawful: None }));
            let ends = [RiskRun::ending(RunEnd::Outside), fault()];
            let failing = [
                failed(true, Some(DriverAnswer::Fails)),
                failed(true, Some(DriverAnswer::NoAnswer)),
                failed(false, Some(DriverAnswer::Avoids)),
            ];
            counts.add(held.chain(ends).chain(failing).collect());
        }
        assert_eq!((counts.len(), counts.inside()), (10_000, 9_000));
        assert_eq!((counts.faults.runs, counts.faults.invalid), (10_000, 1000));
        assert_eq!((counts.failures(), counts.lawful), (3000, 2000));
        assert_eq!((counts.preventable, counts.unjudged), (1000, 1000));
        // The thousandth failure is the first of the 334th ten runs.
        let (found, of) = counts.stored_with(|run| run.failure().is_some_and(|it| it.lawful));
        assert_eq!((counts.stored.len(), found), (STORED, 667));
        assert_eq!((of, counts.stored_faults()), (333 * 10 + 8, 334));
    }

    #[test]
    fn faults_are_in_every_denominator_and_bound_every_rate() {
        let mut counts = NaturalCounts::default();
        let held = RiskRun::ending(RunEnd::Held { lawful: Some(true) });
        let broken = RiskRun::ending(RunEnd::Held {
            lawful: Some(false),
        });
        // Of eight runs inside, two fail lawfully and one in a fault.
        let runs = [held.clone(), held.clone(), held, broken.clone(), broken];
        let failing = [failed(true, None), failed(true, None), fault()];
        counts.add(runs.into_iter().chain(failing).collect());
        counts.add(vec![RiskRun::ending(RunEnd::Outside)]);
        let of = |it: RiskEstimate| (it.hits, it.probability);
        assert_eq!(of(counts.rate(2, FaultsAs::Held)), (2, 0.25));
        assert_eq!(of(counts.rate(2, FaultsAs::Failing)), (3, 0.375));
        assert_eq!(of(counts.lawful_rate(FaultsAs::Held)), (5, 0.625));
        assert_eq!(of(counts.lawful_rate(FaultsAs::Failing)), (6, 0.75));
        assert_eq!(counts.judged(), 8);
    }

    #[test]
    fn only_the_first_runs_are_judged() {
        let held = |lawful| RiskRun::ending(RunEnd::Held { lawful });
        let mut counts = NaturalCounts::default();
        counts.add(vec![held(Some(true)); JUDGED - 1]);
        // The last judged run, and the first one after it.
        counts.add(vec![fault(), fault(), failed(false, None)]);
        assert_eq!(counts.judged(), JUDGED);
        assert_eq!(counts.lawful_rate(FaultsAs::Held).hits, JUDGED - 1);
        assert_eq!(counts.lawful_rate(FaultsAs::Failing).hits, JUDGED);
    }
}
