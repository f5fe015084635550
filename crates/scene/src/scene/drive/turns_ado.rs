//! Ado that gives turns to placed ados.

use super::actions::Actions;

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
