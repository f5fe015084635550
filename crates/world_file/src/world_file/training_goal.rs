//! Which failures a training looks for, beyond any that counts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{Display, EnumMessage, EnumString, IntoStaticStr, VariantArray};

/// Kind of failure that a training pays more for.
///
/// Definition 4 pays every success nearly alike, so that an ado learns the mild
/// one that is easiest to reach from most starts.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Hash,
    Serialize,
    Deserialize,
    JsonSchema,
    Display,
    EnumString,
    IntoStaticStr,
    VariantArray,
    EnumMessage,
)]
#[strum(serialize_all = "lowercase")]
pub enum TrainingGoal {
    /// Contacts at a high closing speed.
    Severe,
    /// Failures of kinds that are rare in the training so far.
    Distinct,
}

/// Closing speed at which `Severe` is reached to 76 %: tanh(1).
// Chosen on `acc` and `cut_in`, with training seed 1 and open starts.
const SEVERE_MPS: f64 = 10.0;

impl TrainingGoal {
    /// Share in [0, 1) to which a contact at a closing speed reaches `Severe`.
    pub fn severe_share(closing_mps: f64) -> f64 {
        // A speed below 0, of bodies that part, would give a share below 0.
        libm::tanh(closing_mps.max(0.0) / SEVERE_MPS)
    }

    /// Share in (0, 1) to which a success reaches `Distinct`: one half where its
    /// group has `seen` successes, itself included, as many as `mean`, the average
    /// over all groups that the training has met.
    pub fn distinct_share(seen: u64, mean: f64) -> f64 {
        // Callers count the success first, so both numbers are at least 1. The bounds
        // keep the share inside (0, 1) for any others.
        1.0 / (1.0 + seen.max(1) as f64 / mean.max(1.0))
    }
}
