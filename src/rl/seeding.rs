//! What a learner asks to be looked for before its first episode.

use serde::{Deserialize, Serialize};

/// How demonstrations are looked for: sequences with few switches of action, on
/// training starts that no episode of the learner begins from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Seeding {
    /// Starts searched at most (200).
    pub starts: usize,
    /// Simulations spent at most (300000), and at most 2 per decision of the
    /// training; where the ego cannot be copied, a hundredth of it.
    pub simulations: u64,
}

impl Default for Seeding {
    fn default() -> Self {
        Seeding {
            starts: 200,
            simulations: 300_000,
        }
    }
}
