//! Turns of placed ados, as actions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Placed ados that act.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum TurnAction {
    /// None of them.
    Idle,
    /// All of them.
    All,
    /// The one of this name.
    Only(String),
}

impl TurnAction {
    /// Returns it in words.
    pub(super) fn label(&self) -> String {
        match self {
            TurnAction::Idle => "all idle".to_owned(),
            TurnAction::All => "all".to_owned(),
            TurnAction::Only(name) => format!("only {name}"),
        }
    }
}
