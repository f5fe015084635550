//! Kind of a failure, from which rows, cells, clusters and reports derive theirs.

use serde::{Deserialize, Serialize};

use super::failed_leaf::leaf;
use crate::run_dir::CellFailure;
use crate::severity::CrashKind;
use crate::testbench::Episode;
use crate::world::Scenario;

/// Kind of a failure: the violated part of ψ_ego, and the contact, if any.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FailureKind {
    /// Violated leaf of ψ_ego.
    pub leaf: String,
    /// Geometry of the contact. `None`: no contact, or the ego takes no part in it.
    #[serde(rename = "kind")]
    pub geometry: Option<CrashKind>,
    /// Agents in contact, if any.
    #[serde(rename = "with")]
    pub agents: Option<(String, String)>,
}

impl FailureKind {
    /// Returns the kind of the failure of an episode of `scenario`.
    pub fn of(scenario: &Scenario, episode: &Episode) -> FailureKind {
        let contact = episode.contact.as_ref();
        FailureKind {
            leaf: leaf(scenario, episode),
            geometry: contact.and_then(|touch| Some(touch.impact?.kind)),
            agents: contact.map(|touch| touch.between.clone()),
        }
    }

    /// Returns the contact in words, or the violated leaf without one.
    pub fn in_words(&self) -> String {
        match (&self.agents, self.geometry) {
            (None, _) => format!("`{}` without contact", self.leaf),
            (Some((a, b)), Some(geometry)) => format!("{} of {a} and {b}", geometry.word()),
            (Some((a, b)), None) => format!("contact of {a} and {b}"),
        }
    }

    /// Returns the kind in a cell, of a failure that ends in a lawful contact of the ego.
    ///
    /// Without its closing speed in m/s, or its geometry, the violated leaf counts.
    pub fn in_cell(self, ego: &str, closing_mps: Option<f64>) -> CellFailure {
        match (self.agents, self.geometry, closing_mps) {
            (Some((one, other)), Some(geometry), Some(closing_mps)) => {
                // The ego is part of each such contact, so only its partner distinguishes
                // cells.
                let partner = if one == ego { other } else { one };
                CellFailure::contact(&partner, geometry, closing_mps)
            }
            _ => CellFailure::Violation { leaf: self.leaf },
        }
    }
}
