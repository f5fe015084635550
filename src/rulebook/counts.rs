//! Which violations of ψ_ego are counterexamples.

use serde::{Deserialize, Serialize};

use crate::ego::reference::ReferenceDriver;

/// Which violations of ψ_ego are counterexamples; the others are
/// [`super::Verdict::Uncounted`].
///
/// A contact counts between the ego and any road user, an ado or not, where the
/// ego moves at more than 0.5 m/s and is not struck from behind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Counts {
    /// Every violation.
    #[default]
    Violation,
    /// Contacts at this closing speed or more.
    Contact {
        /// Least approach speed along the contact normal.
        closing_mps: f64,
    },
    /// Contacts that one of the named reference drivers in the ego's place avoids.
    Preventable {
        /// Drivers, any of whom would have.
        by: Vec<ReferenceDriver>,
        /// Least approach speed along the contact normal.
        #[serde(default)]
        closing_mps: f64,
    },
}

impl Counts {
    /// Whether every violation counts.
    pub fn is_violation(&self) -> bool {
        *self == Counts::Violation
    }

    /// Least closing speed of a contact that counts; `None`: none is needed.
    pub fn closing_mps(&self) -> Option<f64> {
        match self {
            Counts::Violation => None,
            Counts::Contact { closing_mps } | Counts::Preventable { closing_mps, .. } => {
                Some(*closing_mps)
            }
        }
    }
}
