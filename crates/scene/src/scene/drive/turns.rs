//! An ado that decides which placed ados act.

use super::actions::Actions;
use super::spec::DriveSpec;
use super::turn_action::TurnAction;

/// Placed ados that act, by their positions among those of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    Idle,
    All,
    Only(usize),
}

impl Turn {
    pub(super) fn is_of(self, ado: usize) -> bool {
        match self {
            Turn::Idle => false,
            Turn::All => true,
            Turn::Only(own) => own == ado,
        }
    }
}

/// Returns the turn of each action of the ado that gives turns.
pub(super) fn turns(spec: &DriveSpec) -> Vec<Turn> {
    match spec.turns.as_ref().map(|turns| &turns.actions) {
        Some(Actions::Turns(list)) => list.iter().map(|action| turn(action, spec)).collect(),
        _ => Vec::new(),
    }
}

fn turn(action: &TurnAction, spec: &DriveSpec) -> Turn {
    match action {
        TurnAction::Idle => Turn::Idle,
        TurnAction::All => Turn::All,
        TurnAction::Only(own) => {
            let at = spec.trained().position(|(name, _)| name == own);
            // Invariant: the world was checked, so it has every ado that is named.
            at.map_or(Turn::Idle, Turn::Only)
        }
    }
}
