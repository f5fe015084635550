//! Manifest of a run directory.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::calibration::{Calibration, TrainingEnd};
use super::training_counterexamples::StoredCount;
use crate::content_hash::{self, fingerprint};
use crate::natural::NaturalTraining;
use crate::run_files::append_log::Grown;
use crate::run_files::sealed::{SealedCounterexamples, manifest_text, timing_s};
use crate::run_files::{MANIFEST, RunError, SealedFiles};
use crate::scene::Dynamics;
use crate::world::{Change, Scenario, TrainingEgos, TrainingGoal};

/// Content of the file with the processor time.
#[derive(Serialize)]
struct Timing {
    cpu_s: f64,
    /// Seal of its own, because manifests of equal trainings are equal.
    seal: String,
}

/// Properties of a run, and the hashes of its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the layout.
    pub format: u32,
    /// SHA-256 of the file with zeros in its place.
    pub sha256: String,
    /// Version of the program that trained.
    pub brakecheck: String,
    /// Operating system and processor of the training.
    pub target: String,
    /// Name of the world.
    pub world: String,
    /// SHA-256 of `world.ron`.
    pub world_sha256: String,
    /// Plant of the training.
    pub plant: Dynamics,
    /// Training seed.
    pub seed: u64,
    /// Decisions requested.
    pub decisions: u64,
    /// Decisions taken so far.
    pub decisions_done: u64,
    /// Episodes finished so far.
    pub episodes: u64,
    /// Physics steps of the training.
    pub physics_steps: u64,
    /// Search of training starts before the learner's first episode.
    ///
    /// `None` if the learner requires none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sought: Option<Sought>,
    /// Comparison of the ado with a cheap search on calibration starts.
    ///
    /// It is of the last time that training reached the requested length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<Calibration>,
    /// Reason for the end of training. `None` while it goes on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended: Option<TrainingEnd>,
    /// Processor time of the training.
    ///
    /// It is in `timing.json`, so that equal trainings have equal manifests.
    #[serde(default, skip_serializing)]
    pub cpu_s: f64,
    /// Valid part of `progress.jsonl`.
    #[serde(default, skip_serializing_if = "Grown::is_nothing")]
    pub progress: Grown,
    /// Report of the learner that is not yet a line of that file.
    #[serde(default, skip_serializing_if = "Window::is_empty")]
    pub window: Window,
    /// Number of counterexamples. `None` for a training that stores none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) counterexamples: Option<StoredCount>,
    /// Name of the learner among the world's `learners`. `None` for the world's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learner: Option<String>,
    /// Failures that the training looks for. Empty for any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub goals: Vec<TrainingGoal>,
    /// Limit on how rare the ado's driving could become. `None` without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub natural: Option<NaturalTraining>,
    /// Training opponent.
    #[serde(default, skip_serializing_if = "TrainingEgos::is_nominal")]
    pub against: TrainingEgos,
    /// Structure of the family that training left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
    /// SHA-256 of the settings of learner and family, including defaults.
    ///
    /// The settings are JSON with sorted keys. `None` for a training by an earlier
    /// version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) settings_fingerprint: Option<String>,
    /// Settings of the learner, including defaults.
    pub settings: serde_json::Value,
    /// Changed ego of the training. `None` for the world's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ego: Option<ChangedEgo>,
    /// SHA-256 of `from.safetensors`, when fine-tuning.
    #[serde(default)]
    pub from_sha256: Option<String>,
    /// SHA-256 of `bank.json`, when learning from other trainings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bank_sha256: Option<String>,
    /// SHA-256 of `known.json`, if the training rewards rare failures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub known_sha256: Option<String>,
    /// File of the checkpoint and its SHA-256, during training.
    #[serde(default)]
    pub checkpoint: Option<(String, String)>,
    /// SHA-256 of `policy.safetensors`, once it exists.
    pub policy_sha256: Option<String>,
}

/// Search of training starts for demonstrations of a learner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sought {
    /// Starts searched.
    pub starts: u64,
    /// Starts on which the ego failed.
    pub solved: u64,
    /// Simulations spent.
    pub simulations: u64,
    /// Physics steps spent, which those of the manifest include.
    pub physics_steps: u64,
}

/// Progress of a training.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Done {
    /// Decisions requested.
    pub decisions_asked: u64,
    /// Decisions taken.
    pub decisions: u64,
    /// Episodes finished.
    pub episodes: u64,
    /// Physics steps spent.
    pub physics_steps: u64,
    /// Processor time spent, in s.
    pub cpu_s: f64,
    /// Comparison with a cheap search, after training.
    pub calibration: Option<Calibration>,
    /// Reason for the end, after training.
    pub ended: Option<TrainingEnd>,
    /// Episodes that no line of `progress.jsonl` covers yet.
    pub window: Window,
}

/// Episodes since the last line of `progress.jsonl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// Number of episodes.
    pub episodes: u64,
    /// Episodes that the ado solved.
    pub solved: u64,
    /// Sum of their returns.
    pub returns: f64,
    /// Sum of the learner's mean losses.
    #[serde(default)]
    pub losses: f64,
    /// Number of updates with a loss.
    #[serde(default)]
    pub updates: u64,
}

impl Window {
    fn is_empty(&self) -> bool {
        self.episodes == 0
    }
}

impl Manifest {
    /// Reads and verifies the manifest of a run directory.
    ///
    /// # Errors
    ///
    /// Returns an error if it is missing or damaged.
    pub(super) fn read(run: &Path) -> Result<Manifest, RunError> {
        let text = manifest_text(run)?;
        let damaged = |why: String| RunError::Damaged {
            path: run.join(MANIFEST),
            why,
        };
        let invalid = |error: serde_json::Error| damaged(error.to_string());
        let mut manifest: Manifest = serde_json::from_str(&text).map_err(invalid)?;
        // The text names its own hash, so it is parsed before it is checked.
        content_hash::check(&text, &manifest.sha256).map_err(damaged)?;
        // It is written before every checkpoint and before the policy.
        let is_due = manifest.checkpoint.is_some() || manifest.is_finished();
        manifest.cpu_s = timing_s(run, is_due)?;
        Ok(manifest)
    }

    /// Returns the text of its file, with the hash.
    pub(super) fn sealed(&self, run: &Path) -> Result<String, RunError> {
        let blank = Manifest {
            sha256: content_hash::BLANK.to_owned(),
            ..self.clone()
        };
        let text = serde_json::to_string_pretty(&blank).map_err(|error| RunError::Damaged {
            path: run.join(MANIFEST),
            why: error.to_string(),
        })?;
        Ok(content_hash::seal(&text))
    }

    /// Returns the content of the file for the time.
    pub(super) fn timing(&self) -> Vec<u8> {
        let timing = Timing {
            cpu_s: self.cpu_s,
            seal: content_hash::BLANK.to_owned(),
        };
        content_hash::seal(&serde_json::json!(timing).to_string()).into_bytes()
    }

    /// Returns the hashes of the files.
    pub(super) fn files(&self) -> SealedFiles {
        let stored = self.counterexamples.as_ref();
        SealedFiles {
            world_sha256: self.world_sha256.clone(),
            from_sha256: self.from_sha256.clone(),
            bank_sha256: self.bank_sha256.clone(),
            known_sha256: self.known_sha256.clone(),
            policy_sha256: self.policy_sha256.clone(),
            progress: self.progress.clone(),
            counterexamples: stored.map(|stored| SealedCounterexamples {
                bytes: stored.bytes,
                sha256: stored.sha256.clone(),
            }),
        }
    }

    /// Returns true if training has finished.
    pub fn is_finished(&self) -> bool {
        self.policy_sha256.is_some()
    }
}

/// Changed ego of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangedEgo {
    /// Name in rows.
    pub name: String,
    /// Difference from the world's own ego.
    pub change: Change,
}

impl ChangedEgo {
    /// Returns true for the user's own controller, which is known by name only.
    pub fn is_own(&self) -> bool {
        self.change == Change::default()
    }
}

/// Returns the hash of the complete settings of learner and family, including defaults.
///
/// Another version of the program may have other defaults.
pub(super) fn settings_of(scenario: &Scenario) -> String {
    fingerprint(&serde_json::json!({
        "learner": scenario.learner,
        "family": scenario.family(),
    }))
}
