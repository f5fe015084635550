//! List of panels: one file each, and one line here.
//!
//! The list determines the written entities, the views and their places, and
//! the table of entities in the documentation of `view`.

mod actions;
mod events;
mod from_above;
mod map;
mod robustness;
mod scene;
mod signals;
mod verdict;

use re_sdk_types::blueprint::components::ContainerKind;

use super::error::ViewError;
use super::layout::{BlueprintBuilder, Views};
use super::learning;
use super::log_writer::LogWriter;
use super::panel::{Column, Entity, Panel};
use super::viewed_episode::ViewedEpisode;
use crate::world::Scenario;

/// Panels from the top of their columns to the bottom.
static PANELS: [&Panel; 8] = [
    &map::PANEL,
    &scene::PANEL,
    &from_above::PANEL,
    &actions::PANEL,
    &events::PANEL,
    &robustness::PANEL,
    &signals::PANEL,
    &verdict::PANEL,
];

/// Returns the entities of a world's recordings, panel by panel.
pub fn entities(scenario: &Scenario) -> impl Iterator<Item = Entity> {
    let panels = PANELS.iter().filter(|panel| panel.applies(scenario));
    panels.flat_map(|panel| {
        let entities = panel.entities.iter();
        entities.map(|(path, about)| Entity {
            panel: panel.name,
            path,
            about,
        })
    })
}

/// Logs the entities of an episode's panels.
pub(super) fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let mut panels = PANELS.iter().filter(|panel| panel.applies(story.scenario));
    panels.try_for_each(|panel| (panel.log)(story, journal))
}

/// Writes the blueprint, with every panel in its column.
pub(super) fn lay_out(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let layout = BlueprintBuilder::new(journal);
    arrange(story, layout, false, |_| Ok(Vec::new()))
}

/// Writes the blueprint of a stream, in a training with its learning curves.
///
/// A mixed stream has episodes on roads and on grids, so it has the panels of both.
pub(super) fn lay_out_stream(
    story: &ViewedEpisode<'_>,
    journal: &mut LogWriter,
    is_mixed: bool,
    shows_learning: bool,
) -> Result<(), ViewError> {
    let layout = BlueprintBuilder::of_stream(journal);
    if shows_learning {
        arrange(story, layout, is_mixed, learning::views)
    } else {
        arrange(story, layout, is_mixed, |_| Ok(Vec::new()))
    }
}

/// Arranges the views, with `first` above the words.
fn arrange<'a>(
    story: &ViewedEpisode<'_>,
    mut layout: BlueprintBuilder<'a>,
    is_mixed: bool,
    first: impl FnOnce(&mut BlueprintBuilder<'a>) -> Result<Views, ViewError>,
) -> Result<(), ViewError> {
    let mut first = first(&mut layout)?;
    let (mut columns, mut widths) = (Vec::new(), Vec::new());
    for (column, title, width) in Column::ALL {
        let panels = PANELS.iter().filter(|panel| panel.column == column);
        let (mut views, mut heights) = (Vec::new(), Vec::new());
        if column == Column::Words {
            for (view, height) in first.drain(..) {
                views.push(view);
                heights.push(height);
            }
        }
        for panel in panels.filter(|panel| is_mixed || panel.applies(story.scenario)) {
            for (view, height) in (panel.views)(story, &mut layout)? {
                views.push(view);
                heights.push(height);
            }
        }
        columns.push(match views.len() {
            // A container around a single view would only add a frame.
            1 => views.remove(0),
            _ => layout.container(ContainerKind::Vertical, title, &views, &heights)?,
        });
        widths.push(width);
    }
    let title = story.scenario.name.as_str();
    // Last, since a container needs the nodes of its contents.
    let root = layout.container(ContainerKind::Horizontal, title, &columns, &widths)?;
    layout.window(story, &root)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::panel::PanelWorlds;

    const HEAD: &str = include_str!("../mod.rs");

    #[test]
    fn the_table_of_the_guide_is_the_list() {
        let mut table = String::from("//! | panel | of | entity | what it is |\n");
        table += "//! | --- | --- | --- | --- |\n";
        for panel in PANELS {
            let of = match panel.shown {
                PanelWorlds::Everywhere => "all",
                PanelWorlds::OnRoads => "roads",
                PanelWorlds::OnGrids => "grids",
            };
            for (entity, about) in panel.entities {
                table += &format!("//! | {} | {of} | `{entity}` | {about} |\n", panel.name);
            }
        }
        assert!(
            HEAD.contains(&table),
            "crates/view/src/view/mod.rs needs\n\n{table}"
        );
    }
}
