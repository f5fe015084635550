//! Error of a league that cannot be trained.

use crate::experiment::EgoError;
use crate::run_dir::RunError;
use crate::training::{SessionError, TrainError};

/// Error of a league that cannot be trained.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LeagueError {
    /// World without a family of egos.
    #[error("`{world}` names no family of egos, from which a league takes its egos")]
    NoFamily {
        /// Name of the world.
        world: String,
    },
    /// Options that choose an opponent or a policy to continue.
    #[error("`--league` excludes `--against`, `--ego` and `--from`")]
    Options,
    /// World whose ego fails by itself on every start.
    #[error("the nominal ego fails on every start without an adversary")]
    NoStarts,
    /// Options that do not fit the world.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Training that cannot continue.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// Directory of the population or of a member.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Ego that cannot be tested.
    #[error(transparent)]
    Ego(#[from] EgoError),
}

impl LeagueError {
    /// Returns the fix. `None`: the error has another form than a sentence and its fix.
    pub fn help(&self) -> Option<String> {
        match self {
            LeagueError::NoFamily { .. } => Some(
                "add `train_against: Family(ego: { … })` to the world: docs/guide/reuse.md"
                    .to_owned(),
            ),
            LeagueError::Options => Some("leave them out: a league chooses both".to_owned()),
            LeagueError::NoStarts => {
                Some("give the starts of the world more room between the agents".to_owned())
            }
            LeagueError::Session(error) => error.help(),
            LeagueError::Run(error) => error.help(),
            LeagueError::Ego(error) => error.help(),
            LeagueError::Train(_) => None,
        }
    }
}
