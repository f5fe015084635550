//! Training of an ado, from a world to a run directory and its closing evaluation.

mod calibration;
mod demonstrations;
mod error;
pub(crate) mod goals;
mod retrain_baseline;
mod rollout;
mod session;
mod stopping_rule;
pub(crate) mod train_loop;
pub(crate) mod training_egos;
mod training_search;

pub use error::{OptionClash, SessionError};
pub(crate) use retrain_baseline::retrained;
pub use session::{Closing, TrainRequest, TrainSession};
pub use train_loop::{TrainError, TrainingOutcome};
