//! Errors of run directories, with file, reason and fix.

use std::fmt;
use std::io;
use std::path::PathBuf;

use super::MEMBERS;
use crate::ron_file::ScenarioError;

/// Property that differs from the run's beginning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunDifference {
    /// Name of the property.
    pub what: String,
    /// Value at the beginning.
    pub begun: String,
    /// Value now.
    pub now: String,
}

impl fmt::Display for RunDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}, now {}", self.what, self.begun, self.now)
    }
}

/// Program whose content is not that of the stored results.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{path}` has results of the ego `{ego}` {}: `{command}`{}",
    match was {
        Some(was) => format!("from another program: its SHA-256 was {was} and is {is}"),
        None => format!("from a program without its SHA-256, which is {is} now"),
    },
    match &changed[..] {
        [] => String::new(),
        changed => format!(", changed: {}", changed.join(", ")),
    }
)]
pub struct OtherProgram {
    /// Directory.
    pub path: PathBuf,
    /// Name of the ego.
    pub ego: String,
    /// Command of the program.
    pub command: String,
    /// SHA-256 of the program of the results, if it is known.
    pub was: Option<String>,
    /// SHA-256 of the present program.
    pub is: String,
    /// Files that differ.
    pub changed: Vec<String>,
}

/// Failure to use a run directory.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Failure to read or write a file.
    #[error("{verb} `{path}` failed: {source}")]
    Io {
        /// Attempted operation.
        verb: &'static str,
        /// File of the operation.
        path: PathBuf,
        /// Underlying error.
        source: io::Error,
    },
    /// The directory contains no run.
    #[error("`{path}` is no run directory: {why}")]
    NotARun {
        /// Directory.
        path: PathBuf,
        /// Missing or invalid content.
        why: String,
    },
    /// The directory contains a population of runs.
    #[error("`{path}` is a population of runs, and no single run")]
    Population {
        /// Directory.
        path: PathBuf,
    },
    /// The training was interrupted.
    #[error("the training in `{path}` has not finished ({done} of {requested} decisions)")]
    Unfinished {
        /// Directory.
        path: PathBuf,
        /// Decisions taken.
        done: u64,
        /// Decisions requested.
        requested: u64,
    },
    /// It was trained against a family of egos.
    #[error("the training in `{path}` stored no counterexamples")]
    NothingStored {
        /// Directory.
        path: PathBuf,
    },
    /// The directory is taken.
    #[error("`{path}` exists already")]
    Exists {
        /// Directory.
        path: PathBuf,
    },
    /// The run began as a different training.
    #[error(
        "the training in `{path}` was begun otherwise:{}",
        differences.iter().map(|one| format!("\n  {one}")).collect::<String>()
    )]
    Differs {
        /// Directory.
        path: PathBuf,
        /// Differences between both trainings.
        differences: Vec<RunDifference>,
    },
    /// Another process trains in the directory.
    #[error("`{path}` is in use by another process")]
    Locked {
        /// Directory.
        path: PathBuf,
    },
    /// A file differs from the manifest.
    #[error("`{path}` is damaged: {why}")]
    Damaged {
        /// File with the difference.
        path: PathBuf,
        /// Description of the difference.
        why: String,
    },
    /// A file in a directory of runs of a risk contains other runs.
    #[error(
        "`{path}` has other runs than its name says:{}",
        differences.iter().map(|one| format!("\n  {one}")).collect::<String>()
    )]
    OtherPiece {
        /// File.
        path: PathBuf,
        /// Differences of its runs from the expected ones.
        differences: Vec<String>,
    },
    /// A directory for the runs of a risk has files, and no digest of a request.
    #[error("`{path}` is not empty, and has no `request.sha256` that names the risk of its runs")]
    NoRiskRequest {
        /// Directory.
        path: PathBuf,
    },
    /// The run was trained with `--against conditional`, which is retired.
    #[error("the run `{path}` has a conditional ado, and conditional ados were retired")]
    Conditional {
        /// Directory.
        path: PathBuf,
    },
    /// The directory contains results of another build of a program.
    #[error(transparent)]
    OtherProgram(Box<OtherProgram>),
    /// The directory contains runs of another risk.
    #[error(
        "`{path}` has runs of another risk: its world, ego, traffic, seed, version or natural runs differ"
    )]
    OtherRisk {
        /// Directory.
        path: PathBuf,
    },
    /// The starts or actions of the run are those of another world.
    #[error("the run `{path}` has other starts or actions than `{world}`")]
    OtherWorld {
        /// Directory of the run.
        path: PathBuf,
        /// World in which it was to be used.
        world: String,
    },
    /// The world of the run is not usable.
    #[error("the world of this run: {0}")]
    World(Box<ScenarioError>),
}

impl RunError {
    /// Returns the fix, if known.
    pub fn help(&self) -> Option<String> {
        match self {
            RunError::Io { .. } => {
                Some("check the path, the permissions and the free space".into())
            }
            RunError::NotARun { .. } => {
                Some("make one with `brakecheck train WORLD -o RUN`".to_owned())
            }
            RunError::Population { path } => Some(format!(
                "name one of its members, such as `{}`, or test all with `brakecheck eval {} --members all`",
                path.join(MEMBERS).join("000").display(),
                path.display(),
            )),
            RunError::Unfinished { .. } => {
                Some("go on with `brakecheck train WORLD -o RUN --resume`".to_owned())
            }
            RunError::NothingStored { .. } => Some(
                "it was trained on a family of egos: name a run that was trained against a single ego".to_owned(),
            ),
            RunError::Exists { .. } => {
                Some("go on with `--resume`, or name another directory with `-o`".to_owned())
            }
            RunError::Differs { .. } => Some(
                "go on as it was begun (leave out the options that say otherwise; its world is in \
                 the directory), train anew in another one, or fine-tune the finished policy \
                 there with `--from`"
                    .to_owned(),
            ),
            RunError::Locked { .. } => Some("wait for it, or name another directory".to_owned()),
            RunError::Damaged { .. } => {
                Some("restore the file from a backup, or make it again".to_owned())
            }
            RunError::Conditional { .. } => Some(
                "train again with `--against wide`, or adapt another run to your ego with \
                 `brakecheck eval RUN --runs N`"
                    .to_owned(),
            ),
            RunError::OtherProgram(_) => Some(
                "name another directory for the results of this program, or restore the earlier \
                 one"
                    .to_owned(),
            ),
            RunError::OtherRisk { .. } => {
                Some("name another directory with `-o`, or repeat the command that began it".to_owned())
            }
            RunError::OtherPiece { .. } => {
                Some("delete the file, so that its runs are played again".to_owned())
            }
            RunError::NoRiskRequest { .. } => {
                Some("name an empty or a new directory with `-o`".to_owned())
            }
            RunError::OtherWorld { .. } => Some("name a run of the same world".to_owned()),
            RunError::World(_) => None,
        }
    }
}
