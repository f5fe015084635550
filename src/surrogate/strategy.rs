//! Strategies of an ado from a start on.

use crate::rl::Policy;

/// Behaviour of the ado from a start on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Strategy {
    /// Follows the trained policy.
    AsTrained,
    /// Follows the policy trained inside the surrogate.
    TrainedOn,
    /// Plays these actions from the start on, the last action held.
    Plan(Vec<usize>),
}

/// Policies of the ado.
#[derive(Clone, Copy)]
pub(super) struct Policies<'a> {
    pub as_trained: &'a dyn Policy,
    /// Policy trained inside the surrogate, if any.
    pub trained_on: Option<&'a dyn Policy>,
}

impl<'a> Policies<'a> {
    /// Returns the available policies as strategies.
    pub fn strategies(self) -> impl Iterator<Item = Strategy> {
        let trained_on = self.trained_on.map(|_| Strategy::TrainedOn);
        std::iter::once(Strategy::AsTrained).chain(trained_on)
    }

    /// Returns the policy of a strategy, or `None` for a plan.
    pub fn of(self, strategy: &Strategy) -> Option<&'a dyn Policy> {
        match strategy {
            Strategy::AsTrained => Some(self.as_trained),
            Strategy::TrainedOn => self.trained_on,
            Strategy::Plan(_) => None,
        }
    }
}
