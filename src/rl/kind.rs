//! Interface between a learner's settings and the list of learners.

use super::bundle::{BundleError, TensorFile};
use super::learner::{ConfigError, Learner};
use super::seeding::Seeding;
use super::{Policy, Spaces};

/// Interface that the settings of a learner implement for the list.
///
/// The caller ([`super::LearnerConfig`]) checks settings before they build
/// anything, and passes bundles of the right kind only.
pub(super) trait LearnerKind {
    /// Kinds of its bundles: policies, then checkpoints.
    fn bundles(&self) -> [&'static str; 2];

    /// Refuses the first field out of range, other than `decisions`.
    fn check(&self) -> Result<(), ConfigError>;

    /// Discount γ per decision.
    fn discount(&self) -> f64;

    /// Creates an untrained learner.
    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner>;

    /// Creates a learner that starts from a kept policy.
    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &TensorFile) -> Built;

    /// Restores a learner from a checkpoint.
    fn restore(&self, spaces: &Spaces, checkpoint: &TensorFile) -> Built;

    /// Search for demonstrations before the training, `None` for no search.
    fn seeding(&self) -> Option<&Seeding> {
        None
    }

    /// Factor on the decisions up to which an unsuccessful training goes on.
    fn longest(&self) -> f64 {
        1.0
    }

    /// Restricts the training to exactly the configured decisions.
    fn fix(&mut self) {}

    /// Loads a kept policy, with its observation length and number of actions.
    fn load(&self, policy: &TensorFile) -> Shaped;
}

pub(super) type Built = Result<Box<dyn Learner>, BundleError>;
pub(super) type Shaped = Result<(Box<dyn Policy>, [usize; 2]), BundleError>;
