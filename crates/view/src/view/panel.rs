//! Panels: the entities they write, and the views that show them.

use super::error::ViewError;
use super::layout::{BlueprintBuilder, Views};
use super::log_writer::LogWriter;
use super::viewed_episode::ViewedEpisode;
use crate::world::{Scenario, ScenarioKind};

/// Part of recordings, as a file in `panels/` and a line in the list there.
pub(super) struct Panel {
    /// Name of the panel.
    pub name: &'static str,
    pub column: Column,
    pub shown: PanelWorlds,
    /// Entities with their descriptions, as in [`Entity::path`].
    pub entities: &'static [(&'static str, &'static str)],
    /// Function that writes the entities.
    pub log: fn(&ViewedEpisode<'_>, &mut LogWriter) -> Result<(), ViewError>,
    /// Function that adds the views, from top to bottom, with their shares.
    pub views: fn(&ViewedEpisode<'_>, &mut BlueprintBuilder<'_>) -> Result<Views, ViewError>,
}

/// Entity of recordings, for programs that read them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entity {
    /// Panel that shows the entity.
    pub panel: &'static str,
    /// Path of the entity.
    ///
    /// A part such as `<agent>` is a name. Entities without content in an
    /// episode are absent.
    pub path: &'static str,
    /// Logged content in a few words.
    pub about: &'static str,
}

/// Column of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    Space,
    Curves,
    Words,
}

impl Column {
    /// All columns from left to right, with their shares of the width.
    pub(super) const ALL: [(Column, &str, f32); 3] = [
        (Column::Space, "space", 5.0),
        (Column::Curves, "curves", 4.0),
        (Column::Words, "words", 2.6),
    ];
}

/// Worlds that have a panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PanelWorlds {
    Everywhere,
    OnRoads,
    OnGrids,
}

impl Panel {
    /// Returns true if recordings of a world have the panel.
    pub(super) fn applies(&self, scenario: &Scenario) -> bool {
        match scenario.kind() {
            ScenarioKind::Drive(_) => self.shown != PanelWorlds::OnGrids,
            ScenarioKind::Grid(_) => self.shown != PanelWorlds::OnRoads,
        }
    }
}
