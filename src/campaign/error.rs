//! Why a campaign could not be carried out.

use super::identify::IdentifyError;
use super::replay::RegressionError;
use super::theorems::TheoremsError;
use super::train::TrainError;
use crate::rl::ConfigError;
use crate::run::{KeptError, RunError};
use crate::scenario::LoadError;
use crate::testbench::Complaint;
use crate::visible::command_line;

/// A campaign could not be carried out.
///
/// As `Debug` it prints as on the command line: a test that returns it says what
/// is wrong, where, and how to mend it.
#[derive(thiserror::Error)]
pub enum CampaignError {
    /// What was asked for does not fit the world, the run or itself.
    #[error("{what}")]
    Request {
        /// What was asked for and does not fit this run or world.
        what: String,
        /// What to ask for or write instead.
        help: String,
    },
    /// A file names a program, and nobody said that it may be started.
    #[error(
        "{who} is a program that a file names, and nothing was started:\n{}",
        command_line(command)
    )]
    NotAllowed {
        /// Whose program it is.
        who: String,
        /// The program and its arguments.
        command: Vec<String>,
    },
    /// A world, or a change of one, that cannot be loaded.
    #[error(transparent)]
    World(#[from] LoadError),
    /// A run directory that cannot be read, written or gone on with.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A training that could not begin or end.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// Settings of a learner out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Kept counterexamples could not be replayed.
    #[error(transparent)]
    Regression(#[from] RegressionError),
    /// Counterexamples could not be kept.
    #[error(transparent)]
    Kept(#[from] KeptError),
    /// An ego could not be identified.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A theorem does not apply.
    #[error(transparent)]
    Theorems(#[from] TheoremsError),
    /// More episodes of a piece are invalid than allowed: it was not kept.
    #[error("{complaint}")]
    Faults {
        /// The number of the piece; `None`: the pilot, in which an ego never ran.
        piece: Option<usize>,
        /// What failed.
        complaint: Complaint,
    },
    /// A fault of this program.
    #[error("{0}")]
    Fault(String),
}

impl CampaignError {
    /// What was asked for does not fit.
    pub(crate) fn request(what: impl Into<String>, help: impl Into<String>) -> CampaignError {
        CampaignError::Request {
            what: what.into(),
            help: help.into(),
        }
    }
}
