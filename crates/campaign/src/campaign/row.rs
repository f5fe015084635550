//! Start of a campaign as a line of JSON.

use serde::{Deserialize, Serialize};

use crate::scene::AfterContact;
use crate::scene::Dynamics;
use crate::severity::CrashKind;
use crate::stats::StartOutcome;

/// Start of a campaign. Every line of the merged file has all of these keys.
///
/// It holds nothing of the machine, of times, or of the cut of the campaign.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StartRow {
    /// Name of the world.
    pub world: String,
    /// The plant.
    pub plant: Dynamics,
    /// Name of the ego.
    pub ego: String,
    /// Name of the ado.
    pub ado: String,
    /// Seed of the ado's training, if it was trained.
    pub train_seed: Option<u64>,
    /// Position among the starts.
    pub start: u64,
    /// Value per axis of X_init, in the order of `check`.
    pub x: Vec<f64>,
    /// Outcome of the start.
    pub outcome: StartOutcome,
    /// ρ(ψ_ego) of the judged samples, below 0 where the ego fails.
    ///
    /// `None`: a search found no solution, a rule was broken first, or the start was not played.
    pub robustness: Option<f64>,
    /// First broken rule, if any.
    pub rule: Option<String>,
    /// Part of ψ_ego that decides, if the ego fails.
    pub leaf: Option<String>,
    /// Whether the episode ended in contact.
    pub contact: bool,
    /// Closing speed at the contact.
    pub closing_mps: Option<f64>,
    /// Kind of the contact, if the ego took part.
    pub kind: Option<CrashKind>,
    /// Change of the ego's velocity by the contact.
    pub ego_delta_v_mps: Option<f64>,
    /// Injury risk, where a published curve applies.
    pub injury_risk: Option<f64>,
    /// Motion after the contact, in worlds that state `after_contact_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after_contact: Option<AfterContact>,
    /// Whether CC_LATCHED or FSM would have avoided the contact.
    ///
    /// `None`: it was not judged or cannot be.
    pub preventable: Option<bool>,
    /// Whether no driver would have avoided it, not even full braking without delay.
    ///
    /// `None` as for `preventable`.
    pub unavoidable: Option<bool>,
    /// Number of episodes.
    pub simulations: u64,
    /// Number of physics steps.
    pub physics_steps: u64,
    /// Joint actions of the ados, one per decision, if the ego fails.
    pub actions: Vec<usize>,
}

/// Fields of a row that the summary uses.
#[derive(Deserialize)]
pub(super) struct SummaryFields {
    pub start: u64,
    pub outcome: StartOutcome,
    pub contact: bool,
    pub closing_mps: Option<f64>,
    pub ego_delta_v_mps: Option<f64>,
    pub preventable: Option<bool>,
    pub unavoidable: Option<bool>,
    pub simulations: u64,
    pub physics_steps: u64,
}
