//! Files of run directories: whole or absent, growing, locked and sealed.
//!
//! All changes of the disk pass through [`disk`]. [`SealedFiles`] verifies a run
//! directory without knowing its world or its training.

pub mod append_log;
pub mod disk;
#[doc(hidden)]
pub mod disk_faults;
mod error;
pub mod sealed;
mod watched_files;

pub use error::{OtherProgram, RunDifference, RunError};
pub use sealed::SealedFiles;
pub use watched_files::WatchedFiles;

/// Version of the layout of run directories. Other versions are refused.
pub const FORMAT: u32 = 3;

/// World file of a run, verbatim.
pub const WORLD: &str = "world.ron";
/// File with the settings of a run and the hashes of its files.
pub const MANIFEST: &str = "manifest.json";
/// Separate file of the processor time, in which equal trainings differ.
pub const TIMING: &str = "timing.json";
/// Trained policy of a finished run.
pub(crate) const POLICY: &str = "policy.safetensors";
/// Policy that the training was fine-tuned from.
pub(crate) const FROM: &str = "from.safetensors";
/// File with the episodes of other trainings.
pub const BANK: &str = "bank.json";
/// File with the failures whose rarity a training rewards.
pub const KNOWN: &str = "known.json";
/// Growing file with a line per report of the learner.
pub const PROGRESS: &str = "progress.jsonl";
/// Growing file with the successes of a training.
pub const COUNTEREXAMPLES: &str = "counterexamples.jsonl";
/// File that makes a directory a population of runs, in place of the manifest.
pub const POPULATION: &str = "population.json";
/// Directory of a population's runs, which are called `000`, `001` and so on.
pub const MEMBERS: &str = "members";
