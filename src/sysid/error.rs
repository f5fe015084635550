//! Egos whose parameters an ado cannot be given.

use std::path::PathBuf;

use super::identify::IdentifyError;
use crate::run_dir::RunError;
use crate::world::SampleError;

/// The parameters of an ego could not be given to an ado.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConditioningError {
    /// The ado takes no parameters.
    #[error("the ado in `{}` is not told anything", run.display())]
    NotConditional {
        /// Its run.
        run: PathBuf,
    },
    /// Parameters that name no member of the family.
    #[error("{error}")]
    Misfit {
        /// The parameter that is missing, unknown or out of range.
        error: SampleError,
        /// Parameters of the ado, in order.
        known: Vec<String>,
    },
    /// A conditional ado whose world has no family: a fault of this program.
    #[error("a conditional ado without a family")]
    NoFamily,
    /// A conditional ado whose ego is on no plant: a fault of this program.
    #[error("an ego on no plant")]
    NoPlant,
    /// The member that was identified is none: a fault of this program.
    #[error("{0}")]
    NoMember(SampleError),
    /// The ego cannot be identified.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// The run has no policy, or its files are damaged.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl ConditioningError {
    /// The fix; `None`: the error has another form than a sentence and its fix.
    pub fn help(&self) -> Option<String> {
        match self {
            ConditioningError::NotConditional { .. } => {
                Some("tell it nothing, or train with `--against conditional`".to_owned())
            }
            ConditioningError::Misfit { known, .. } => {
                Some(format!("the ado is told: {}", known.join(", ")))
            }
            ConditioningError::NoFamily
            | ConditioningError::NoPlant
            | ConditioningError::NoMember(_)
            | ConditioningError::Identify(_)
            | ConditioningError::Run(_) => None,
        }
    }
}
