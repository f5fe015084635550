//! What a panel is: what it writes, and by which views it is seen.

use super::error::ViewError;
use super::journal::Journal;
use super::layout::{Layout, Views};
use super::story::Story;
use crate::world::Scenario;

/// A part of recordings: a file in `panels/`, and its line in the list there.
pub(super) struct Panel {
    /// What it is called.
    pub name: &'static str,
    pub column: Column,
    pub shown: Shown,
    /// What it writes, and what each is; see [`Entity::path`].
    pub entities: &'static [(&'static str, &'static str)],
    /// Writes its entities.
    pub log: fn(&Story<'_>, &mut Journal) -> Result<(), ViewError>,
    /// Its views, from the top down, with their shares of the column's height.
    pub views: fn(&Story<'_>, &mut Layout<'_>) -> Result<Views, ViewError>,
}

/// Something that recordings consist of, for those who read them by program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entity {
    /// The panel that shows it.
    pub panel: &'static str,
    /// Where it stands; a part such as `<agent>` is a name, and what does not
    /// happen in an episode is not there.
    pub path: &'static str,
    /// What is logged there, in a few words.
    pub about: &'static str,
}

/// A column of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    Space,
    Curves,
    Words,
}

impl Column {
    /// All of them from left to right, with their shares of the width.
    pub const ALL: [(Column, &str, f32); 3] = [
        (Column::Space, "space", 5.0),
        (Column::Curves, "curves", 4.0),
        (Column::Words, "words", 2.6),
    ];
}

/// Which worlds a panel is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shown {
    Everywhere,
    OnRoads,
    OnGrids,
}

impl Panel {
    /// Whether recordings of a world have it.
    pub fn applies(&self, scenario: &Scenario) -> bool {
        match self.shown {
            Shown::Everywhere => true,
            Shown::OnRoads => scenario.grid().is_none(),
            Shown::OnGrids => scenario.grid().is_some(),
        }
    }
}
