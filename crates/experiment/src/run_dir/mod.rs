//! Run directory of a training: its world, policy, progress and results.
//!
//! ```text
//! RUN/world.ron                the world file, verbatim
//! RUN/manifest.json            version, seed, settings, hashes, its own among them
//! RUN/timing.json              processor time, sealed: the only difference of equal trainings
//! RUN/policy.safetensors       the trained ado
//! RUN/from.safetensors         the ado it was fine-tuned from, if any
//! RUN/known.json               the failures whose rarity it rewards, if any
//! RUN/progress.jsonl           one line per report of the learner
//! RUN/counterexamples.jsonl    the successes of the training, at most 50000
//! RUN/checkpoint-N.safetensors while training: the state for resuming after N decisions
//! RUN/report.json              the rows of the closing evaluation, sealed
//! RUN/episodes/                some counterexamples of the closing evaluation
//! RUN/lock                     held while training
//! ```
//!
//! Files are written beside their place, flushed and renamed. A full disk, a
//! killed process or a power cut therefore never leaves a half-written file.
//! Wherever a training is killed, its continuation ends in the same bytes.

mod about;
mod adversary_id;
pub mod cached_result;
mod calibration;
mod contact_severity;
mod counted;
pub mod counterexample;
mod differences;
mod failure_cell;
mod manifest;
mod number_or_word;
mod opening;
mod program_content;
mod progress;
mod repeated_runs;
mod row;
mod samples;
mod success_contacts;
mod swept;
mod trained_policy;
pub use trained_policy::trained_naturally;
mod training_counterexamples;

use std::fmt;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

pub use crate::run_files::append_log::Grown;
pub use crate::run_files::disk::{
    WholeFile, file_name, is_unfinished, make_dir, read_text, remove_empty_dir, write_file,
    write_output,
};
pub use crate::run_files::{MANIFEST, MEMBERS, POPULATION};
pub use crate::run_files::{OtherProgram, RunDifference, RunError};
pub use crate::world::RunsOnDisk;
pub use about::{
    About, Answer, DecisiveSpan, Effort, EgoRuns, LastChance, NoAnswer, NotAsked, Persistence,
    Severity, Shrunk, TrafficLikelihood, Variation, Why,
};
pub use adversary_id::keys as adversary_keys;
pub use adversary_id::{AdversaryId, SearchSettings};
pub use cached_result::CachedResult;
pub use calibration::{Calibration, CalibrationWarning, TrainingEnd};
pub use contact_severity::{ClosingSpeed, ContactSeverity};
pub use counted::counted;
pub use counterexample::{Counterexample, KeptError};
pub use counterexample::{digests_of, motion_after_contact};
pub use differences::RequestedTraining;
pub use failure_cell::{
    CLOSING_BIN_MPS, CellCount, CellFailure, FailureCell, KnownFailures, NecessaryAction,
};
pub use manifest::Window;
pub use manifest::{ChangedEgo, Done, Manifest, Sought};
pub use number_or_word::number_or_word;
pub use program_content::FILE as PROGRAMS;
pub use program_content::ProgramContent;
pub use program_content::{ProgramContents, bind_programs, joined_programs, stored_programs};
pub use progress::Progress;
pub use repeated_runs::{Repeated, StartRepeated};
pub use row::{Anytime, BrokenRule, FailsAlone, FailureCount, Partial, Row, Unconfirmed};
pub use samples::{ReadTrace, SamplesError, TraceOptions, read_trace, trace_of_csv};
pub use success_contacts::SuccessContacts;
pub use swept::{SweepPoint, Swept};
pub use training_counterexamples::Stored;
pub(crate) use training_counterexamples::StoredCount;

use crate::content_hash::sha256;
use crate::natural::NaturalTraining;
use crate::rl::TensorFile;
use crate::run_files::append_log::Growing;
use crate::run_files::disk::{self, io_error, is_taken, lock};
use crate::run_files::{BANK, COUNTEREXAMPLES, FORMAT, PROGRESS, TIMING, sealed};
use crate::testbench::KnownEpisode;
use crate::world::Scenario;
use manifest::settings_of;

/// Optional start conditions of a training.
#[derive(Clone, Debug, Default)]
pub struct Beginning<'a> {
    /// Policy to fine-tune.
    pub from: Option<&'a TensorFile>,
    /// Episodes of other trainings, to learn from.
    pub bank: &'a [KnownEpisode],
    /// Changed ego to train against.
    pub ego: Option<ChangedEgo>,
    /// Failures whose rarity is rewarded.
    pub known: Option<&'a KnownFailures>,
}

/// Open run directory.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    manifest: Manifest,
    /// Consent to start the programs that its world names. It is never written.
    programs_allowed: bool,
    /// True if foreign egos begin every episode anew.
    fresh_egos: bool,
    /// World on the plant of its file, once it was parsed.
    world: OnceLock<Scenario>,
    progress: Growing,
    counterexamples: Growing,
    _lock: Option<File>,
}

impl RunDir {
    /// Makes a new run directory and locks it.
    ///
    /// # Errors
    ///
    /// Returns an error if it exists with content, or cannot be written.
    pub fn create(path: &Path, scenario: &Scenario, seed: u64) -> Result<RunDir, RunError> {
        RunDir::begin(path, scenario, seed, Beginning::default())
    }

    /// Makes a new run directory for a training with start conditions.
    ///
    /// The manifest is written last, so a process that is killed earlier leaves
    /// no run.
    ///
    /// # Errors
    ///
    /// Returns an error if it exists with content, or cannot be written.
    pub fn begin(
        path: &Path,
        scenario: &Scenario,
        seed: u64,
        with: Beginning<'_>,
    ) -> Result<RunDir, RunError> {
        if is_taken(path) {
            return Err(RunError::Exists { path: path.into() });
        }
        make_dir(path)?;
        // Locked before the first write, so two processes cannot begin the same
        // run.
        let lock = lock(path)?;
        let mut run = RunDir {
            path: path.into(),
            manifest: Manifest {
                format: FORMAT,
                // Filled in with the seal, which covers all other fields.
                sha256: String::new(),
                brakecheck: version(),
                target: target(),
                world: scenario.name.clone(),
                world_sha256: sha256(scenario.text.as_bytes()),
                plant: scenario.plant(),
                seed,
                decisions: scenario.learner.decisions(),
                decisions_done: 0,
                episodes: 0,
                physics_steps: 0,
                sought: None,
                calibration: None,
                ended: None,
                cpu_s: 0.0,
                progress: Grown::default(),
                window: Window::default(),
                counterexamples: None,
                learner: scenario.learning.clone(),
                goals: scenario.goals.clone(),
                natural: NaturalTraining::of(scenario.traffic()),
                against: scenario.against,
                left_out: scenario.left_out.clone(),
                settings_fingerprint: Some(settings_of(scenario)),
                settings: serde_json::to_value(&scenario.learner).unwrap_or_default(),
                ego: with.ego,
                from_sha256: None,
                bank_sha256: None,
                known_sha256: None,
                checkpoint: None,
                policy_sha256: None,
            },
            programs_allowed: false,
            fresh_egos: false,
            world: OnceLock::new(),
            progress: Growing::new(path.join(PROGRESS)),
            counterexamples: Growing::new(path.join(COUNTEREXAMPLES)),
            _lock: Some(lock),
        };
        run.write("world.ron", scenario.text.as_bytes())?;
        if let Some(from) = with.from {
            let bytes = from.to_bytes().map_err(run.damaged("from.safetensors"))?;
            run.write("from.safetensors", &bytes)?;
            run.manifest.from_sha256 = Some(sha256(&bytes));
        }
        if !with.bank.is_empty() {
            let text = serde_json::to_string(with.bank).map_err(run.damaged(BANK))?;
            run.write(BANK, text.as_bytes())?;
            run.manifest.bank_sha256 = Some(sha256(text.as_bytes()));
        }
        run.write_known(with.known)?;
        run.write_manifest()?;
        Ok(run)
    }

    /// Returns the path of the directory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the manifest.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Returns the warning of an ado that is not reliable. `None` if there is none.
    pub fn warning(&self) -> Option<CalibrationWarning> {
        self.manifest.calibration?.warning()
    }

    /// Returns the checkpoint of an interrupted training.
    ///
    /// # Errors
    ///
    /// Returns an error if its file is missing or damaged.
    pub fn checkpoint(&self) -> Result<Option<TensorFile>, RunError> {
        let Some((name, expected)) = &self.manifest.checkpoint else {
            return Ok(None);
        };
        let bytes = self.read_verified(name, Some(expected))?;
        TensorFile::from_bytes(&bytes)
            .map(Some)
            .map_err(self.damaged(name))
    }

    /// Returns the episodes of other trainings from which this one learns.
    ///
    /// # Errors
    ///
    /// Returns an error if their file is missing or damaged.
    pub fn bank(&self) -> Result<Arc<[KnownEpisode]>, RunError> {
        let Some(expected) = &self.manifest.bank_sha256 else {
            return Ok(Arc::default());
        };
        let bytes = self.read_verified(BANK, Some(expected))?;
        let known: Vec<KnownEpisode> =
            serde_json::from_slice(&bytes).map_err(self.damaged(BANK))?;
        Ok(known.into())
    }

    /// Returns the initial policy of a fine-tuning.
    ///
    /// # Errors
    ///
    /// Returns an error if its file is missing or damaged.
    pub fn from(&self) -> Result<Option<TensorFile>, RunError> {
        let Some(expected) = &self.manifest.from_sha256 else {
            return Ok(None);
        };
        let bytes = self.read_verified("from.safetensors", Some(expected))?;
        TensorFile::from_bytes(&bytes)
            .map(Some)
            .map_err(self.damaged("from.safetensors"))
    }

    /// Stores a checkpoint and the progress of the training.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses. The previous checkpoint is then
    /// still valid.
    pub fn save_checkpoint(&mut self, bundle: &TensorFile, done: Done) -> Result<(), RunError> {
        // Named by its decisions, so that a later one never overwrites the one in use.
        let name = format!("checkpoint-{}.safetensors", done.decisions);
        let bytes = bundle.to_bytes().map_err(self.damaged(&name))?;
        self.write(&name, &bytes)?;
        // The manifest switches to the new file. Only then is the old file
        // removed.
        let before = self.manifest.checkpoint.replace((name, sha256(&bytes)));
        self.note(done)?;
        self.write_manifest()?;
        self.forget(before)
    }

    /// Records the search before the first episode, for the next checkpoint.
    pub fn note_sought(&mut self, sought: Sought) {
        self.manifest.sought = Some(sought);
    }

    /// Stores the trained ado and removes the checkpoint.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses. The last checkpoint is then still
    /// valid.
    pub fn save_policy(&mut self, bundle: &TensorFile, done: Done) -> Result<(), RunError> {
        let bytes = bundle
            .to_bytes()
            .map_err(self.damaged("policy.safetensors"))?;
        self.write("policy.safetensors", &bytes)?;
        // A finished run is used by its policy, so it names no checkpoint any more.
        let before = self.manifest.checkpoint.take();
        self.manifest.policy_sha256 = Some(sha256(&bytes));
        self.note(done)?;
        self.write_manifest()?;
        self.forget(before)
    }

    /// Removes a checkpoint that the manifest no longer names.
    fn forget(&self, checkpoint: Option<(String, String)>) -> Result<(), RunError> {
        let now = self.manifest.checkpoint.as_ref();
        match checkpoint {
            // A checkpoint after the same number of decisions has the same file
            // name.
            Some((name, _)) if now.is_none_or(|(current, _)| *current != name) => {
                let path = self.path.join(name);
                disk::remove(&path).map_err(io_error("removing", &path))
            }
            _ => Ok(()),
        }
    }

    fn unfinished(&self) -> RunError {
        RunError::Unfinished {
            path: self.path.clone(),
            done: self.manifest.decisions_done,
            requested: self.manifest.decisions,
        }
    }

    /// Records the progress of the training, and the valid parts of the growing files.
    fn note(&mut self, done: Done) -> Result<(), RunError> {
        self.manifest.decisions = done.decisions_asked;
        self.manifest.decisions_done = done.decisions;
        self.manifest.episodes = done.episodes;
        self.manifest.physics_steps = done.physics_steps;
        self.manifest.cpu_s = done.cpu_s;
        self.manifest.window = done.window;
        self.manifest.calibration = done.calibration;
        self.manifest.ended = done.ended;
        self.manifest.progress = self.progress.now();
        if let Some(count) = &mut self.manifest.counterexamples {
            count.note(self.counterexamples.now());
        }
        // Before the manifest, whose reader requires the time of the same checkpoint.
        self.write(TIMING, &self.manifest.timing())
    }

    fn write_manifest(&self) -> Result<(), RunError> {
        let text = self.manifest.sealed(&self.path)?;
        self.write(MANIFEST, text.as_bytes())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), RunError> {
        write_file(&self.path.join(name), bytes)
    }

    fn read_text(&self, name: &str) -> Result<String, RunError> {
        disk::read_text(&self.path.join(name))
    }

    fn read_verified(&self, name: &str, expected: Option<&str>) -> Result<Vec<u8>, RunError> {
        sealed::read_verified(&self.path, name, expected)
    }

    fn damaged<E: fmt::Display>(&self, name: &str) -> impl Fn(E) -> RunError + use<E> {
        let path = self.path.join(name);
        move |error| RunError::Damaged {
            path: path.clone(),
            why: error.to_string(),
        }
    }
}

/// Version of this program.
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}

/// Processor and operating system of this program.
fn target() -> String {
    format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
}
