//! The run directory: everything needed later, nothing else.
//!
//! ```text
//! RUN/world.ron                the world file, verbatim
//! RUN/manifest.json            version, seed, settings, hashes, its own among them
//! RUN/timing.json              processor time, sealed: all that equal trainings differ in
//! RUN/policy.safetensors       the trained ado
//! RUN/from.safetensors         the ado it was fine-tuned from, if any
//! RUN/progress.jsonl           one line per report of the learner
//! RUN/counterexamples.jsonl    the successes of the training, at most 50000
//! RUN/checkpoint-N.safetensors while training: all that resuming after N decisions needs
//! RUN/report.json              the rows of the closing evaluation, sealed
//! RUN/episodes/                some counterexamples of the closing evaluation
//! RUN/lock                     held while training
//! ```
//!
//! Files are written beside their place, flushed and renamed, so that a full
//! disk, a killed process or a power cut never leaves a half-written one behind.
//! Wherever a training is killed: going on ends in the same bytes.

mod about;
mod calibration;
mod copy;
mod differences;
pub(crate) mod disk;
mod error;
mod finished;
mod grown;
mod interval;
mod kept;
mod manifest;
mod named;
mod outcome;
mod progress;
mod repeated;
mod row;
mod samples;
mod stored;
mod told;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

pub use about::{
    About, Decisive, Effort, EgoRuns, LastChance, NotAsked, Persistence, Severity, Shrunk,
    Variation, Why,
};
pub use calibration::{Calibration, CalibrationWarning, Ended};
pub use differences::{Asked, RunDifference};
pub use disk::{WholeFile, file_name, make_dir, write_file};
pub use error::RunError;
pub use finished::Finished;
pub use interval::{
    at_most, mcnemar, mean_difference, paired_difference, predicted, runs_interval, seeds_interval,
    wilson,
};
pub use kept::{Counterexample, KeptError, csv_of, digests_of};
pub use manifest::{ChangedEgo, Done, Grown, Manifest, Sought, Window};
pub use named::RunsOnDisk;
pub use outcome::{Outcomes, StartOutcome, UnknownMark};
pub use progress::Progress;
pub use repeated::{Repeated, StartRepeated};
pub use row::{Anytime, ClosingSpeed, ContactSeverity, FailsAlone, FailureKind, Row, Unconfirmed};
pub use samples::{SamplesError, trace_of_csv};
pub use stored::{MAX_STORED, Stored, StoredCount};

use crate::rl::{Bundle, BundleError, Policy, load_policy_for};
use crate::scenario::{Against, LoadError, Scenario, file_bytes};
use crate::seal::sha256;
use disk::{io_error, is_taken, lock, settings_of};
use grown::Growing;

/// Version of the layout; earlier ones are read, later ones are refused. In the
/// first one the manifest was not sealed and held the processor time, in the
/// second one `timing.json` and `report.json` were not sealed.
const FORMAT: u32 = 3;

/// What a training begins with besides its world.
#[derive(Clone, Debug, Default)]
pub struct Beginning<'a> {
    /// The policy to fine-tune.
    pub from: Option<&'a Bundle>,
    /// The changed ego to train against.
    pub ego: Option<ChangedEgo>,
}

/// An open run directory.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    manifest: Manifest,
    /// Consent to start the programs that its world names; never written down.
    programs_allowed: bool,
    progress: Growing,
    counterexamples: Growing,
    _lock: Option<File>,
}

impl RunDir {
    /// Makes a new run directory and locks it.
    ///
    /// # Errors
    /// It exists and holds something, or cannot be written.
    pub fn create(path: &Path, scenario: &Scenario, seed: u64) -> Result<RunDir, RunError> {
        RunDir::begin(path, scenario, seed, Beginning::default())
    }

    /// The same of a training that begins with more than its world.
    ///
    /// The manifest is written last: whoever is killed before has begun nothing.
    ///
    /// # Errors
    /// It exists and holds something, or cannot be written.
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
        let lock = lock(path)?;
        let mut run = RunDir {
            path: path.into(),
            manifest: Manifest {
                format: FORMAT,
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
                against: scenario.against,
                left_out: scenario.left_out.clone(),
                settings_sha256: Some(settings_of(scenario)),
                settings: serde_json::to_value(&scenario.learner).ok(),
                told: told_names(scenario),
                ego: with.ego,
                from_sha256: None,
                checkpoint: None,
                policy_sha256: None,
            },
            programs_allowed: false,
            progress: Growing::new(path.join(progress::FILE)),
            counterexamples: Growing::new(path.join(stored::FILE)),
            _lock: Some(lock),
        };
        run.write("world.ron", scenario.text.as_bytes())?;
        if let Some(from) = with.from {
            let bytes = from.to_bytes().map_err(run.damaged("from.safetensors"))?;
            run.write("from.safetensors", &bytes)?;
            run.manifest.from_sha256 = Some(sha256(&bytes));
        }
        run.write_manifest()?;
        Ok(run)
    }

    /// Opens a run directory for reading and verifies its hashes.
    ///
    /// # Errors
    /// It is none, or a file in it is damaged.
    pub fn open(path: &Path) -> Result<RunDir, RunError> {
        let manifest = Manifest::read(path)?;
        let run = RunDir {
            path: path.into(),
            manifest,
            programs_allowed: false,
            progress: Growing::new(path.join(progress::FILE)),
            counterexamples: Growing::new(path.join(stored::FILE)),
            _lock: None,
        };
        run.verify()?;
        Ok(run)
    }

    /// Verifies every file whose hash the manifest knows, so that whatever is
    /// computed from the run later is computed from what was written.
    ///
    /// The checkpoint is left to those who go on from it: somebody may be
    /// training, and replaces it.
    fn verify(&self) -> Result<(), RunError> {
        let manifest = &self.manifest;
        self.read_verified("world.ron", Some(&manifest.world_sha256))?;
        if let Some(from) = &manifest.from_sha256 {
            self.read_verified("from.safetensors", Some(from))?;
        }
        if let Some(policy) = &manifest.policy_sha256 {
            self.read_verified("policy.safetensors", Some(policy))?;
        }
        if manifest.is_sealed() {
            let stored = manifest.counterexamples.as_ref();
            let stored = stored.filter(|known| known.sha256.is_some());
            let files = [
                (progress::FILE, Some(manifest.progress.clone())),
                (stored::FILE, stored.map(StoredCount::grown)),
            ];
            for (name, known) in files {
                let path = self.path.join(name);
                // An ado that was taken elsewhere has neither.
                if let (Some(known), true) = (known, path.exists()) {
                    grown::verified(&path, &known, manifest.is_finished())?;
                }
            }
        }
        Ok(())
    }

    /// Opens a run directory to go on training in it: as of its last checkpoint,
    /// whatever was written since is taken away.
    ///
    /// # Errors
    /// It is none, is damaged, or another process trains in it.
    pub fn resume(path: &Path) -> Result<RunDir, RunError> {
        // Nothing is made where there is no run; what counts is read under the lock.
        Manifest::read(path)?;
        let lock = lock(path)?;
        let mut run = RunDir::open(path)?;
        run._lock = Some(lock);
        run.sweep()?;
        // Earlier versions noted no lengths, and are not gone on with.
        if !run.manifest.is_finished() && run.manifest.is_sealed() {
            let (progress, stored) = (path.join(progress::FILE), path.join(stored::FILE));
            run.progress = Growing::cut_back(progress, &run.manifest.progress)?;
            let known = run.manifest.counterexamples.as_ref();
            let known = known.map_or(Grown::default(), StoredCount::grown);
            run.counterexamples = Growing::cut_back(stored, &known)?;
        }
        Ok(run)
    }

    /// Resumes a run that was opened for reading only.
    ///
    /// # Errors
    /// It is damaged, or another process trains in it.
    pub(crate) fn hold(&mut self) -> Result<(), RunError> {
        if self._lock.is_none() {
            let allowed = self.programs_allowed;
            *self = RunDir::resume(&self.path.clone())?;
            self.programs_allowed = allowed;
        }
        Ok(())
    }

    /// Removes what a killed training left: half-written files, and checkpoints
    /// that the manifest does not name.
    fn sweep(&self) -> Result<(), RunError> {
        let failed = io_error("removing", &self.path);
        disk::sweep(&self.path);
        let current = self.manifest.checkpoint.as_ref().map(|(name, _)| name);
        for entry in fs::read_dir(&self.path).map_err(&failed)?.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_checkpoint = name.starts_with("checkpoint-") && name.ends_with(".safetensors");
            if is_checkpoint && current != Some(&name) {
                disk::remove(&entry.path()).map_err(&failed)?;
            }
        }
        Ok(())
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it was.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Why its ado cannot be relied on; `None`: nothing speaks against it.
    pub fn warning(&self) -> Option<CalibrationWarning> {
        self.manifest.calibration?.warning()
    }

    /// The world it was trained in, on the plant it was trained on.
    ///
    /// # Errors
    /// The kept world file is not usable by this version.
    pub fn scenario(&self) -> Result<Scenario, RunError> {
        let world = self.world()?;
        Ok(match self.manifest.plant.plant() {
            Some(plant) => world.on(plant),
            None => world,
        })
    }

    /// Consents to start the programs that its world and their changes name.
    pub fn allow_programs(&mut self, allowed: bool) {
        self.programs_allowed = allowed;
    }

    /// The world as its file says: on the plant named there.
    ///
    /// # Errors
    /// The kept world file is not usable by this version.
    pub fn world(&self) -> Result<Scenario, RunError> {
        let file = self.path.join("world.ron");
        match Scenario::load(&file) {
            Ok(scenario) => self.as_learned(scenario.allow_programs(self.programs_allowed)),
            Err(LoadError::Io { source, .. }) => Err(io_error("reading", &file)(source)),
            Err(LoadError::Scenario(error)) => Err(RunError::World(error)),
        }
    }

    /// The world with the learner and the family that the manifest names.
    fn as_learned(&self, world: Scenario) -> Result<Scenario, RunError> {
        let against = self.manifest.against;
        if !against.is_nominal() {
            let left_out = self.manifest.left_out.as_deref();
            let world = match left_out {
                Some(structure) => world.leaving_out(structure),
                None => Some(world),
            };
            let world = world.and_then(|world| world.training_against(against));
            let told = world.as_ref().map(told_names);
            let fits = told.is_some_and(|told| told == self.manifest.told);
            return world.filter(|_| fits).ok_or_else(|| RunError::Damaged {
                path: self.path.join("manifest.json"),
                why: format!("its world has another family than the {against} ado was trained on"),
            });
        }
        let Some(name) = &self.manifest.learner else {
            return Ok(world);
        };
        world.learning_by(name).ok_or_else(|| RunError::Damaged {
            path: self.path.join("manifest.json"),
            why: format!("its world has no learner `{name}`"),
        })
    }

    /// The trained ado.
    ///
    /// # Errors
    /// There is none yet, its file is damaged, or it must be told which ego it
    /// meets ([`RunDir::policy_told`]).
    pub fn policy(&self) -> Result<Box<dyn Policy>, RunError> {
        if self.manifest.against == Against::Conditional {
            return Err(RunError::Untold {
                path: self.path.clone(),
                names: self.manifest.told.clone(),
            });
        }
        self.shaped_policy(&self.scenario()?, &self.policy_bundle()?)
    }

    fn shaped_policy(
        &self,
        scenario: &Scenario,
        bundle: &Bundle,
    ) -> Result<Box<dyn Policy>, RunError> {
        load_policy_for(&scenario.spaces(), bundle).map_err(self.damaged("policy.safetensors"))
    }

    /// The trained ado as stored.
    ///
    /// # Errors
    /// There is none yet, or its file is damaged.
    pub fn policy_bundle(&self) -> Result<Bundle, RunError> {
        Bundle::from_bytes(&self.policy_bytes()?).map_err(self.damaged("policy.safetensors"))
    }

    fn policy_bytes(&self) -> Result<Vec<u8>, RunError> {
        let Some(expected) = &self.manifest.policy_sha256 else {
            return Err(self.unfinished());
        };
        self.read_verified("policy.safetensors", Some(expected))
    }

    /// The checkpoint to go on from, if training was interrupted.
    ///
    /// # Errors
    /// Its file is missing or damaged.
    pub fn checkpoint(&self) -> Result<Option<Bundle>, RunError> {
        let Some((name, expected)) = &self.manifest.checkpoint else {
            return Ok(None);
        };
        let bytes = self.read_verified(name, Some(expected))?;
        Bundle::from_bytes(&bytes)
            .map(Some)
            .map_err(self.damaged(name))
    }

    /// The policy that a fine-tuning begins with.
    ///
    /// # Errors
    /// Its file is missing or damaged.
    pub fn from(&self) -> Result<Option<Bundle>, RunError> {
        let Some(expected) = &self.manifest.from_sha256 else {
            return Ok(None);
        };
        let bytes = self.read_verified("from.safetensors", Some(expected))?;
        Bundle::from_bytes(&bytes)
            .map(Some)
            .map_err(self.damaged("from.safetensors"))
    }

    /// Stores a checkpoint and how far training has come.
    ///
    /// # Errors
    /// The disk refuses; the previous checkpoint is then still in force.
    pub fn save_checkpoint(&mut self, bundle: &Bundle, done: Done) -> Result<(), RunError> {
        let name = format!("checkpoint-{}.safetensors", done.decisions);
        let bytes = bundle.to_bytes().map_err(self.damaged(&name))?;
        self.write(&name, &bytes)?;
        let before = self.manifest.checkpoint.replace((name, sha256(&bytes)));
        self.note(done)?;
        self.write_manifest()?;
        self.forget(before)
    }

    /// Notes what was looked for before the first episode; it is written with the
    /// next checkpoint.
    pub fn note_sought(&mut self, sought: Sought) {
        self.manifest.sought = Some(sought);
    }

    /// Stores the trained ado; the checkpoint is no longer needed.
    ///
    /// # Errors
    /// The disk refuses; the last checkpoint is then still in force.
    pub fn save_policy(&mut self, bundle: &Bundle, done: Done) -> Result<(), RunError> {
        let bytes = bundle
            .to_bytes()
            .map_err(self.damaged("policy.safetensors"))?;
        self.write("policy.safetensors", &bytes)?;
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
            asked: self.manifest.decisions,
        }
    }

    /// Notes how far training has come, and how much of the growing files counts.
    fn note(&mut self, done: Done) -> Result<(), RunError> {
        self.manifest.format = FORMAT;
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
        self.write(manifest::TIMING, &self.manifest.timing())
    }

    fn write_manifest(&self) -> Result<(), RunError> {
        let text = self.manifest.sealed(&self.path)?;
        self.write(manifest::FILE, text.as_bytes())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), RunError> {
        write_file(&self.path.join(name), bytes)
    }

    fn read_text(&self, name: &str) -> Result<String, RunError> {
        disk::read_text(&self.path.join(name))
    }

    fn read_verified(&self, name: &str, expected: Option<&str>) -> Result<Vec<u8>, RunError> {
        let path = self.path.join(name);
        let bytes = file_bytes(&path).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => RunError::NotARun {
                path: self.path.clone(),
                why: format!("`{name}` is missing"),
            },
            _ => io_error("reading", &path)(source),
        })?;
        let found = sha256(&bytes);
        match expected {
            Some(expected) if expected != found => Err(RunError::Damaged {
                path,
                why: format!("SHA-256 is {found}, the manifest says {expected}"),
            }),
            _ => Ok(bytes),
        }
    }

    fn damaged(&self, name: &str) -> impl Fn(BundleError) -> RunError + use<> {
        let path = self.path.join(name);
        move |error| RunError::Damaged {
            path: path.clone(),
            why: error.to_string(),
        }
    }
}

/// What an ado of this training is told besides its observation.
fn told_names(scenario: &Scenario) -> Vec<String> {
    match (scenario.against, scenario.family()) {
        (Against::Conditional, Some(family)) => family.told_names(),
        _ => Vec::new(),
    }
}

/// Version of this program.
fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}

/// Processor and operating system of this program.
fn target() -> String {
    format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
}
