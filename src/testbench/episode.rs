//! Record of a played episode.

use crate::ego::{Command, Fault};
use crate::rulebook::{RulesUntilContact, Verdict};
use crate::scene::{AfterContact, ContactEvent, Start};
use crate::trace::Trace;

/// Record of a played episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// Start of the episode.
    pub start: Start,
    /// Seed of all noise in the episode.
    pub noise: u64,
    /// The ados' joint actions per decision, including the aftermath.
    pub actions: Vec<usize>,
    /// All samples, including the aftermath.
    pub trace: Trace,
    /// Number of samples on which the verdict rests. The rest is aftermath.
    pub judged: usize,
    /// Verdict.
    pub verdict: Verdict,
    /// ρ(ψ_ego) of the judged samples.
    pub robustness: f64,
    /// The first contact, if the agents touched.
    pub contact: Option<ContactEvent>,
    /// Motion after the contact, in worlds with `after_contact_s`.
    pub after_contact: Option<AfterContact>,
    /// After a success that ended in contact: rules kept or broken up to the contact.
    pub rules_until_contact: Option<RulesUntilContact>,
    /// All rules that were broken, if the verdict is a rule violation.
    ///
    /// They are positions in the rulebook, in rising order.
    pub broken_rules: Vec<usize>,
    /// Fault that made the verdict invalid.
    pub fault: Option<Fault>,
    /// Commands of an external ego, per sample.
    ///
    /// Empty for other egos, which are deterministic.
    pub commands: Vec<Command>,
    /// Physics steps spent.
    pub physics_steps: u64,
}

impl Episode {
    /// Returns whether an ado violated a rule between a success and the contact.
    pub fn is_foul_before_contact(&self) -> bool {
        let rules = self.rules_until_contact.as_ref();
        rules.is_some_and(|rules| !rules.is_kept())
    }
}

/// Option to continue a decided episode, to record contact and closing speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aftermath {
    /// Stop at the verdict.
    Skip,
    /// After a success, continue with the same ado to contact or the horizon.
    Play,
}
