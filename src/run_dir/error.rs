//! What can go wrong with a run directory: the file, the reason, the cure.

use std::io;
use std::path::PathBuf;

use super::RunDifference;
use crate::world::ScenarioError;

/// A run directory could not be used.
///
/// As `Debug` it prints as on the command line: a test that returns it says what
/// is wrong, where, and how to mend it.
#[derive(thiserror::Error)]
pub enum RunError {
    /// A file could not be read or written.
    #[error("{verb} `{path}` failed: {source}")]
    Io {
        /// What was tried.
        verb: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// There is no run.
    #[error("`{path}` is no run directory: {why}")]
    NotARun {
        /// The directory.
        path: PathBuf,
        /// What is missing or wrong.
        why: String,
    },
    /// Training there was interrupted.
    #[error("the training in `{path}` has not finished ({done} of {asked} decisions)")]
    Unfinished {
        /// The directory.
        path: PathBuf,
        /// Decisions taken.
        done: u64,
        /// Decisions asked for.
        asked: u64,
    },
    /// An earlier version trained there, or the training met a family.
    #[error("the training in `{path}` stored no counterexamples")]
    NothingStored {
        /// The directory.
        path: PathBuf,
    },
    /// The directory is taken.
    #[error("`{path}` exists already")]
    Exists {
        /// The directory.
        path: PathBuf,
    },
    /// It was begun as another training than is asked for.
    #[error(
        "the training in `{path}` was begun otherwise:{}",
        differences.iter().map(|one| format!("\n  {one}")).collect::<String>()
    )]
    Differs {
        /// The directory.
        path: PathBuf,
        /// In what.
        differences: Vec<RunDifference>,
    },
    /// Another process trains there.
    #[error("`{path}` is in use by another process")]
    Locked {
        /// The directory.
        path: PathBuf,
    },
    /// A file is not what the manifest says.
    #[error("`{path}` is damaged: {why}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// Its ado is conditional, and nothing was said about the ego.
    #[error("the ado in `{path}` is conditional: it must be told {}", names.join(", "))]
    Untold {
        /// The directory.
        path: PathBuf,
        /// What it must be told.
        names: Vec<String>,
    },
    /// The world in it is not usable.
    #[error("the world of this run: {0}")]
    World(Box<ScenarioError>),
}

impl RunError {
    /// The cure, where one is known.
    pub fn help(&self) -> Option<String> {
        match self {
            RunError::Io { .. } => {
                Some("check the path, the permissions and the free space".into())
            }
            RunError::NotARun { .. } => {
                Some("make one with `brakecheck train WORLD -o RUN`".to_owned())
            }
            RunError::Unfinished { .. } => {
                Some("go on with `brakecheck train WORLD -o RUN --resume`".to_owned())
            }
            RunError::NothingStored { .. } => Some(
                "an earlier version trained it, or it met a family of egos: name a run that was \
                 trained against one ego"
                    .to_owned(),
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
            RunError::Untold { .. } => Some(
                "`brakecheck eval RUN --ego E --runs 10` tells it what ten runs of the ego show"
                    .to_owned(),
            ),
            RunError::World(_) => None,
        }
    }
}
