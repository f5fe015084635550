//! Reward of Definition 4, as a number per verdict.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::verdict::Verdict;

/// Map from a verdict to a number.
///
/// It increases strictly in ρ(¬ψ) and puts every rule violation below the rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum Reward {
    /// Definition 4 as printed, with the penalty −M ρ_max.
    Plain {
        /// Clamp of the robustness, above 0.
        rho_max: f64,
    },
    /// ±jump + (1 − jump) tanh(ρ / scale), fouls at −1 − span (M − 1) / rules.
    Tanh {
        /// Clamp of the robustness, above 0.
        #[serde(default = "default_rho_max")]
        rho_max: f64,
        /// Robustness at which tanh reaches 0.76, above 0.
        #[serde(default = "default_scale")]
        scale: f64,
        /// Jump at ρ = 0, in [0, 1).
        #[serde(default = "default_jump")]
        jump: f64,
        /// Span of the penalties, above 0: they lie in (−1 − span, −1], by rank.
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

/// Returns a span so small that a broken rule costs little more than holding.
///
/// With a span of 1, ados that must cut in along a rule's bound learned to keep
/// away from it.
// Recall on `merge`, three seeds: 0.94 to 0.97 with a span of 1, 0.99 to 1.00 with 0.1.
// On `pedestrian` 0.71 (a seed) with 1, 1.00 and 0.88 with 0.1. Other jumps did not help.
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

/// Factor that keeps lawful values inside the clamp, so no penalty is a tie.
///
/// Learners read rewards as f32, hence no smaller distance to 1.
const OPEN: f64 = 1.0 - 1e-6;

impl Reward {
    /// Returns the clamp ρ_max of the robustness.
    pub fn rho_max(&self) -> f64 {
        match *self {
            Reward::Plain { rho_max } | Reward::Tanh { rho_max, .. } => rho_max,
        }
    }

    /// Returns the reward of a lawful run with robustness `rho` = ρ(¬ψ).
    ///
    /// ρ = 0 counts as held. Infinite robustness (an empty window, Boolean signals)
    /// is clamped first.
    pub fn lawful(&self, rho: f64) -> f64 {
        match *self {
            // In the unit of ρ, so the open interval scales with ρ_max.
            Reward::Plain { rho_max } => rho.clamp(-rho_max * OPEN, rho_max * OPEN),
            Reward::Tanh {
                rho_max,
                scale,
                jump,
                ..
            } => {
                let rho = rho.clamp(-rho_max, rho_max);
                // The jump separates the outcomes: a bare success is worth clearly more than
                // a run that barely held.
                let step = if rho > 0.0 { jump } else { -jump };
                let reward = step + (1.0 - jump) * libm::tanh(rho / scale);
                // tanh saturates to ±1 in floating point, where a lawful run would tie.
                reward.clamp(-OPEN, OPEN)
            }
        }
    }

    /// Returns the reward of a success by `rho` > 0 that reaches a share of its goals.
    ///
    /// A share of 0 earns the reward of Definition 4. A share of 1 earns the limit
    /// of that reward for large `rho`, and so more than any other outcome. A share
    /// that is NaN counts as 0.
    pub fn success(&self, rho: f64, share: f64) -> f64 {
        let (least, most) = (self.lawful(rho), self.lawful(f64::INFINITY));
        let share = if share.is_nan() { 0.0 } else { share };
        // Rounding may carry the sum past the limit that nothing exceeds.
        (least + share.clamp(0.0, 1.0) * (most - least)).min(most)
    }

    /// Returns the reward of a lawful violation by `rho` > 0 that does not count.
    ///
    /// The result exceeds that of every held run, stays below 0, and so below every
    /// counted violation, and grows with `rho`.
    ///
    /// `Plain` has no step between the two and returns the reward of ρ = 0. Worlds
    /// in which some violations do not count are refused with `Plain`.
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
                // The clamp of the depth keeps both ends open, so no outcome ties a neighbour.
                let depth = libm::tanh(rho / scale);
                -jump * (1.0 - depth.clamp(1.0 - OPEN, OPEN))
            }
        }
    }

    /// Returns the penalty for `forfeited` (M ≥ 1) of `rules` rules.
    pub fn foul(&self, forfeited: usize, rules: usize) -> f64 {
        // Paper: −M ρ_min. Here: −M ρ_max, because with ρ_min = −ρ_max < 0 the printed
        // formula would be a bonus and Lemma 2 false.
        match *self {
            Reward::Plain { rho_max } => -(forfeited as f64) * rho_max,
            Reward::Tanh { foul_span, .. } => {
                // M − 1 over the number of rules keeps the lowest penalty above −1 − span.
                -1.0 - foul_span * (forfeited as f64 - 1.0) / rules.max(1) as f64
            }
        }
    }

    /// Returns the reward of a verdict, `None` for an invalid episode.
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
