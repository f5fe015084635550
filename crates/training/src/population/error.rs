//! Error of a population that cannot be trained or evaluated.

use crate::experiment::EgoError;
use crate::run_dir::RunError;
use crate::training::SessionError;

/// Error of a population that cannot be trained or evaluated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PopulationError {
    /// World without driving.
    #[error("`{world}` is a grid, in which failures have no partner and no kind of impact")]
    Grid {
        /// Name of the world.
        world: String,
    },
    /// Family of egos, whose failures cannot be played again by name.
    #[error("`--distinct` trains against one ego, `--against` against a family of them")]
    Family,
    /// Population without a finished member.
    #[error("no member of the population has finished its training")]
    NoMember,
    /// Training of a member.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Directory of the population or of a member.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Ego that cannot be tested.
    #[error(transparent)]
    Ego(#[from] EgoError),
}

impl PopulationError {
    /// Returns the fix. `None`: the error has another form than a sentence and its fix.
    pub fn help(&self) -> Option<String> {
        match self {
            PopulationError::Grid { .. } => {
                Some("leave out `--distinct`: the exact solver knows all failures of a grid".into())
            }
            PopulationError::Family => Some("leave out one of the two".to_owned()),
            PopulationError::NoMember => {
                Some("go on with `brakecheck train WORLD --distinct N -o RUN --resume`".to_owned())
            }
            PopulationError::Session(error) => error.help(),
            PopulationError::Run(error) => error.help(),
            PopulationError::Ego(error) => error.help(),
        }
    }
}
