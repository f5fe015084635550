//! Manifest of a run directory.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::append_log::Grown;
use super::calibration::{Calibration, TrainingEnd};
use super::disk::read_text;
use super::training_counterexamples::StoredCount;
use super::{FORMAT, RunError};
use crate::content_hash;
use crate::natural::NaturalTraining;
use crate::rulebook::TrainingGoal;
use crate::scene::Dynamics;
use crate::world::{Change, TrainingEgos};

pub(crate) const FILE: &str = "manifest.json";
/// File that makes a directory a population of runs, in place of the manifest.
pub(crate) const POPULATION: &str = "population.json";
/// Directory of a population's runs, which are called `000`, `001` and so on.
pub(crate) const MEMBERS: &str = "members";
/// Separate file of the processor time, in which equal trainings differ.
pub(super) const TIMING: &str = "timing.json";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Timing {
    cpu_s: f64,
    /// Seal of its own, because manifests of equal trainings are equal.
    seal: String,
}

/// Processor time from the file beside the manifest.
///
/// It is 0 before the first checkpoint.
fn read_timing(run: &Path, manifest: &Manifest) -> Result<f64, RunError> {
    let path = &run.join(TIMING);
    let damaged = |why: String| RunError::Damaged {
        path: path.into(),
        why,
    };
    if !path.is_file() {
        // It is written before every checkpoint and before the policy.
        let is_due = manifest.checkpoint.is_some() || manifest.is_finished();
        return if is_due {
            Err(RunError::NotARun {
                path: run.into(),
                why: format!("`{TIMING}` is missing"),
            })
        } else {
            Ok(0.0)
        };
    }
    let text = read_text(path)?;
    let read: Timing = serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
    content_hash::check(&text, &read.seal).map_err(damaged)?;
    Ok(read.cpu_s)
}

/// Fields that decide whether this version can use a run.
#[derive(Deserialize)]
struct Layout {
    format: u32,
    #[serde(default)]
    against: Option<String>,
}

/// Retired word of [`TrainingEgos`].
const CONDITIONAL: &str = "conditional";

/// Properties of a run, and the hashes of its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the layout.
    pub(crate) format: u32,
    /// SHA-256 of the file with zeros in its place.
    pub(crate) sha256: String,
    /// Version of the program that trained.
    pub(crate) brakecheck: String,
    /// Operating system and processor of the training.
    pub(crate) target: String,
    /// Name of the world.
    pub(crate) world: String,
    /// SHA-256 of `world.ron`.
    pub(crate) world_sha256: String,
    /// Plant of the training.
    pub plant: Dynamics,
    /// Training seed.
    pub seed: u64,
    /// Decisions requested.
    pub(crate) decisions: u64,
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
    pub(crate) progress: Grown,
    /// Report of the learner that is not yet a line of that file.
    #[serde(default, skip_serializing_if = "Window::is_empty")]
    pub(crate) window: Window,
    /// Number of counterexamples. `None` for a training that stores none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) counterexamples: Option<StoredCount>,
    /// Name of the learner among the world's `learners`. `None` for the world's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) learner: Option<String>,
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
    pub(crate) settings: serde_json::Value,
    /// Changed ego of the training. `None` for the world's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) ego: Option<ChangedEgo>,
    /// SHA-256 of `from.safetensors`, when fine-tuning.
    #[serde(default)]
    pub(crate) from_sha256: Option<String>,
    /// SHA-256 of `bank.json`, when learning from other trainings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) bank_sha256: Option<String>,
    /// SHA-256 of `known.json`, if the training rewards rare failures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) known_sha256: Option<String>,
    /// File of the checkpoint and its SHA-256, during training.
    #[serde(default)]
    pub checkpoint: Option<(String, String)>,
    /// SHA-256 of `policy.safetensors`, once it exists.
    pub(crate) policy_sha256: Option<String>,
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
    pub(crate) window: Window,
}

/// Episodes since the last line of `progress.jsonl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Window {
    /// Number of episodes.
    pub(crate) episodes: u64,
    /// Episodes that the ado solved.
    pub(crate) solved: u64,
    /// Sum of their returns.
    pub(crate) returns: f64,
    /// Sum of the learner's mean losses.
    #[serde(default)]
    pub(crate) losses: f64,
    /// Number of updates with a loss.
    #[serde(default)]
    pub(crate) updates: u64,
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
        let not_a_run = |why: String| RunError::NotARun {
            path: run.into(),
            why,
        };
        if !run.is_dir() {
            let why = if run.exists() {
                "it is a file"
            } else {
                "there is no such directory"
            };
            return Err(not_a_run(why.to_owned()));
        }
        let file = run.join(FILE);
        if !file.is_file() && run.join(POPULATION).is_file() {
            return Err(RunError::Population { path: run.into() });
        }
        if !file.is_file() {
            return Err(not_a_run(format!("it has no `{FILE}`")));
        }
        let damaged = |path: &Path, why: String| RunError::Damaged {
            path: path.into(),
            why,
        };
        let text = read_text(&file)?;
        let invalid = |error: serde_json::Error| damaged(&file, error.to_string());
        // The version comes first, because another layout may lack any field.
        let Layout { format, against } = serde_json::from_str(&text).map_err(invalid)?;
        if format != FORMAT {
            return Err(damaged(&file, format!("format {format} is not {FORMAT}")));
        }
        if against.as_deref() == Some(CONDITIONAL) {
            return Err(RunError::Conditional { path: run.into() });
        }
        let mut manifest: Manifest = serde_json::from_str(&text).map_err(invalid)?;
        content_hash::check(&text, &manifest.sha256).map_err(|why| damaged(&file, why))?;
        manifest.cpu_s = read_timing(run, &manifest)?;
        Ok(manifest)
    }

    /// Returns the text of its file, with the hash.
    pub(super) fn sealed(&self, run: &Path) -> Result<String, RunError> {
        let blank = Manifest {
            sha256: content_hash::BLANK.to_owned(),
            ..self.clone()
        };
        let text = serde_json::to_string_pretty(&blank);
        let text = text.map_err(|error| RunError::Damaged {
            path: run.join(FILE),
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

    /// Returns true if training has finished.
    pub fn is_finished(&self) -> bool {
        self.policy_sha256.is_some()
    }
}

/// Changed ego of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangedEgo {
    /// Name in rows.
    pub(crate) name: String,
    /// Difference from the world's own ego.
    pub(crate) change: Change,
}

impl ChangedEgo {
    /// Returns true for the user's own controller, which is known by name only.
    pub fn is_own(&self) -> bool {
        self.change == Change::default()
    }
}
