//! Error of an ego that cannot be tested.

use crate::ron_file::{LoadError, guessed};
use crate::visible::command_line;
use crate::world::ChangeError;

/// Error of an ego that cannot be tested.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EgoError {
    /// Ego that the world does not name.
    #[error("there is no ego `{requested}` in this world")]
    Unknown {
        /// Requested name.
        requested: String,
        /// Names that the world has.
        known: Vec<String>,
    },
    /// Controller in a world without driving.
    #[error("no vehicle drives in `{world}`: `{ego}` cannot be its ego")]
    NotDriven {
        /// Name of the world.
        world: String,
        /// Name of the controller.
        ego: String,
    },
    /// World without a plant to replace.
    #[error("`{world}` runs on no plant")]
    NoPlant {
        /// Name of the world.
        world: String,
    },
    /// Ego by name beside a program.
    #[error("`--ego` names one ego, and the program after `--` is another")]
    NamedTwice,
    /// Change that does not fit the world.
    #[error("{error}")]
    Misfit {
        /// Mistake in the change.
        error: ChangeError,
        /// Fix, if the mistake itself has none.
        help: &'static str,
    },
    /// Program in a file without consent to start it.
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
    /// File with a change that cannot be loaded.
    #[error(transparent)]
    World(#[from] LoadError),
}

/// Returns the fix of an ego that the world does not name.
pub fn unknown_ego_help<'a>(
    requested: &str,
    known: impl IntoIterator<Item = &'a str, IntoIter: Clone>,
) -> String {
    let is_script = [".py", ".sh", ".exe"]
        .iter()
        .any(|end| requested.ends_with(end));
    // A name of the world has no directory.
    if is_script || requested.contains(['/', '\\']) {
        return format!(
            "a program comes after `--`, as in `-- python3 {requested}`; a RON file names one \
             as `Change(controller: Process(command: [\"python3\", \"{requested}\"]))`"
        );
    }
    let names = guessed(requested, "known", known);
    format!("{names}; or name a RON file with a `Change`")
}

impl EgoError {
    /// Returns the fix. `None`: the error has another form than a sentence and its fix.
    pub fn help(&self) -> Option<String> {
        Some(match self {
            EgoError::Unknown { requested, known } => {
                unknown_ego_help(requested, known.iter().map(String::as_str))
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
