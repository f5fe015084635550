//! Hyperparameters of tabular Q-learning.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Hyperparameters of tabular Q-learning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "QTableConfig", deny_unknown_fields, default)]
pub struct QTableSettings {
    /// Decisions to train for (300000): as many as the DQN's.
    pub decisions: u64,
    /// α (Constant(0.3)): cells are coarse, so old targets must fade.
    pub learning_rate: LearningRate,
    /// γ (1): the reward comes once, at the end.
    pub discount: f64,
    /// Q before the first visit (0). A value above every reward is optimistic.
    pub initial_value: f64,
    /// ε at the start (1): every action everywhere.
    pub exploration: f64,
    /// ε at the end (0.05): ε-soft throughout.
    pub final_exploration: f64,
    /// Share of the training in which ε falls, linearly (0.5).
    pub exploration_fraction: f64,
    /// Longest hold of an exploratory action, from 1 decision (4): reaches far.
    pub hold: usize,
    /// Bins per observed number (one `Bins()` for all). The last entry repeats.
    pub bins: Vec<Bins>,
    /// Half width of the uniform draw of Q around `initial_value` (0).
    ///
    /// The paper begins with a random table.
    #[serde(skip_serializing_if = "is_zero")]
    pub initial_spread: f64,
    /// Learns from an episode at its end, last decision first (true).
    ///
    /// `false` learns from each decision when it is taken, as in the paper.
    #[serde(skip_serializing_if = "is_true")]
    pub backward: bool,
}

// Later settings are left out of the text where they change nothing. A run
// directory of an earlier version then still names the same learner.
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn is_true(value: &bool) -> bool {
    *value
}

/// Step size of tabular updates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum LearningRate {
    /// Constant step size.
    Constant(f64),
    /// 1/n^ω at the n-th visit, which converges for 0.5 < ω ≤ 1.
    Power(f64),
}

/// Cells of equal width for one observed number.
///
/// Numbers outside fall into the first or the last cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Bins {
    /// Lower end (-1): observations are scaled to about [-1, 1].
    pub low: f64,
    /// Upper end (1).
    pub high: f64,
    /// Number of cells (16). Finer cells see each state too rarely.
    pub count: u32,
}

impl Default for QTableSettings {
    fn default() -> Self {
        QTableSettings {
            decisions: 300_000,
            learning_rate: LearningRate::Constant(0.3),
            discount: 1.0,
            initial_value: 0.0,
            exploration: 1.0,
            final_exploration: 0.05,
            exploration_fraction: 0.5,
            hold: 4,
            bins: vec![Bins::default()],
            initial_spread: 0.0,
            backward: true,
        }
    }
}

impl Default for Bins {
    fn default() -> Self {
        Bins {
            low: -1.0,
            high: 1.0,
            count: 16,
        }
    }
}
