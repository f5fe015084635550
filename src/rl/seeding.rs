//! Settings of the search before a learner's first episode.

use serde::{Deserialize, Serialize};

/// Settings of the search for demonstrations.
///
/// It tries action sequences with few switches on training starts that no
/// episode of the learner begins from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Seeding {
    /// Greatest number of starts searched (200).
    pub starts: usize,
    /// Greatest number of simulations (300000), and at most 2 per decision.
    ///
    /// If the ego cannot be copied, a hundredth of it.
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
