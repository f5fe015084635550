//! What a search of one start came to.

use crate::campaign::eval::RecordedFailure;
use crate::ego::Fault;
use crate::severity::Impact;

/// A solution and what was spent on one start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// The actions that make the ego fail, if any were found.
    pub actions: Option<Vec<usize>>,
    /// Closing speed, if the agents touched after it.
    pub closing_speed_mps: Option<f64>,
    /// What the contact does to the ego, if it has part in it.
    pub impact: Option<Impact>,
    /// In which way the ego failed, where its run was recorded.
    pub failure: Option<RecordedFailure>,
    /// Whether a rule was broken between the success and that contact.
    pub foul_before_contact: bool,
    /// Episodes run, a part of one counted as one; the last is the success.
    pub simulations: u64,
    /// Those of them in which a rule was broken.
    pub fouls: u64,
    /// Physics steps spent, on both plants.
    pub physics_steps: u64,
    /// Sequences that succeeded when pre-screened and not on the plant asked for.
    pub unconfirmed: u64,
    /// The first fault of ego or physics: without a solution nobody knows
    /// whether the start has one.
    pub fault: Option<Fault>,
    /// Processor time spent.
    pub cpu_s: f64,
}

impl Found {
    /// Whether it says nothing: not solved, and the ego failed to run.
    pub fn is_invalid(&self) -> bool {
        self.actions.is_none() && self.fault.is_some()
    }

    /// Simulations spent with a budget of `budget`, and whether they suffice.
    pub fn within(&self, budget: u64) -> (u64, bool) {
        let solved = self.actions.is_some() && self.simulations <= budget;
        (self.simulations.min(budget), solved)
    }
}
