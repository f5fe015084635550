//! Result of the search of one start.

use crate::adversary::RecordedFailure;
use crate::ego::Fault;
use crate::severity::Impact;

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

    /// Returns the simulations spent with a budget, and whether they suffice.
    pub fn within(&self, budget: u64) -> (u64, bool) {
        // A search ends with its success, so its simulations are those until then.
        let solved = self.actions.is_some() && self.simulations <= budget;
        (self.simulations.min(budget), solved)
    }
}
