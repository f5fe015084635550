//! The run directory: everything needed later, nothing else.
//!
//! ```text
//! RUN/world.ron                the world file, verbatim
//! RUN/manifest.json            version, seed, target, hashes
//! RUN/policy.safetensors       the trained ado
//! RUN/from.safetensors         the ado it was fine-tuned from, if any
//! RUN/progress.jsonl           one line per report of the learner
//! RUN/counterexamples.jsonl    the successes of the training, at most 50000
//! RUN/checkpoint-N.safetensors while training: all that resuming after N decisions needs
//! RUN/report.json              the rows of the closing evaluation
//! RUN/episodes/                some counterexamples of the closing evaluation
//! RUN/lock                     held while training
//! ```
//!
//! Files are written beside their place and renamed, so a full disk or a
//! killed process never leaves a half-written one behind.

mod disk;
mod error;
mod finished;
mod identified;
mod interval;
mod kept;
mod manifest;
mod progress;
mod repeated;
mod row;
mod samples;
mod stored;
mod told;

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

pub use disk::{file_name, write_file};
pub use error::RunError;
pub use finished::Finished;
pub use identified::{AdaptedEgo, IdentifiedEgo, IdentifiedEgos, IdentifiedError};
pub use interval::{
    at_most, mean_difference, paired_difference, runs_interval, seeds_interval, wilson,
};
pub use kept::{Counterexample, KeptError, csv_of, digests_of};
pub use manifest::{ChangedEgo, Manifest};
pub use progress::Progress;
pub use repeated::{Repeated, StartRepeated};
pub use row::{Anytime, ClosingSpeed, Row, Unconfirmed};
pub use samples::{SamplesError, trace_of_csv};
pub use stored::{MAX_STORED, Stored, StoredCount};

use crate::rl::{Bundle, BundleError, Policy, load_policy_for};
use crate::scenario::{Against, LoadError, Scenario};
use disk::{io_error, is_taken, lock, settings_of, sha256};

/// Version of the layout; another one is refused.
const FORMAT: u32 = 1;

/// An open run directory.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    manifest: Manifest,
    /// Consent to start the programs that its world names; never written down.
    programs_allowed: bool,
    _lock: Option<File>,
}

impl RunDir {
    /// Makes a new run directory and locks it.
    ///
    /// # Errors
    /// It exists and holds something, or cannot be written.
    pub fn create(path: &Path, scenario: &Scenario, seed: u64) -> Result<RunDir, RunError> {
        if is_taken(path) {
            return Err(RunError::Exists { path: path.into() });
        }
        fs::create_dir_all(path).map_err(io_error("creating", path))?;
        let lock = lock(path)?;
        let run = RunDir {
            path: path.into(),
            manifest: Manifest {
                format: FORMAT,
                brakecheck: env!("CARGO_PKG_VERSION").to_owned(),
                target: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
                world: scenario.name.clone(),
                world_sha256: sha256(scenario.text.as_bytes()),
                plant: scenario.plant(),
                seed,
                decisions: scenario.learner.decisions(),
                decisions_done: 0,
                episodes: 0,
                physics_steps: 0,
                cpu_s: 0.0,
                counterexamples: None,
                learner: scenario.learning.clone(),
                against: scenario.against,
                settings_sha256: Some(settings_of(scenario)),
                told: told_names(scenario),
                ego: None,
                from_sha256: None,
                checkpoint: None,
                policy_sha256: None,
            },
            programs_allowed: false,
            _lock: Some(lock),
        };
        run.write("world.ron", scenario.text.as_bytes())?;
        run.write_manifest()?;
        Ok(run)
    }

    /// Opens a run directory for reading and verifies its hashes.
    ///
    /// # Errors
    /// It is none, or a file in it is damaged.
    pub fn open(path: &Path) -> Result<RunDir, RunError> {
        let not_a_run = |why: String| RunError::NotARun {
            path: path.into(),
            why,
        };
        if !path.is_dir() {
            return Err(not_a_run("there is no such directory".to_owned()));
        }
        let file = path.join("manifest.json");
        if !file.is_file() {
            return Err(not_a_run("it has no `manifest.json`".to_owned()));
        }
        let text = fs::read(&file).map_err(io_error("reading", &file))?;
        let manifest: Manifest =
            serde_json::from_slice(&text).map_err(|error| RunError::Damaged {
                path: file.clone(),
                why: error.to_string(),
            })?;
        if manifest.format != FORMAT {
            return Err(RunError::Damaged {
                path: file,
                why: format!("format {} is not {FORMAT}", manifest.format),
            });
        }
        let run = RunDir {
            path: path.into(),
            manifest,
            programs_allowed: false,
            _lock: None,
        };
        run.read_verified("world.ron", Some(&run.manifest.world_sha256))?;
        Ok(run)
    }

    /// Opens a run directory to go on training in it.
    ///
    /// # Errors
    /// It is none, is damaged, or another process trains in it.
    pub fn resume(path: &Path) -> Result<RunDir, RunError> {
        let mut run = RunDir::open(path)?;
        run._lock = Some(lock(path)?);
        Ok(run)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it is of this very world, on its plant, with its decisions and
    /// every other setting of its learner, against the same ego or family.
    pub fn is_of(&self, scenario: &Scenario) -> bool {
        self.manifest.world_sha256 == sha256(scenario.text.as_bytes())
            && self.manifest.plant == scenario.plant()
            && self.manifest.decisions == scenario.learner.decisions()
            && self.manifest.against == scenario.against
            && self.manifest.ego.is_none()
            && self
                .manifest
                .settings_sha256
                .as_ref()
                .is_none_or(|hash| *hash == settings_of(scenario))
    }

    /// What it was.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
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
            let world = world.training_against(against);
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
        let Some(expected) = &self.manifest.policy_sha256 else {
            return Err(self.unfinished());
        };
        let bytes = self.read_verified("policy.safetensors", Some(expected))?;
        Bundle::from_bytes(&bytes).map_err(self.damaged("policy.safetensors"))
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

    /// Notes the changed ego that is trained against.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn save_ego(&mut self, ego: ChangedEgo) -> Result<(), RunError> {
        self.manifest.ego = Some(ego);
        self.write_manifest()
    }

    /// Keeps the policy that a fine-tuning begins with.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn save_from(&mut self, bundle: &Bundle) -> Result<(), RunError> {
        let bytes = bundle
            .to_bytes()
            .map_err(self.damaged("from.safetensors"))?;
        self.write("from.safetensors", &bytes)?;
        self.manifest.from_sha256 = Some(sha256(&bytes));
        self.write_manifest()
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
        self.note(done);
        self.write_manifest()?;
        self.forget(before)
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
        self.seal_counterexamples()?;
        let before = self.manifest.checkpoint.take();
        self.manifest.policy_sha256 = Some(sha256(&bytes));
        self.note(done);
        self.write_manifest()?;
        self.forget(before)
    }

    /// Removes a checkpoint that the manifest no longer names.
    fn forget(&self, checkpoint: Option<(String, String)>) -> Result<(), RunError> {
        let now = self.manifest.checkpoint.as_ref();
        match checkpoint {
            Some((name, _)) if now.is_none_or(|(current, _)| *current != name) => {
                let path = self.path.join(name);
                fs::remove_file(&path).map_err(io_error("removing", &path))
            }
            _ => Ok(()),
        }
    }

    /// Cuts `progress.jsonl` back to what the checkpoint knows.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn trim_progress(&self) -> Result<(), RunError> {
        let path = self.path.join("progress.jsonl");
        let Ok(text) = fs::read_to_string(&path) else {
            return Ok(());
        };
        let known = |line: &&str| {
            let line: Result<serde_json::Value, _> = serde_json::from_str(line);
            let decisions = line.ok().and_then(|line| line["decisions"].as_u64());
            decisions.is_some_and(|decisions| decisions <= self.manifest.decisions_done)
        };
        let lines = text.lines().filter(known).map(|line| format!("{line}\n"));
        write_file(&path, lines.collect::<String>().as_bytes())
    }

    /// Appends lines to `progress.jsonl`.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn append_progress(&self, lines: &str) -> Result<(), RunError> {
        let path = self.path.join("progress.jsonl");
        fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(&path)
            .and_then(|mut file| file.write_all(lines.as_bytes()))
            .map_err(io_error("writing", &path))
    }

    /// Stores the rows of the closing evaluation.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn save_report(&self, rows: &[Row]) -> Result<(), RunError> {
        let text = serde_json::to_string_pretty(rows).map_err(|error| RunError::Damaged {
            path: self.path.join("report.json"),
            why: error.to_string(),
        })?;
        self.write("report.json", text.as_bytes())
    }

    fn unfinished(&self) -> RunError {
        RunError::Unfinished {
            path: self.path.clone(),
            done: self.manifest.decisions_done,
            asked: self.manifest.decisions,
        }
    }

    fn note(&mut self, done: Done) {
        self.manifest.decisions = done.decisions_asked;
        self.manifest.decisions_done = done.decisions;
        self.manifest.episodes = done.episodes;
        self.manifest.physics_steps = done.physics_steps;
        self.manifest.cpu_s = done.cpu_s;
    }

    fn write_manifest(&self) -> Result<(), RunError> {
        let text =
            serde_json::to_string_pretty(&self.manifest).map_err(|error| RunError::Damaged {
                path: self.path.join("manifest.json"),
                why: error.to_string(),
            })?;
        self.write("manifest.json", text.as_bytes())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), RunError> {
        write_file(&self.path.join(name), bytes)
    }

    fn read_verified(&self, name: &str, expected: Option<&str>) -> Result<Vec<u8>, RunError> {
        let path = self.path.join(name);
        let bytes = fs::read(&path).map_err(|source| match source.kind() {
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
}
