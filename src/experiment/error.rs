//! Egos that cannot be tested.

use crate::visible::command_line;
use crate::world::{ChangeError, LoadError, guessed};

/// An ego that cannot be tested.
///
/// As `Debug` it prints as on the command line: a test that returns it says what
/// is wrong, where, and how to mend it.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum EgoError {
    /// The world names no such ego.
    #[error("there is no ego `{asked}` in this world")]
    Unknown {
        /// Name asked for.
        asked: String,
        /// Names that the world has.
        known: Vec<String>,
    },
    /// A controller needs a driving world.
    #[error("nobody drives in `{world}`: `{ego}` cannot be its ego")]
    NotDriven {
        /// Name of the world.
        world: String,
        /// Name of the controller.
        ego: String,
    },
    /// The world has no plant that could be another one.
    #[error("`{world}` runs on no plant")]
    NoPlant {
        /// Name of the world.
        world: String,
    },
    /// An ego is named, and a program is given as well.
    #[error("`--ego` names one ego, and the program after `--` is another")]
    NamedTwice,
    /// A change that does not fit the world.
    #[error("{error}")]
    Misfit {
        /// Mistake in the change.
        error: ChangeError,
        /// Fix where the mistake itself has none.
        help: &'static str,
    },
    /// A file names a program, and the caller did not consent to start it.
    #[error(
        "{who} is a program that a file names, and nothing was started:\n{}",
        command_line(command)
    )]
    NotAllowed {
        /// Owner of the program, in words.
        who: String,
        /// The program and its arguments.
        command: Vec<String>,
    },
    /// A file with a change that cannot be loaded.
    #[error(transparent)]
    World(#[from] LoadError),
}

impl EgoError {
    /// The fix; `None`: the error has another form than a sentence and its fix.
    pub fn help(&self) -> Option<String> {
        Some(match self {
            EgoError::Unknown { asked, known } => {
                let known = known.iter().map(String::as_str);
                format!(
                    "{}; or name a RON file with a `Change`",
                    guessed(asked, "known", known)
                )
            }
            EgoError::NotDriven { .. } => {
                "a controller drives the ego of a driving world".to_owned()
            }
            EgoError::NoPlant { .. } => "leave out `--plant`: it is for driving worlds".to_owned(),
            EgoError::NamedTwice => "leave out one of the two".to_owned(),
            EgoError::Misfit { error, help } => {
                error.help.clone().unwrap_or_else(|| (*help).to_owned())
            }
            EgoError::NotAllowed { .. } | EgoError::World(_) => return None,
        })
    }
}
