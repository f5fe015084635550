//! What a learner must offer to stand in the list.

use super::bundle::{Bundle, BundleError};
use super::learner::{ConfigError, Learner};
use super::seeding::Seeding;
use super::{Policy, Spaces};

/// What the settings of a learner offer, so that it can stand in the list.
///
/// Settings are checked before they build anything ([`super::LearnerConfig`]), and
/// bundles are of the right kind.
pub(super) trait Kind {
    /// First words of its bundles: of policies, of checkpoints.
    fn bundles(&self) -> [&'static str; 2];

    /// Refuses the first field, other than `decisions`, that is out of range.
    fn check(&self) -> Result<(), ConfigError>;

    /// γ, by which a later reward counts less.
    fn discount(&self) -> f64;

    /// A learner that has seen nothing.
    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner>;

    /// A learner that starts from a kept policy.
    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &Bundle) -> Built;

    /// A learner that goes on from a checkpoint.
    fn restore(&self, spaces: &Spaces, checkpoint: &Bundle) -> Built;

    /// How demonstrations are looked for before it learns; `None`: it wants none.
    fn seeding(&self) -> Option<&Seeding> {
        None
    }

    /// How many times its decisions a training may take where it has not learned
    /// its world by then.
    fn longest(&self) -> f64 {
        1.0
    }

    /// Takes exactly the decisions asked for.
    fn fix(&mut self) {}

    /// A kept policy, with its observation length and number of actions.
    fn load(&self, policy: &Bundle) -> Shaped;
}

pub(super) type Built = Result<Box<dyn Learner>, BundleError>;
pub(super) type Shaped = Result<(Box<dyn Policy>, [usize; 2]), BundleError>;
