//! Hyperparameters of deep Q-learning.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rl::learner::{ConfigError, within, within_widths};

/// Loss of a single error δ = Q(s, a) − y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Loss {
    /// ½ δ² up to the threshold `huber`, linear beyond it.
    #[default]
    Huber,
    /// ½ δ²: half the paper's δ², so that the gradient is δ.
    Squared,
}

impl Loss {
    /// Returns the loss of an error.
    pub fn value(self, error: f32, huber: f32) -> f32 {
        match self {
            Loss::Huber if huber < error.abs() => huber * (error.abs() - 0.5 * huber),
            Loss::Huber | Loss::Squared => 0.5 * error * error,
        }
    }

    /// Returns the derivative of the loss by Q(s, a).
    pub fn slope(self, error: f32, huber: f32) -> f32 {
        match self {
            Loss::Huber => error.clamp(-huber, huber),
            Loss::Squared => error,
        }
    }
}

/// Hyperparameters of deep Q-learning. The defaults are recipe R.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "DqnConfig", deny_unknown_fields, default)]
pub struct DqnSettings {
    /// Decisions to train for (300000): the hardest stock world has converged.
    pub decisions: u64,
    /// Widths of the hidden ReLU layers ([64, 64]): larger layers did not help.
    pub hidden: Vec<usize>,
    /// Transitions per update (64): 32 loses a percent or two.
    pub batch: usize,
    /// Decisions between updates (2): the cheapest value that reaches the optimum.
    pub update_every: u64,
    /// Transitions in the replay before the first update (1000).
    ///
    /// 64 was worse at the end of the training.
    pub learning_starts: usize,
    /// Step size of Adam at the start (1e-3): fast early learning.
    pub learning_rate: f64,
    /// Step size of Adam at the end, linear in between (5e-5): values settle.
    pub final_learning_rate: f64,
    /// |δ| beyond which the loss is linear (1): rewards lie within about ±1.
    pub huber: f64,
    /// Share of the online network in every target update (0.005): soft target.
    pub polyak: f64,
    /// γ (1): the reward comes once, at the end, and 0.9 fails.
    pub discount: f64,
    /// Rewards in an n-step return (3): 1 is slower.
    pub steps: usize,
    /// ε at the start (1): every action everywhere.
    pub exploration: f64,
    /// ε at the end (0.05): ε-soft throughout.
    pub final_exploration: f64,
    /// Share of the training in which ε falls, linearly (0.25).
    pub exploration_fraction: f64,
    /// Longest hold of an exploratory action, from 1 decision (4): reaches far.
    pub hold: usize,
    /// Share of episodes that restart from a failed start (0.5): hard starts.
    pub restart: f64,
    /// Number of recent failed starts kept (400).
    pub restart_pool: usize,
    /// Retries of one failed start (4): some cannot be solved.
    pub restart_tries: u32,
    /// α of the prioritised replay (0.6): 0 is uniform.
    pub priority: f64,
    /// β of the prioritised replay at the start, 1 at the end (0.4).
    pub correction: f64,
    /// Transitions kept (None: all): forgetting helps wide ados at most.
    pub capacity: Option<usize>,
    /// Gain of the last layer's weights at the start (0.01): values near zero.
    pub last_gain: f64,
    /// Loss of an error (Huber). `Squared` is the paper's and has no threshold.
    #[serde(skip_serializing_if = "is_default")]
    pub loss: Loss,
    /// Puts each transition into the replay at once and into the next batch (false).
    ///
    /// This is the paper's update. It requires `steps: 1`.
    #[serde(skip_serializing_if = "is_default")]
    pub newest: bool,
}

/// Leaves later settings out of the text where they change nothing.
///
/// A run directory of an earlier version then still names the same learner.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Default for DqnSettings {
    fn default() -> Self {
        // Measured on driving worlds: a learning start of 64 gains a percent of recall at 50k
        // decisions and loses half a percent at 300k. Without `hold`, success on merging is
        // 2.5 % lower. Without `restart`, seeds differ more on merging. A hard target, and a
        // `polyak` of 0.01 or 0.02, make no difference.
        DqnSettings {
            decisions: 300_000,
            hidden: vec![64, 64],
            batch: 64,
            update_every: 2,
            learning_starts: 1000,
            learning_rate: 1e-3,
            final_learning_rate: 5e-5,
            huber: 1.0,
            polyak: 0.005,
            discount: 1.0,
            steps: 3,
            exploration: 1.0,
            final_exploration: 0.05,
            exploration_fraction: 0.25,
            hold: 4,
            restart: 0.5,
            restart_pool: 400,
            restart_tries: 4,
            priority: 0.6,
            correction: 0.4,
            capacity: None,
            last_gain: 0.01,
            loss: Loss::Huber,
            newest: false,
        }
    }
}

impl DqnSettings {
    /// Returns settings for a trained policy: small steps, little exploration.
    pub(in crate::rl) fn fine_tuning(decisions: u64) -> DqnSettings {
        DqnSettings {
            decisions,
            learning_rate: 5e-4,
            exploration: 0.3,
            ..DqnSettings::default()
        }
    }

    /// Checks every setting against its bounds.
    pub(super) fn bounds(&self) -> Result<(), ConfigError> {
        within_widths(&self.hidden)?;
        within("batch", self.batch as f64, 1.0, 65536.0)?;
        within("update_every", self.update_every as f64, 1.0, 1e6)?;
        within("learning_starts", self.learning_starts as f64, 1.0, 1e9)?;
        within("learning_rate", self.learning_rate, 1e-9, 1.0)?;
        within("final_learning_rate", self.final_learning_rate, 0.0, 1.0)?;
        within("huber", self.huber, 1e-6, 1e6)?;
        within("polyak", self.polyak, 1e-6, 1.0)?;
        within("discount", self.discount, 0.0, 1.0)?;
        within("steps", self.steps as f64, 1.0, 1e6)?;
        within("exploration", self.exploration, 0.0, 1.0)?;
        within("final_exploration", self.final_exploration, 0.0, 1.0)?;
        within("exploration_fraction", self.exploration_fraction, 0.0, 1.0)?;
        within("hold", self.hold as f64, 1.0, 1e6)?;
        within("restart", self.restart, 0.0, 1.0)?;
        within("restart_pool", self.restart_pool as f64, 1.0, 1e9)?;
        within("restart_tries", f64::from(self.restart_tries), 0.0, 1e9)?;
        within("priority", self.priority, 0.0, 1.0)?;
        within("correction", self.correction, 0.0, 1.0)?;
        if let Some(capacity) = self.capacity {
            within(
                "capacity",
                capacity as f64,
                self.learning_starts as f64,
                1e12,
            )?;
        }
        if self.newest && self.steps != 1 {
            // The longer return of the newest decision does not exist yet.
            return Err(ConfigError {
                field: "steps",
                why: format!("is {} with `newest: true`", self.steps),
                help: "write `steps: 1`".into(),
            });
        }
        within("last_gain", self.last_gain, 0.0, 10.0)
    }
}
