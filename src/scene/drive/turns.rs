//! An ado that decides which placed ados act.

use serde::{Deserialize, Serialize};

use super::actions::Actions;
use super::spec::DriveSpec;

/// Ado without a body, which gives turns to the placed ados of a world.
///
/// A placed ado that has no turn plays its action without effect.
#[derive(Clone, Debug)]
pub struct TurnsAdo {
    /// Name in the file.
    pub name: String,
    /// Action set: [`Actions::Turns`].
    pub actions: Actions,
    /// Action that changes nothing.
    pub neutral: usize,
}

/// Placed ados that act.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TurnAction {
    /// None of them.
    Nobody,
    /// All of them.
    All,
    /// The one of this name.
    Only(String),
}

impl TurnAction {
    /// Returns it in words.
    pub(super) fn label(&self) -> String {
        match self {
            TurnAction::Nobody => "nobody".to_owned(),
            TurnAction::All => "all".to_owned(),
            TurnAction::Only(name) => format!("only {name}"),
        }
    }

    /// Returns the turn of a world's placed ados, by their positions.
    fn turn(&self, spec: &DriveSpec) -> Turn {
        match self {
            TurnAction::Nobody => Turn::Nobody,
            TurnAction::All => Turn::All,
            TurnAction::Only(own) => {
                let at = spec.trained().position(|(name, _)| name == own);
                // Invariant: the world was checked, so it has every ado that is named.
                at.map_or(Turn::Nobody, Turn::Only)
            }
        }
    }
}

/// Placed ados that act, by their positions among those of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    Nobody,
    All,
    Only(usize),
}

impl Turn {
    pub(super) fn is_of(self, ado: usize) -> bool {
        match self {
            Turn::Nobody => false,
            Turn::All => true,
            Turn::Only(own) => own == ado,
        }
    }
}

/// Returns the turn of each action of the ado that gives turns.
pub(super) fn turns(spec: &DriveSpec) -> Vec<Turn> {
    match spec.turns.as_ref().map(|turns| &turns.actions) {
        Some(Actions::Turns(list)) => list.iter().map(|action| action.turn(spec)).collect(),
        _ => Vec::new(),
    }
}
