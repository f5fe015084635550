//! Errors of drives.

use crate::experiment::EgoError;
use crate::run_dir::KeptError;

/// Failure to set up a drive, or to do what the page asks.
#[derive(Debug, thiserror::Error)]
pub enum DriveError {
    /// Grids have no wheels.
    #[error("`{world}` is a grid world, in which nobody drives")]
    Grid {
        /// Name of the world.
        world: String,
    },
    /// No ado of that name chooses actions.
    #[error("`{seat}` is no seat of this world")]
    NoSeat {
        /// Requested name.
        seat: String,
        /// Ados that choose actions.
        known: Vec<String>,
    },
    /// The world lists fewer starts.
    #[error("the world has no start {index}")]
    NoStart {
        /// Requested position.
        index: usize,
    },
    /// The start is not of this world.
    #[error("the start is not of this world: {why}")]
    BadStart {
        /// Reason.
        why: String,
    },
    /// No ego of that name.
    #[error("`{name}` is no ego of this world")]
    NoEgo {
        /// Requested name.
        name: String,
    },
    /// No run with a trained ado was given.
    #[error("there is no trained ado: name a run directory")]
    NotTrained,
    /// A moment that was not played.
    #[error("sample {sample} was not played")]
    NotPlayed {
        /// Requested sample.
        sample: usize,
    },
    /// The episode goes on.
    #[error("there is nothing to keep yet: the drive is not decided")]
    Undecided,
    /// The episode is no counterexample.
    #[error("only a counterexample can be kept: {verdict}")]
    NoCounterexample {
        /// Verdict so far.
        verdict: String,
    },
    /// The ego does not fit.
    #[error(transparent)]
    Ego(#[from] EgoError),
    /// The disk refuses.
    #[error(transparent)]
    Kept(#[from] KeptError),
    /// No page can be served.
    #[error("no page can be served on port {port} of 127.0.0.1: {source}")]
    Server {
        /// Requested port, 0 for any.
        port: u16,
        /// Reason.
        source: std::io::Error,
    },
    /// The system gave no random bytes for the address.
    #[error("the system gives no random numbers: {0}")]
    Random(#[from] getrandom::Error),
}

impl DriveError {
    /// Returns the fix, where one is known.
    pub fn help(&self) -> Option<String> {
        Some(match self {
            DriveError::Grid { .. } => "name a driving world, such as `acc`".to_owned(),
            DriveError::NoSeat { known, .. } if known.is_empty() => {
                "take `--as ego`: this world has no ado that chooses actions".to_owned()
            }
            DriveError::NoSeat { known, .. } => {
                format!("take `--as ego`, or one of: {}", known.join(", "))
            }
            DriveError::NoStart { .. } => "take `--start 0`".to_owned(),
            DriveError::Server { .. } => {
                "take another port, or leave `--port` out for any that is free".to_owned()
            }
            DriveError::Ego(error) => return error.help(),
            _ => return None,
        })
    }
}
