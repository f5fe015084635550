//! What a run directory says of itself.

use serde::{Deserialize, Serialize};

use super::stored::StoredCount;
use crate::scenario::{Against, Change};
use crate::scene::Dynamics;

/// What a run was, and the hashes of its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the layout.
    pub format: u32,
    /// Version of the program that trained.
    pub brakecheck: String,
    /// Operating system and processor it trained on.
    pub target: String,
    /// Name of the world.
    pub world: String,
    /// SHA-256 of `world.ron`.
    pub world_sha256: String,
    /// The plant it trained on.
    pub plant: Dynamics,
    /// The training seed.
    pub seed: u64,
    /// Decisions asked for.
    pub decisions: u64,
    /// Decisions taken so far.
    pub decisions_done: u64,
    /// Episodes finished so far.
    pub episodes: u64,
    /// Physics steps spent in training.
    #[serde(default)]
    pub physics_steps: u64,
    /// Processor time spent in training.
    pub cpu_s: f64,
    /// How many counterexamples it brought; `None`: an earlier version trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counterexamples: Option<StoredCount>,
    /// Which of the world's `learners` trained; `None`: its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learner: Option<String>,
    /// What it was trained against.
    #[serde(default, skip_serializing_if = "Against::is_nominal")]
    pub against: Against,
    /// Of the learner's and the family's settings, defaults included; `None`:
    /// an earlier version did not note it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settings_sha256: Option<String>,
    /// What the ado is told besides its observation, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub told: Vec<String>,
    /// The changed ego it was trained against; `None`: the world's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ego: Option<ChangedEgo>,
    /// SHA-256 of `from.safetensors`, when fine-tuning.
    #[serde(default)]
    pub from_sha256: Option<String>,
    /// The checkpoint's file and its SHA-256, while training.
    #[serde(default)]
    pub checkpoint: Option<(String, String)>,
    /// SHA-256 of `policy.safetensors`, once there is one.
    pub policy_sha256: Option<String>,
}

impl Manifest {
    /// Whether training has finished.
    pub fn is_finished(&self) -> bool {
        self.policy_sha256.is_some()
    }
}

/// The changed ego that a run was trained against.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangedEgo {
    /// How rows call it.
    pub name: String,
    /// How it differs from the world's own.
    pub change: Change,
}
