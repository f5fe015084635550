//! Verdict of an episode.

use serde::{Deserialize, Serialize};

use crate::stats::StartOutcome;

/// Verdict of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Verdict {
    /// ψ_ego violated by `by` = ρ(¬ψ) > 0 with every rule strictly kept.
    ///
    /// The violation counts in this world ([`super::Counts`]).
    Counterexample {
        /// Depth of the violation.
        by: f64,
    },
    /// ψ_ego violated in a way that does not count ([`super::Counts`]).
    ///
    /// `by` = ρ(¬ψ) > 0, and every rule was strictly kept.
    Uncounted {
        /// Depth of the violation.
        by: f64,
    },
    /// ψ_ego held with `margin` = ρ(ψ) ≥ 0, or the motion ended first.
    Held {
        /// Robustness of the specification.
        margin: f64,
    },
    /// An ado broke its rule number `rule`.
    Foul {
        /// Position of the rule in the rulebook.
        rule: usize,
        /// M of Definition 4: rules of no higher priority, with this rule.
        forfeited: usize,
    },
    /// Fault of the ego or of the physics, never a success.
    Invalid,
}

impl Verdict {
    /// Returns the word used in tables and files.
    pub fn word(&self) -> &'static str {
        match self {
            Verdict::Counterexample { .. } => "counterexample",
            Verdict::Uncounted { .. } => "uncounted",
            Verdict::Held { .. } => "held",
            Verdict::Foul { .. } => "foul",
            Verdict::Invalid => "invalid",
        }
    }

    /// Returns true if the ado made the ego fail with all rules kept.
    pub fn is_success(&self) -> bool {
        matches!(self, Verdict::Counterexample { .. })
    }

    /// Returns true if an ado broke a rule, which is no success.
    pub fn is_foul(&self) -> bool {
        matches!(self, Verdict::Foul { .. })
    }
}

/// State of the ados' rules between a success and the contact.
///
/// The episode is decided on the first violating sample. This value adds
/// whether the ado is still lawful when the two bodies touch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum RulesUntilContact {
    /// No rule was lost up to the contact, with the contact's sample.
    Kept,
    /// A rule was lost, so the contact itself is not a counterexample.
    Broken {
        /// Rule lost first, the most important if several were lost at once.
        rule: String,
        /// Name of the ado that broke the rule.
        ado: String,
        /// Time of the loss, at most the time of the contact.
        time_s: f64,
    },
}

impl RulesUntilContact {
    /// Returns true if no rule was broken before the contact.
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

impl From<&Verdict> for StartOutcome {
    fn from(verdict: &Verdict) -> StartOutcome {
        match verdict {
            Verdict::Counterexample { .. } => StartOutcome::Solved,
            Verdict::Uncounted { .. } => StartOutcome::Uncounted,
            Verdict::Held { .. } => StartOutcome::Held,
            Verdict::Foul { .. } => StartOutcome::RuleViolation,
            Verdict::Invalid => StartOutcome::Invalid,
        }
    }
}
