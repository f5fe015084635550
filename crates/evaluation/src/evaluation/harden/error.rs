//! Requests to harden an ego that have no possible result.

use std::path::PathBuf;

use crate::ego::Fault;
use crate::experiment::EgoError;
use crate::risk::RiskTrafficError;
use crate::run_dir::{KeptError, RunError};
use crate::stl::StlError;
use crate::training::SessionError;

/// Failure of a request to harden an ego.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HardenError {
    /// Ego without parameters.
    #[error("`{ego}` has no parameter that may change")]
    NoParameters {
        /// Name of the ego.
        ego: String,
        /// True if it is a program, which declares its parameters.
        is_program: bool,
    },
    /// Range of a parameter that the ego does not have.
    #[error("`{ego}` has no parameter `{parameter}`")]
    UnknownParameter {
        /// Name of the ego.
        ego: String,
        /// Requested name.
        parameter: String,
        /// Names that it has.
        known: Vec<String>,
    },
    /// Range without the value of the ego as it is.
    #[error("`{parameter}` of the ego is {own}, outside {lo}..{hi}")]
    OwnOutside {
        /// Name of the parameter.
        parameter: String,
        /// Value of the ego.
        own: f64,
        /// Least value of the range.
        lo: f64,
        /// Greatest value of the range.
        hi: f64,
    },
    /// Program that did not start or say hello.
    #[error("{0}")]
    Program(Fault),
    /// World whose starts are a list, of which none is unseen.
    #[error("`{world}` lists its starts, so none is left to confirm a change on")]
    ListedStarts {
        /// Name of the world.
        world: String,
    },
    /// World without an ado that can be trained.
    #[error("no agent of `{world}` is an ado that learns")]
    NoAdo {
        /// Name of the world.
        world: String,
    },
    /// Starts on which the ego fails by itself, all of them.
    #[error("the ego fails from every start without an adversary")]
    NoStarts,
    /// Traffic without a run inside the ranges of the world.
    #[error("no run of this traffic begins inside the ranges of `{world}`")]
    NoRuns {
        /// Name of the world.
        world: String,
    },
    /// Limit that is not of the form `MEASURE=LIMIT`.
    #[error("`{text}` is no limit on a measure")]
    NoLimit {
        /// The text.
        text: String,
    },
    /// Measure that is neither known nor an expression or formula of the world.
    #[error("`{text}`: {error}")]
    Measure {
        /// The text.
        text: String,
        /// Mistake in it.
        error: StlError,
    },
    /// Output directory with content.
    #[error("`{}` has content", path.display())]
    Taken {
        /// The directory.
        path: PathBuf,
    },
    /// Change that cannot be written as RON.
    #[error("the change cannot be written: {why}")]
    Unwritable {
        /// Reason.
        why: String,
    },
    /// Traffic that cannot be read.
    #[error(transparent)]
    Traffic(#[from] RiskTrafficError),
    /// Ego that cannot be tested.
    #[error(transparent)]
    Ego(#[from] EgoError),
    /// Training that cannot begin or continue.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Run directory that cannot be read or written.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Crashes that cannot be kept.
    #[error(transparent)]
    Kept(#[from] KeptError),
}

impl HardenError {
    /// Returns the fix. `None`: the error has another form than a sentence and its fix.
    pub fn help(&self) -> Option<String> {
        Some(match self {
            HardenError::NoParameters {
                is_program: true, ..
            } => "declare `parameters` in its `hello`: docs/reference/ego-protocol.md".to_owned(),
            HardenError::NoParameters { .. } => "name a stock ego or a program".to_owned(),
            HardenError::UnknownParameter { known, .. } => format!("it has: {}", known.join(", ")),
            HardenError::OwnOutside { .. } => {
                "give a range around the value, as in `--over ego.NAME=LO..HI`".to_owned()
            }
            HardenError::Program(_) => "try it with `brakecheck check -- COMMAND`".to_owned(),
            HardenError::ListedStarts { .. } => "use a world with ranges of starts".to_owned(),
            HardenError::NoAdo { .. } => {
                "give an agent `drive: Ado(…)`: docs/guide/worlds.md".to_owned()
            }
            HardenError::NoStarts => {
                "give the starts of the world more room between the agents".to_owned()
            }
            HardenError::NoRuns { .. } => {
                "name other traffic with `--traffic`: docs/guide/risk.md".to_owned()
            }
            HardenError::NoLimit { .. } => {
                "write for example `braking=110%`, `max(0, ego.speed - 30)=0.1` or `always \
                 (headway > 8)=+0.05`"
                    .to_owned()
            }
            HardenError::Measure { error, .. } => {
                let help = error
                    .help()
                    .unwrap_or("`brakecheck check WORLD` lists its signals");
                help.to_owned()
            }
            HardenError::Taken { .. } => "name another directory with `-o`".to_owned(),
            HardenError::Unwritable { .. } => return None,
            HardenError::Ego(error) => return error.help(),
            HardenError::Session(error) => return error.help(),
            HardenError::Run(error) => return error.help(),
            HardenError::Traffic(_) | HardenError::Kept(_) => return None,
        })
    }
}
