//! Training of an ado, from a world to a run directory and its closing evaluation.

mod bank;
mod calibration;
mod demonstrations;
mod error;
pub mod goals;
mod near_starts;
mod per_ado_mode;
mod progress_log;
mod retrain_baseline;
mod rollout;
mod search_stream;
mod search_worker;
mod session;
mod stopping_rule;
pub mod train_loop;
pub mod training_egos;
mod training_search;

pub use bank::BankError;
pub use error::{OptionClash, SessionError};
pub use per_ado_mode::PerAdoMode;
pub use retrain_baseline::retrained;
pub use session::{Closing, TrainRequest, TrainSession};
pub use train_loop::{TrainError, TrainingOutcome};
