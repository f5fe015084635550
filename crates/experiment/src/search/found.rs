//! Result of the search of one start.

use crate::adversary::RecordedFailure;
use crate::ego::Fault;
use crate::severity::Impact;
use crate::stats::StartOutcome;

/// Solution of one start and the cost of its search.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchResult {
    /// Actions that make the ego fail, if any were found.
    pub actions: Option<Vec<usize>>,
    /// Closing speed, if the agents touched after the failure.
    pub closing_speed_mps: Option<f64>,
    /// Severity of the contact for the ego, if the ego takes part in it.
    pub impact: Option<Impact>,
    /// Failure of the ego, where its run was recorded.
    pub failure: Option<RecordedFailure>,
    /// True if a rule was broken between the success and that contact.
    pub violation_before_contact: bool,
    /// Number of episodes, including partial episodes and the final success.
    pub simulations: u64,
    /// Episodes in which a rule was broken.
    pub violations: u64,
    /// Physics steps spent, on both plants.
    pub physics_steps: u64,
    /// Sequences that succeeded in pre-screening but not on the requested plant.
    pub unconfirmed: u64,
    /// First fault of the ego or the physics.
    ///
    /// Without a solution it is then unknown if a solution exists.
    pub fault: Option<Fault>,
    /// Processor time spent.
    pub cpu_s: f64,
}

impl SearchResult {
    /// Returns whether the start is unsolved because of a fault.
    pub fn is_invalid(&self) -> bool {
        self.actions.is_none() && self.fault.is_some()
    }

    /// Returns the simulations spent with a budget, and the outcome of the start then.
    ///
    /// A fault without a solution within the budget makes the start invalid.
    pub fn within(&self, budget: u64) -> (u64, StartOutcome) {
        // A search ends with its success, so its simulations are those until then.
        let outcome = if self.actions.is_some() && self.simulations <= budget {
            StartOutcome::Solved
        } else if self.fault.is_some() {
            // The fault may be beyond the budget, but no record shows that.
            StartOutcome::Invalid
        } else {
            StartOutcome::Unsolved
        };
        (self.simulations.min(budget), outcome)
    }

    /// Returns the result as if the search had stopped at a budget.
    ///
    /// Physics steps and time are in proportion to the simulations. A result that was cut
    /// has no violations, because no record shows which simulations they were in.
    pub(super) fn cut(&self, budget: u64) -> SearchResult {
        if self.simulations <= budget {
            return self.clone();
        }
        let share = budget as f64 / self.simulations as f64;
        SearchResult {
            simulations: budget,
            physics_steps: (share * self.physics_steps as f64).round() as u64,
            cpu_s: share * self.cpu_s,
            fault: self.fault.clone(),
            ..SearchResult::default()
        }
    }
}
