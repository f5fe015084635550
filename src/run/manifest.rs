//! What a run directory says of itself.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::calibration::{Calibration, Ended};
use super::disk::read_text;
use super::stored::StoredCount;
use super::{FORMAT, RunError};
use crate::scenario::{Against, Change};
use crate::scene::Dynamics;
use crate::seal;

pub(super) const FILE: &str = "manifest.json";
/// Apart, since it is measured: equal trainings take different times.
pub(super) const TIMING: &str = "timing.json";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Timing {
    cpu_s: f64,
    /// Its own: manifests of equal trainings are equal. Formats before the third
    /// had none.
    #[serde(default)]
    seal: Option<String>,
}

/// The processor time in the file beside the manifest; none before the first
/// checkpoint.
fn read_timing(run: &Path, manifest: &Manifest) -> Result<f64, RunError> {
    let (path, format) = (&run.join(TIMING), manifest.format);
    let damaged = |why: String| RunError::Damaged {
        path: path.into(),
        why,
    };
    if !path.is_file() {
        // It is written before every checkpoint and before the policy.
        let is_due = manifest.checkpoint.is_some() || manifest.is_finished();
        return match is_due && 3 <= format {
            true => Err(RunError::NotARun {
                path: run.into(),
                why: format!("`{TIMING}` is missing"),
            }),
            false => Ok(0.0),
        };
    }
    let text = read_text(path)?;
    let read: Timing = serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
    match read.seal {
        None if format < 3 => {}
        seal => seal::check(&text, &seal.unwrap_or_default()).map_err(damaged)?,
    }
    Ok(read.cpu_s)
}

/// What a run was, and the hashes of its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the layout.
    pub format: u32,
    /// SHA-256 of this file with zeros in its place; empty: an earlier version
    /// wrote it, and nothing would notice a changed number.
    #[serde(default)]
    pub sha256: String,
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
    /// What a search of training starts brought and cost before the learner's first
    /// episode; `None`: it wanted none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sought: Option<Sought>,
    /// The ado beside a cheap search on calibration starts, as of the last time
    /// that it was trained as long as asked; `None`: an earlier version trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<Calibration>,
    /// Why it ended, once it has; `None`: an earlier version trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended: Option<Ended>,
    /// Processor time spent in training. It is in `timing.json`, so that equal
    /// trainings have equal manifests.
    #[serde(default, skip_serializing)]
    pub cpu_s: f64,
    /// How much of `progress.jsonl` counts.
    #[serde(default, skip_serializing_if = "Grown::is_nothing")]
    pub progress: Grown,
    /// The report of the learner that is not yet a line there.
    #[serde(default, skip_serializing_if = "Window::is_empty")]
    pub window: Window,
    /// How many counterexamples it brought; `None`: an earlier version trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counterexamples: Option<StoredCount>,
    /// Which of the world's `learners` trained; `None`: its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learner: Option<String>,
    /// What it was trained against.
    #[serde(default, skip_serializing_if = "Against::is_nominal")]
    pub against: Against,
    /// The structure of its family that it never met.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
    /// Of the learner's and the family's settings, defaults included; `None`:
    /// an earlier version did not note it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settings_sha256: Option<String>,
    /// The learner's settings, defaults included; `None`: an earlier version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settings: Option<serde_json::Value>,
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

/// A search of training starts for what a learner is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sought {
    /// Starts searched.
    pub starts: u64,
    /// Those on which the ego was made to fail.
    pub solved: u64,
    /// Simulations spent.
    pub simulations: u64,
    /// Physics steps spent; those of the manifest include them.
    pub physics_steps: u64,
}

/// How far training has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Done {
    /// Decisions asked for.
    pub decisions_asked: u64,
    /// Decisions taken.
    pub decisions: u64,
    /// Episodes finished.
    pub episodes: u64,
    /// Physics steps spent.
    pub physics_steps: u64,
    /// Processor time spent.
    pub cpu_s: f64,
    /// The ado beside a cheap search, once it is trained.
    pub calibration: Option<Calibration>,
    /// Why it ended, once it has.
    pub ended: Option<Ended>,
    /// Episodes that no line of `progress.jsonl` tells of yet.
    pub window: Window,
}

/// How much of a file that only grows counts, as of the last checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grown {
    /// Its first bytes; what stands behind them was written after it.
    pub bytes: u64,
    /// Their SHA-256.
    pub sha256: String,
}

impl Grown {
    fn is_nothing(&self) -> bool {
        self.bytes == 0
    }
}

/// Episodes since the last line of `progress.jsonl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// How many.
    pub episodes: u64,
    /// Those that the ado solved.
    pub solved: u64,
    /// Sum of their returns.
    pub returns: f64,
}

impl Window {
    fn is_empty(&self) -> bool {
        self.episodes == 0
    }
}

impl Manifest {
    /// Whether it holds its own hash; earlier versions wrote none.
    pub fn is_sealed(&self) -> bool {
        !self.sha256.is_empty()
    }

    /// Reads and verifies that of a run directory.
    ///
    /// # Errors
    /// There is none, or it is damaged.
    pub(super) fn read(run: &Path) -> Result<Manifest, RunError> {
        let not_a_run = |why: String| RunError::NotARun {
            path: run.into(),
            why,
        };
        if !run.is_dir() {
            let why = match run.exists() {
                true => "it is a file",
                false => "there is no such directory",
            };
            return Err(not_a_run(why.to_owned()));
        }
        let file = run.join(FILE);
        if !file.is_file() {
            return Err(not_a_run(format!("it has no `{FILE}`")));
        }
        let damaged = |path: &Path, why: String| RunError::Damaged {
            path: path.into(),
            why,
        };
        let text = read_text(&file)?;
        let mut manifest: Manifest =
            serde_json::from_str(&text).map_err(|error| damaged(&file, error.to_string()))?;
        if !(1..=FORMAT).contains(&manifest.format) {
            let why = format!("format {} is not 1 to {FORMAT}", manifest.format);
            return Err(damaged(&file, why));
        }
        // The first format held neither a hash nor a file for the time.
        if 1 < manifest.format || manifest.is_sealed() {
            seal::check(&text, &manifest.sha256).map_err(|why| damaged(&file, why))?;
            manifest.cpu_s = read_timing(run, &manifest)?;
        }
        Ok(manifest)
    }

    /// As its file holds it.
    pub(super) fn sealed(&self, run: &Path) -> Result<String, RunError> {
        let blank = Manifest {
            sha256: seal::BLANK.to_owned(),
            ..self.clone()
        };
        let text = serde_json::to_string_pretty(&blank);
        let text = text.map_err(|error| RunError::Damaged {
            path: run.join(FILE),
            why: error.to_string(),
        })?;
        Ok(seal::seal(&text))
    }

    /// The file beside it that holds the time.
    pub(super) fn timing(&self) -> Vec<u8> {
        let timing = Timing {
            cpu_s: self.cpu_s,
            seal: Some(seal::BLANK.to_owned()),
        };
        seal::seal(&serde_json::json!(timing).to_string()).into_bytes()
    }

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

impl ChangedEgo {
    /// Whether it is the user's own controller, of which a name is all there is.
    pub fn is_own(&self) -> bool {
        self.change == Change::default()
    }
}
