//! Adversaries: ados of a row, and the rollout that makes the row.

mod ado;
mod ado_words;
mod baselines;
mod error;
mod grid_policies;
mod nearest_replay;
mod open_loop_baselines;
pub mod rollout;
mod some_ados;
mod threshold_rule;

pub use crate::grid_solver::game_graph::NotSolvable;
pub use crate::grid_solver::position_policy::{Indistinct, NoOptimalPolicy};
pub use ado::Ado;
pub use ado_words::{ADO_WORDS, AdoWord};
pub use baselines::Baselines;
pub use error::AdversaryError;
pub use grid_policies::GridPolicy;
pub use open_loop_baselines::{best_constant, best_then_brake, in_words};
pub use rollout::RecordedFailure;
pub use rollout::{
    EpisodeResult, EvalRequest, Evaluated, RecordedSuccess, RepeatedEpisode, blank_row,
    count_solved, eval, groups, naturalness, note_row, success_caption,
};
pub use threshold_rule::{Heuristic, tune_heuristic};
