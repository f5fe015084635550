//! Hyperparameters of proximal policy optimisation.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rl::learner::{ConfigError, within, within_widths};

/// Hyperparameters of proximal policy optimisation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "PpoConfig", deny_unknown_fields, default)]
pub struct PpoSettings {
    /// Decisions to train for (300000): as many as the DQN's.
    pub decisions: u64,
    /// Widths of the hidden ReLU layers of actor and critic ([64, 64]).
    pub hidden: Vec<usize>,
    /// Decisions between updates, rounded up to whole episodes (2048).
    pub horizon: usize,
    /// Passes over the rollout (10), as in the paper's Table 3.
    pub epochs: usize,
    /// Decisions per gradient step (64), as in the paper's Table 3.
    pub batch: usize,
    /// Step size of Adam at the start (1e-3): small networks tolerate it.
    pub learning_rate: f64,
    /// Step size of Adam at the end, linear in between (0): the policy settles.
    pub final_learning_rate: f64,
    /// γ (1): the reward comes once, at the end.
    pub discount: f64,
    /// λ of the advantages (0.95): between one-step (0) and whole returns (1).
    pub trace: f64,
    /// Bound 1 ± clip on the ratio of probabilities (0.2).
    pub clip: f64,
    /// Weight of the entropy (0.003): 0.01 leaves more rule violations.
    pub entropy: f64,
    /// Greatest length of a gradient, per network (0.5).
    pub max_gradient: f64,
}

impl Default for PpoSettings {
    fn default() -> Self {
        PpoSettings {
            decisions: 300_000,
            hidden: vec![64, 64],
            horizon: 2048,
            epochs: 10,
            batch: 64,
            learning_rate: 1e-3,
            final_learning_rate: 0.0,
            discount: 1.0,
            trace: 0.95,
            clip: 0.2,
            entropy: 0.003,
            max_gradient: 0.5,
        }
    }
}

impl PpoSettings {
    pub(super) fn bounds(&self) -> Result<(), ConfigError> {
        within_widths(&self.hidden)?;
        within("horizon", self.horizon as f64, 1.0, 1e9)?;
        within("epochs", self.epochs as f64, 1.0, 1e4)?;
        within("batch", self.batch as f64, 1.0, 65536.0)?;
        within("learning_rate", self.learning_rate, 1e-9, 1.0)?;
        within("final_learning_rate", self.final_learning_rate, 0.0, 1.0)?;
        within("discount", self.discount, 0.0, 1.0)?;
        within("trace", self.trace, 0.0, 1.0)?;
        // A clip of 0 would cut off nearly every gradient.
        within("clip", self.clip, 1e-3, 1.0)?;
        within("entropy", self.entropy, 0.0, 10.0)?;
        within("max_gradient", self.max_gradient, 1e-6, 1e6)
    }
}
