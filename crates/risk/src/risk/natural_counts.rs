//! Counts of natural runs, of which there may be millions.

use indexmap::IndexMap;

use super::pool::RiskEstimate;
use super::record::{RiskRun, RunEnd};

/// First natural runs, whose rules are judged.
pub(super) const JUDGED: usize = 2000;
/// Most failures of which every decision is stored.
const STORED: usize = 1000;

/// Natural runs of an ego, as counts.
#[derive(Clone, Debug, Default)]
pub(super) struct NaturalCounts {
    /// All runs.
    runs: usize,
    outside: usize,
    invalid: usize,
    /// Of the first runs: those that keep every rule, and all that were judged.
    judged: [usize; 2],
    /// Failures by kind.
    pub(super) modes: IndexMap<String, usize>,
    /// Failures with every rule kept.
    pub(super) lawful: usize,
    /// Failures that a reference driver avoids.
    pub(super) preventable: usize,
    /// First failures, from as many runs as `stored_of`.
    pub(super) stored: Vec<RiskRun>,
    stored_of: usize,
}

impl NaturalCounts {
    /// Adds runs in the order of their numbers.
    pub(super) fn add(&mut self, runs: Vec<RiskRun>) {
        for run in runs {
            let is_judged = self.runs < JUDGED;
            self.runs += 1;
            let lawful = match &run.end {
                RunEnd::Outside => {
                    self.outside += 1;
                    None
                }
                RunEnd::Invalid { .. } | RunEnd::Impossible => {
                    self.invalid += 1;
                    None
                }
                RunEnd::Held { lawful } => *lawful,
                RunEnd::Failed(failure) => {
                    *self.modes.entry(failure.mode.clone()).or_default() += 1;
                    self.lawful += usize::from(failure.lawful);
                    self.preventable += usize::from(failure.preventable == Some(true));
                    Some(failure.lawful)
                }
            };
            // Later failures are judged too, but beside them no run that held.
            if let Some(lawful) = lawful.filter(|_| is_judged) {
                self.judged[0] += usize::from(lawful);
                self.judged[1] += 1;
            }
            if self.stored.len() < STORED {
                self.stored_of = self.drawn();
                if run.failure().is_some() {
                    self.stored.push(run);
                }
            }
        }
    }

    /// Returns the number of runs.
    pub(super) fn len(&self) -> usize {
        self.runs
    }

    /// Returns the number of runs without faults, which say nothing about the ego.
    ///
    /// Starts outside X_init count here, as they do in every mean of a round.
    pub(super) fn drawn(&self) -> usize {
        self.runs - self.invalid
    }

    /// Returns the number of runs without faults from starts inside X_init.
    pub(super) fn inside(&self) -> usize {
        self.drawn() - self.outside
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

    /// Returns the rate at which natural runs keep every rule.
    pub(super) fn lawful_rate(&self) -> RiskEstimate {
        RiskEstimate::counted(self.judged[0], self.judged[1])
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::EgoFailure;
    use super::*;

    #[test]
    fn failures_beyond_the_stored_ones_are_counted() {
        let failed = |lawful| {
            RiskRun::ending(RunEnd::Failed(EgoFailure {
                mode: format!("contact, {lawful}"),
                lawful,
                preventable: Some(!lawful),
            }))
        };
        let mut counts = NaturalCounts::default();
        // Of ten runs, three fail, one is outside and one has a fault.
        for _ in 0..1000 {
            let held = (0..5).map(|_| RiskRun::ending(RunEnd::Held { lawful: None }));
            let ends = [RunEnd::Outside, RunEnd::Invalid { fault: None }].map(RiskRun::ending);
            let failing = [failed(true), failed(true), failed(false)];
            counts.add(held.chain(ends).chain(failing).collect());
        }
        assert_eq!(
            (counts.len(), counts.drawn(), counts.inside()),
            (10_000, 9_000, 8_000)
        );
        assert_eq!(
            (counts.failures(), counts.lawful, counts.preventable),
            (3000, 2000, 1000)
        );
        // The thousandth failure is the first of the 334th ten runs.
        let (found, of) = counts.stored_with(|run| run.failure().is_some_and(|it| it.lawful));
        assert_eq!((counts.stored.len(), found, of), (STORED, 667, 333 * 9 + 7));
    }
}
