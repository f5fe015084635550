//! What an episode is judged to be.

use serde::{Deserialize, Serialize};

/// How an episode is judged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Verdict {
    /// ψ_ego violated by `by` = ρ(¬ψ) > 0 while every rule was strictly kept,
    /// in a way that counts.
    Counterexample {
        /// Depth of the violation.
        by: f64,
    },
    /// ψ_ego was violated by `by` = ρ(¬ψ) > 0, every rule strictly kept, but
    /// not so that it counts in this world ([`super::Counts`]).
    Uncounted {
        /// Depth of the violation.
        by: f64,
    },
    /// ψ_ego held with `margin` = ρ(ψ) ≥ 0 (or the motion ended before a verdict).
    Held {
        /// Robustness of the specification.
        margin: f64,
    },
    /// The ado broke its rule number `rule`.
    Foul {
        /// Position of the rule in the rulebook.
        rule: usize,
        /// M of Definition 4: rules of no higher priority, this one included.
        forfeited: usize,
    },
    /// A fault of the ego or of the physics: nobody's success.
    Invalid,
}

impl Verdict {
    /// The word used in tables and files.
    pub fn word(&self) -> &'static str {
        match self {
            Verdict::Counterexample { .. } => "counterexample",
            Verdict::Uncounted { .. } => "uncounted",
            Verdict::Held { .. } => "held",
            Verdict::Foul { .. } => "foul",
            Verdict::Invalid => "invalid",
        }
    }

    /// Whether the ado made the ego fail with all rules kept.
    pub fn is_success(&self) -> bool {
        matches!(self, Verdict::Counterexample { .. })
    }

    /// Whether an ado broke a rule, which is no success.
    pub fn is_foul(&self) -> bool {
        matches!(self, Verdict::Foul { .. })
    }
}

/// Whether the ados' rules held between a success and the contact.
///
/// The verdict falls on the first violated sample; what it leaves open is
/// whether the ado is lawful when the two touch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum RulesUntilContact {
    /// No rule was lost for good up to the contact, that sample included.
    Kept,
    /// One was, so that the contact itself is no counterexample.
    Broken {
        /// The rule lost first; of several at once the most important one.
        rule: String,
        /// The ado that broke it.
        ado: String,
        /// When; at the latest the time of the contact.
        time_s: f64,
    },
}

impl RulesUntilContact {
    /// Whether no rule was broken before the contact.
    pub fn is_kept(&self) -> bool {
        *self == RulesUntilContact::Kept
    }
}

impl std::fmt::Display for RulesUntilContact {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            RulesUntilContact::Kept => write!(f, "kept"),
            RulesUntilContact::Broken { rule, ado, time_s } => {
                write!(f, "{ado} broke `{rule}` at {time_s:.2} s")
            }
        }
    }
}
