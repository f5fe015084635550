//! Adversaries: ados of a row, and the rollout that makes the row.

mod ado;
mod baselines;
pub(crate) mod best_of_n;
mod error;
mod grid_policies;
mod nearest_replay;
mod open_loop_baselines;
pub(crate) mod rollout;
mod threshold_rule;
mod without_ado;

pub use crate::grid_solver::exact::Indistinct;
pub use ado::Ado;
pub use baselines::AdoKind;
pub(crate) use baselines::Baselines;
pub(crate) use best_of_n::BestOfN;
pub use error::AdversaryError;
pub(crate) use grid_policies::GridPolicy;
pub(crate) use open_loop_baselines::{best_constant, best_then_brake, in_words};
pub use rollout::RecordedFailure;
pub(crate) use rollout::{
    EpisodeResult, EvalRequest, Evaluated, RecordedSuccess, RepeatedEpisode, blank_row,
    count_solved, eval, groups, naturalness, note_row, success_caption,
};
pub use threshold_rule::{Heuristic, tune_heuristic};
