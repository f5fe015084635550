//! Adversaries: ados of a row, and the rollout that makes the row.

mod baselines;
mod best_of_n;
mod error;
mod grid_policies;
mod nearest_replay;
mod open_loop_baselines;
mod rollout;
mod threshold_rule;

pub use baselines::AdoKind;
pub(crate) use baselines::Baselines;
pub use best_of_n::{BestOfN, BestOfNResult};
pub use error::AdversaryError;
pub(crate) use grid_policies::GridPolicy;
pub(crate) use open_loop_baselines::{best_constant, best_then_brake, in_words};
pub use rollout::{Ado, EvalRequest, Evaluated, RecordedFailure, eval};
pub(crate) use rollout::{
    EpisodeResult, RecordedSuccess, RepeatedEpisode, blank_row, count_solved, groups, note_row,
    success_caption,
};
pub use threshold_rule::{Heuristic, tune_heuristic};
