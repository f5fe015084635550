//! Cells of failures: what distinguishes one failure of an ego from another.
//!
//! Cells are compared by their fields and serialized canonically, so that archives,
//! evaluations and JSON agree. Captions are for display only.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use super::{RunDir, RunError};
use crate::content_hash::sha256;
use crate::rl::Demonstration;
use crate::run_files::KNOWN;
use crate::severity::CrashKind;
use crate::world::Scenario;

/// Width of the bins of closing speeds.
pub const CLOSING_BIN_MPS: f64 = 2.0;

/// Cell of a failure: its kind, and the action that it requires.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailureCell {
    /// Kind of the failure.
    pub failure: CellFailure,
    /// Action without which the ego does not fail. `None`: no single one.
    #[serde(default, rename = "decisive", skip_serializing_if = "Option::is_none")]
    pub necessary: Option<NecessaryAction>,
}

/// Kind of a failure in a cell.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CellFailure {
    /// Contact of the ego, before which the ados broke no rule.
    Contact {
        /// Name of the other agent.
        partner: String,
        /// Geometry of the collision.
        kind: CrashKind,
        /// Number of the bin of the closing speed, from 0.
        closing_bin: u32,
    },
    /// Violation of ψ_ego without such a contact.
    Violation {
        /// Violated leaf of ψ_ego.
        leaf: String,
    },
}

/// Action of one ado without which the ego does not fail.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NecessaryAction {
    /// Name of the ado.
    pub ado: String,
    /// Number of the action in the ado's own set.
    pub action: usize,
}

impl CellFailure {
    /// Returns the kind of a contact with `partner`.
    ///
    /// A closing speed that is negative or NaN is in bin 0.
    pub fn contact(partner: &str, kind: CrashKind, closing_mps: f64) -> CellFailure {
        CellFailure::Contact {
            partner: partner.to_owned(),
            kind,
            // The cast saturates, and is 0 for NaN and negative numbers.
            closing_bin: (closing_mps / CLOSING_BIN_MPS) as u32,
        }
    }
}

impl FailureCell {
    /// Returns the cell in words, with the necessary action as its world labels it.
    pub fn in_words(&self, world: &Scenario) -> String {
        let failure = self.failure.to_string();
        match &self.necessary {
            Some(action) => format!("{failure}, {}: {}", action.ado, action.label(world)),
            None => failure,
        }
    }
}

impl NecessaryAction {
    /// Returns the label of the action, its number in a world without such an action.
    fn label(&self, world: &Scenario) -> String {
        let Some(driving) = world.drive() else {
            return world.action_label(self.action);
        };
        // The cell may stem from another edition of the world, with more actions.
        let mut sets = driving.spec().action_sets();
        let own = sets
            .find(|(name, ..)| *name == self.ado)
            .filter(|(_, actions, _)| self.action < actions.len());
        own.map_or_else(
            || format!("action {}", self.action),
            |(_, actions, _)| actions.label(self.action),
        )
    }
}

impl Display for CellFailure {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            CellFailure::Contact {
                partner,
                kind,
                closing_bin,
            } => {
                let from_mps = f64::from(*closing_bin) * CLOSING_BIN_MPS;
                let until_mps = from_mps + CLOSING_BIN_MPS;
                write!(
                    f,
                    "{} with {partner} at {from_mps:.0}–{until_mps:.0} m/s",
                    kind.word()
                )
            }
            CellFailure::Violation { leaf } => write!(f, "`{leaf}` without contact"),
        }
    }
}

/// Number of failures in a cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellCount {
    /// The cell.
    pub cell: FailureCell,
    /// Failures in it.
    pub failures: u64,
}

/// Failures that are known before a training, and of which rare kinds earn more.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownFailures {
    /// Occupied cells, in order.
    pub cells: Vec<CellCount>,
    /// Failures that the learner is shown, on training starts of the run's seed.
    pub demonstrations: Vec<Demonstration>,
}

impl RunDir {
    /// Writes the failures whose rarity is rewarded, if any, for the manifest that follows.
    pub(super) fn write_known(&mut self, known: Option<&KnownFailures>) -> Result<(), RunError> {
        let Some(known) = known else {
            return Ok(());
        };
        let text = serde_json::to_string(known).map_err(|error| self.invalid(&error))?;
        self.write(KNOWN, text.as_bytes())?;
        // The manifest follows, so a run that names this hash has the file.
        self.manifest.known_sha256 = Some(sha256(text.as_bytes()));
        Ok(())
    }

    /// Returns the failures whose rarity the training rewards. `None` if there are none.
    ///
    /// # Errors
    ///
    /// Returns an error if their file is missing or damaged.
    pub fn known_failures(&self) -> Result<Option<KnownFailures>, RunError> {
        // Only later members of a population know failures before their training.
        let Some(expected) = &self.manifest.known_sha256 else {
            return Ok(None);
        };
        let bytes = self.read_verified(KNOWN, Some(expected))?;
        let known = serde_json::from_slice(&bytes);
        known.map(Some).map_err(|error| self.invalid(&error))
    }

    fn invalid(&self, error: &serde_json::Error) -> RunError {
        RunError::Damaged {
            path: self.path.join(KNOWN),
            why: error.to_string(),
        }
    }
}
