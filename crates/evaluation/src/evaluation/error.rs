//! Evaluations, searches and reports that do not fit their run or world.

use std::path::PathBuf;

use crate::adversary::AdversaryError;
use crate::experiment::EgoError;
use crate::run_dir::{KeptError, RunError};
use crate::search::SearchError;
use crate::surrogate::LEAST_RUNS;
use crate::theorems::TheoremsError;
use crate::training::TrainError;

/// Failure of an evaluation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// Too few runs to learn an ego from.
    #[error("{runs} runs are too few to learn an ego")]
    TooFewRuns {
        /// Runs asked for.
        runs: u64,
    },
    /// Two egos whose starts do not pair.
    #[error("`{ego}` and `{baseline}` start from different places")]
    StartsDiffer {
        /// Name of the ego.
        ego: String,
        /// Name of the ego it is compared with.
        baseline: String,
    },
    /// Stored counterexamples of a world with other starts or actions.
    #[error(
        "the counterexamples of `{source_world}` do not fit `{world}` with the ego `{ego}`: other \
         starts or actions"
    )]
    OtherActions {
        /// World of the run that stored them.
        source_world: String,
        /// World that is searched.
        world: String,
        /// Name of the ego.
        ego: String,
    },
    /// A policy of a world with other observations or actions.
    #[error(
        "the policy of `{source_world}` does not fit `{world}` with the ego `{ego}`: other \
         observations or actions"
    )]
    OtherObservations {
        /// World of the run with the policy.
        source_world: String,
        /// World that is searched.
        world: String,
        /// Name of the ego.
        ego: String,
    },
    /// A file of rows that cannot be shown.
    #[error("`{}` holds no rows: {why}", file.display())]
    NoRows {
        /// The file.
        file: PathBuf,
        /// Description of the problem in the file.
        why: String,
    },
    /// A second run in the request is a run of another world.
    #[error("`{}` is a run of another world", run.display())]
    OtherWorld {
        /// The run.
        run: PathBuf,
    },
    /// The ego cannot be tested.
    #[error(transparent)]
    Ego(#[from] EgoError),
    /// A baseline does not apply.
    #[error(transparent)]
    Adversary(#[from] AdversaryError),
    /// A search is not possible.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// A theorem does not apply.
    #[error(transparent)]
    Theorems(#[from] TheoremsError),
    /// The ado could not be trained anew for an ego.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// Counterexamples could not be kept.
    #[error(transparent)]
    Kept(#[from] KeptError),
    /// The run directory cannot be read or written.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl EvaluationError {
    /// Returns the fix, or `None` if the error has another form.
    pub fn help(&self) -> Option<String> {
        Some(match self {
            EvaluationError::TooFewRuns { .. } => {
                format!("`--runs` takes {LEAST_RUNS} at least; 100 are enough for most")
            }
            EvaluationError::StartsDiffer { .. } => "compare egos on the same map".to_owned(),
            EvaluationError::OtherActions { .. } | EvaluationError::OtherObservations { .. } => {
                "name a run of the same world".to_owned()
            }
            EvaluationError::NoRows { .. } => {
                "give what `brakecheck eval RUN --json` or `search … --json` printed".to_owned()
            }
            EvaluationError::OtherWorld { .. } => {
                "`--with` shows runs whose world files are equal to the letter".to_owned()
            }
            EvaluationError::Ego(error) => return error.help(),
            EvaluationError::Search(error) => error.help(),
            EvaluationError::Adversary(error) => return error.help().map(str::to_owned),
            EvaluationError::Theorems(_)
            | EvaluationError::Train(_)
            | EvaluationError::Kept(_)
            | EvaluationError::Run(_) => return None,
        })
    }
}
