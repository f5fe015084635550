//! From a verdict to a number: the reward of Definition 4.

use serde::{Deserialize, Serialize};

use super::verdict::Verdict;

/// From a verdict to a number: strictly increasing in ρ(¬ψ), fouls below all.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Reward {
    /// Definition 4 as printed, with the penalty −M ρ_max.
    Plain {
        /// Clamp of the robustness, above 0.
        rho_max: f64,
    },
    /// ±jump + (1 − jump) tanh(ρ / scale); fouls at −1 − span (M − 1) / rules.
    Tanh {
        /// Clamp of the robustness, above 0.
        #[serde(default = "default_rho_max")]
        rho_max: f64,
        /// Robustness at which tanh reaches 0.76, above 0.
        #[serde(default = "default_scale")]
        scale: f64,
        /// Height of the step at ρ = 0, in [0, 1).
        #[serde(default = "default_jump")]
        jump: f64,
        /// Fouls lie in (−1 − span, −1], by rank; above 0.
        #[serde(default = "default_foul_span")]
        foul_span: f64,
    },
}

fn default_rho_max() -> f64 {
    50.0
}

fn default_scale() -> f64 {
    10.0
}

fn default_jump() -> f64 {
    0.5
}

/// Small, so that the cliff beside a rule is hardly deeper than holding still:
/// with 1, ados that must cut in along a rule's edge learned to stay away.
fn default_foul_span() -> f64 {
    0.1
}

impl Default for Reward {
    fn default() -> Reward {
        Reward::Tanh {
            rho_max: default_rho_max(),
            scale: default_scale(),
            jump: default_jump(),
            foul_span: default_foul_span(),
        }
    }
}

/// Lawful values stay this much inside the clamp, so a foul is never a tie;
/// learners see rewards in f32, hence no less.
const OPEN: f64 = 1.0 - 1e-6;

impl Reward {
    /// The clamp ρ_max of the robustness.
    pub fn rho_max(&self) -> f64 {
        match *self {
            Reward::Plain { rho_max } | Reward::Tanh { rho_max, .. } => rho_max,
        }
    }

    /// Reward of a lawful run with robustness `rho` = ρ(¬ψ).
    ///
    /// ρ = 0 counts as held. Infinite robustness (no window, Boolean signals)
    /// is clamped first.
    pub fn lawful(&self, rho: f64) -> f64 {
        match *self {
            Reward::Plain { rho_max } => rho.clamp(-rho_max * OPEN, rho_max * OPEN),
            Reward::Tanh {
                rho_max,
                scale,
                jump,
                ..
            } => {
                let rho = rho.clamp(-rho_max, rho_max);
                let step = if 0.0 < rho { jump } else { -jump };
                let reward = step + (1.0 - jump) * libm::tanh(rho / scale);
                reward.clamp(-OPEN, OPEN)
            }
        }
    }

    /// Reward of a success by `rho` > 0 that reaches the goals of its training to
    /// a share in [0, 1]: from what Definition 4 pays it up to the top of what
    /// Definition 4 pays for any success, and so above everything else.
    ///
    /// A share that is NaN counts as 0.
    pub fn success(&self, rho: f64, share: f64) -> f64 {
        let (least, most) = (self.lawful(rho), self.lawful(f64::INFINITY));
        let share = if share.is_nan() { 0.0 } else { share };
        least + share.clamp(0.0, 1.0) * (most - least)
    }

    /// Reward of a lawful violation by `rho` > 0 that does not count: above all
    /// that held, below 0, where all that counts is, and larger the deeper it is.
    ///
    /// `Plain` has no step between the two and pays it as if ψ_ego had held
    /// exactly; worlds in which something does not count are refused with it.
    pub fn uncounted(&self, rho: f64) -> f64 {
        match *self {
            Reward::Plain { .. } => self.lawful(0.0),
            Reward::Tanh {
                rho_max,
                scale,
                jump,
                ..
            } => {
                let rho = rho.clamp(0.0, rho_max);
                let depth = libm::tanh(rho / scale);
                -jump * (1.0 - depth.clamp(1.0 - OPEN, OPEN))
            }
        }
    }

    /// Penalty when `forfeited` (M ≥ 1) of `rules` rules are forfeited.
    pub fn foul(&self, forfeited: usize, rules: usize) -> f64 {
        match *self {
            Reward::Plain { rho_max } => -(forfeited as f64) * rho_max,
            Reward::Tanh { foul_span, .. } => {
                -1.0 - foul_span * (forfeited as f64 - 1.0) / rules.max(1) as f64
            }
        }
    }

    /// The reward of a verdict; an invalid episode has none.
    pub fn of(&self, verdict: &Verdict, rules: usize) -> Option<f64> {
        match verdict {
            Verdict::Counterexample { by } => Some(self.lawful(*by)),
            Verdict::Uncounted { by } => Some(self.uncounted(*by)),
            Verdict::Held { margin } => Some(self.lawful(-*margin)),
            Verdict::Foul { forfeited, .. } => Some(self.foul(*forfeited, rules)),
            Verdict::Invalid => None,
        }
    }
}
