//! Error of an adversary that does not apply to a world or a run.

use crate::grid_solver::position_policy::{Indistinct, NoOptimalPolicy};
use crate::run_dir::RunError;
use crate::world::NotAGrid;

/// Error of an adversary that does not apply to a world or a run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AdversaryError {
    /// Heuristic in a world whose ado observes nothing.
    #[error("the ado in `{world}` observes nothing")]
    NothingObserved {
        /// Name of the world.
        world: String,
    },
    /// Exact solution outside a grid world.
    #[error(transparent)]
    NotAGrid(#[from] NotAGrid),
    /// Rule over positions that the ado's observation cannot express.
    #[error(transparent)]
    Indistinct(#[from] Indistinct),
    /// World without an exact solution.
    #[error("`{world}` has no exact solution: {source}")]
    NoOptimalPolicy {
        /// Name of the world.
        world: String,
        /// Reason.
        source: NoOptimalPolicy,
    },
    /// Run without counterexamples to replay.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl AdversaryError {
    /// Returns the fix. `None`: the error has another form than a sentence and its fix.
    pub fn help(&self) -> Option<&'static str> {
        match self {
            AdversaryError::NothingObserved { .. } => {
                Some("a heuristic reads one observed signal: leave out `--ado heuristic`")
            }
            AdversaryError::NotAGrid(_) => {
                Some("only grid worlds are solved exactly: leave out `--ado optimal` and `chaser`")
            }
            AdversaryError::NoOptimalPolicy { .. } => {
                Some("leave out `--ado optimal`; `--search` looks for counterexamples of any grid")
            }
            AdversaryError::Indistinct(_) | AdversaryError::Run(_) => None,
        }
    }
}
