//! What an ado may do from a start on.

use crate::rl::Policy;

/// How the ado goes on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Strategy {
    /// As it was trained.
    AsTrained,
    /// As it learned to inside the surrogate.
    TrainedOn,
    /// These actions from the start on, the last one held.
    Plan(Vec<usize>),
}

/// The ado's policies.
#[derive(Clone, Copy)]
pub(super) struct Policies<'a> {
    pub as_trained: &'a dyn Policy,
    /// What it learned inside the surrogate, if it did.
    pub trained_on: Option<&'a dyn Policy>,
}

impl<'a> Policies<'a> {
    /// The ones there are, as strategies.
    pub fn strategies(self) -> impl Iterator<Item = Strategy> {
        let trained_on = self.trained_on.map(|_| Strategy::TrainedOn);
        std::iter::once(Strategy::AsTrained).chain(trained_on)
    }

    /// The one that a strategy follows; `None`: it follows none.
    pub fn of(self, strategy: &Strategy) -> Option<&'a dyn Policy> {
        match strategy {
            Strategy::AsTrained => Some(self.as_trained),
            Strategy::TrainedOn => self.trained_on,
            Strategy::Plan(_) => None,
        }
    }
}
