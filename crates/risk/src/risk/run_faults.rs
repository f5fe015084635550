//! Faults of an ego among its runs.

use serde::{Deserialize, Serialize};

use super::record::RiskRun;
use crate::testbench::{FaultCount, add_fault};

/// Runs of an ego, and those that ended in a fault of the ego or the physics.
///
/// A run that ended in a fault might have ended in a failure.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunFaults {
    /// All runs on the ego's own plant.
    pub runs: usize,
    /// Runs that ended in a fault.
    pub invalid: usize,
    /// These faults by kind, with runs numbered from 0.
    pub faults: Vec<FaultCount>,
}

impl RunFaults {
    /// Adds the next runs.
    pub(super) fn add(&mut self, runs: &[RiskRun]) {
        for run in runs {
            if let Some(fault) = run.fault() {
                // Before the run is counted, so that numbers begin at 0.
                add_fault(&mut self.faults, self.runs as u64, fault);
                self.invalid += 1;
            }
            self.runs += 1;
        }
    }

    /// Returns the share of runs that ended in a fault.
    pub fn share(&self) -> f64 {
        self.invalid as f64 / self.runs.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::RunEnd;
    use super::*;
    use crate::ego::{Fault, FaultKind};

    #[test]
    fn faults_are_counted_by_kind_over_all_runs() {
        let ended = |kind| {
            RiskRun::ending(RunEnd::Invalid {
                fault: Fault::new(kind, kind.word()),
            })
        };
        let held = RiskRun::ending(RunEnd::Held { lawful: None });
        let mut faults = RunFaults::default();
        assert_eq!(faults.share(), 0.0);
        faults.add(&[held.clone(), ended(FaultKind::Timeout)]);
        faults.add(&[ended(FaultKind::Ended), held, ended(FaultKind::Timeout)]);
        assert_eq!((faults.runs, faults.invalid, faults.share()), (5, 3, 0.6));
        let kinds = faults
            .faults
            .iter()
            .map(|it| (it.kind, it.first_start, it.count));
        let expected = [(FaultKind::Timeout, 1, 2), (FaultKind::Ended, 2, 1)];
        assert_eq!(kinds.collect::<Vec<_>>(), expected);
    }
}
