//! One start of a campaign, as a line of JSON.

use serde::{Deserialize, Serialize};

use crate::rulebook::Verdict;
use crate::severity::CrashKind;
use crate::stats::StartOutcome;

/// How a start of a campaign ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RowOutcome {
    /// The ego was made to fail, every rule kept.
    Fails,
    /// It kept its specification.
    Held,
    /// The ado broke a rule first.
    Foul,
    /// The ego violated its specification, but not in a way that counts.
    Uncounted,
    /// Left out: the nominal ego fails there without an adversary.
    Trivial,
    /// The ego or the physics failed to run.
    Invalid,
}

impl RowOutcome {
    /// That of a verdict.
    pub(super) fn of(verdict: &Verdict) -> RowOutcome {
        match verdict {
            Verdict::Counterexample { .. } => RowOutcome::Fails,
            Verdict::Uncounted { .. } => RowOutcome::Uncounted,
            Verdict::Held { .. } => RowOutcome::Held,
            Verdict::Foul { .. } => RowOutcome::Foul,
            Verdict::Invalid => RowOutcome::Invalid,
        }
    }

    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            RowOutcome::Fails => "fails",
            RowOutcome::Held => "held",
            RowOutcome::Foul => "foul",
            RowOutcome::Uncounted => "uncounted",
            RowOutcome::Trivial => "trivial",
            RowOutcome::Invalid => "invalid",
        }
    }

    /// What rates make of it.
    pub fn start(self) -> StartOutcome {
        match self {
            RowOutcome::Fails => StartOutcome::Solved,
            RowOutcome::Held | RowOutcome::Foul | RowOutcome::Uncounted => StartOutcome::Unsolved,
            RowOutcome::Trivial => StartOutcome::Trivial,
            RowOutcome::Invalid => StartOutcome::Invalid,
        }
    }
}

/// One start of a campaign: every line of the merged file has all of these keys.
///
/// It holds nothing of the machine, of times, or of how the campaign was cut.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartRow {
    /// Name of the world.
    pub world: String,
    /// Which physics.
    pub plant: String,
    /// Which ego.
    pub ego: String,
    /// Who played the ado.
    pub ado: String,
    /// Seed of the ado's training, if it was trained.
    pub train_seed: Option<u64>,
    /// Position among the starts.
    pub start: u64,
    /// The start: a value per axis of X_init, in the order of `check`.
    pub x: Vec<f64>,
    /// How it ended.
    pub outcome: RowOutcome,
    /// ρ(ψ_ego) of what was judged, below 0 where the ego fails; `None`: a search
    /// found nothing, a rule was broken first, or it was not played.
    pub robustness: Option<f64>,
    /// The first rule that was broken, if one was.
    pub rule: Option<String>,
    /// Where the ego fails: the part of ψ_ego that decides.
    pub leaf: Option<String>,
    /// Whether it ended in contact.
    pub contact: bool,
    /// Approach speed of the contact.
    pub closing_mps: Option<f64>,
    /// How they met, if the ego had part in it.
    pub kind: Option<CrashKind>,
    /// How much the contact changes the ego's velocity.
    pub ego_delta_v_mps: Option<f64>,
    /// The injury risk, where a published curve applies.
    pub injury_risk: Option<f64>,
    /// Whether CC_LATCHED or FSM would have avoided it; `None`: nobody judged it,
    /// or nobody can.
    pub preventable: Option<bool>,
    /// Episodes that it took.
    pub simulations: u64,
    /// Physics steps that it took.
    pub physics_steps: u64,
    /// The ados' joint actions, one per decision, where the ego fails.
    pub actions: Vec<usize>,
}
