//! The list of panels: a file each, and a line here.
//!
//! What is written, which views there are and where, and the table of entities
//! in the head of `view` follow from the list.

mod actions;
mod events;
mod from_above;
mod map;
mod robustness;
mod scene;
mod signals;
mod verdict;

use rerun::blueprint::components::ContainerKind;

use super::error::ViewError;
use super::journal::Journal;
use super::layout::Layout;
use super::panel::{Column, Entity, Panel};
use super::story::Story;
use crate::scenario::Scenario;

/// From the top of their columns down.
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

/// What recordings of a world consist of, panel by panel.
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

/// Writes what the panels of an episode show.
pub(super) fn log(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let mut panels = PANELS.iter().filter(|panel| panel.applies(story.scenario));
    panels.try_for_each(|panel| (panel.log)(story, journal))
}

/// Writes the blueprint: every panel in its column.
pub(super) fn lay_out(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let mut layout = Layout::new(journal);
    let (mut columns, mut widths) = (Vec::new(), Vec::new());
    for (column, title, width) in Column::ALL {
        let panels = PANELS.iter().filter(|panel| panel.column == column);
        let (mut views, mut heights) = (Vec::new(), Vec::new());
        for panel in panels.filter(|panel| panel.applies(story.scenario)) {
            for (view, height) in (panel.views)(story, &mut layout)? {
                views.push(view);
                heights.push(height);
            }
        }
        columns.push(match views.len() {
            1 => views.remove(0),
            _ => layout.container(ContainerKind::Vertical, title, &views, &heights)?,
        });
        widths.push(width);
    }
    let title = story.scenario.name.as_str();
    let root = layout.container(ContainerKind::Horizontal, title, &columns, &widths)?;
    layout.window(&root)
}

#[cfg(test)]
mod tests {
    use rerun::StoreKind;
    use rerun::log::{Chunk, LogMsg};

    use super::*;
    use crate::scene::Start;
    use crate::testbench::{Aftermath, Constant, Episode, play};
    use crate::view::panel::Shown;

    const HEAD: &str = include_str!("../mod.rs");

    #[test]
    fn the_table_of_the_guide_is_the_list() {
        let mut table = String::from("//! | panel | of | entity | what it is |\n");
        table += "//! | --- | --- | --- | --- |\n";
        for panel in PANELS {
            let of = match panel.shown {
                Shown::Everywhere => "all",
                Shown::OnRoads => "roads",
                Shown::OnGrids => "grids",
            };
            for (entity, about) in panel.entities {
                table += &format!("//! | {} | {of} | `{entity}` | {about} |\n", panel.name);
            }
        }
        assert!(HEAD.contains(&table), "src/view/mod.rs needs\n\n{table}");
    }

    /// An episode of a shipped world in which the ado does the same all along.
    fn played(name: &str, action: usize) -> (Scenario, Episode) {
        let file = format!("{}/worlds/{name}", env!("CARGO_MANIFEST_DIR"));
        let world = Scenario::load(file.as_ref()).expect("a world");
        let mut bench = world.bench();
        let middle = bench.axes().iter().map(|axis| 0.5 * (axis.lo + axis.hi));
        let start = match world.starts() {
            Some(starts) => starts[17].clone(),
            None => Start(middle.collect()),
        };
        let episode = play(
            &mut bench,
            &start,
            0,
            &mut Constant(action),
            Aftermath::Play,
        );
        (world, episode)
    }

    fn written(panel: &Panel, story: &Story<'_>) -> Vec<String> {
        let mut journal = Journal::new(StoreKind::Recording);
        (panel.log)(story, &mut journal).expect("logged");
        let messages = journal.into_messages().into_iter();
        let entities = messages.filter_map(|message| match message {
            LogMsg::ArrowMsg(_, arrow) => Some(Chunk::from_arrow_msg(&arrow).expect("a chunk")),
            _ => None,
        });
        entities
            .map(|chunk| chunk.entity_path().to_string())
            .collect()
    }

    fn is_of(entity: &str, pattern: &str) -> bool {
        let (mut parts, mut want) = (entity.split('/'), pattern.split('/'));
        let pairs = std::iter::from_fn(|| match (parts.next(), want.next()) {
            (None, None) => None,
            pair => Some(pair),
        });
        pairs.into_iter().all(|pair| match pair {
            (Some(part), Some(want)) => want.starts_with('<') || part == want,
            _ => false,
        })
    }

    #[test]
    fn panels_write_what_their_list_of_entities_says_and_all_of_it() {
        let episodes = [
            ("acc.ron", 0),
            ("yellow_light.ron", 0),
            ("grid_hard.ron", 0),
        ];
        let mut seen = Vec::new();
        for (world, episode) in episodes.map(|(world, action)| played(world, action)) {
            let story = Story::new(&world, &episode, "");
            for panel in PANELS.iter().filter(|panel| panel.applies(&world)) {
                for entity in written(panel, &story) {
                    let named = panel.entities.iter().find(|(it, _)| is_of(&entity, it));
                    assert!(named.is_some(), "{} writes {entity}", panel.name);
                    seen.extend(named.map(|(pattern, _)| *pattern));
                }
            }
        }
        for (pattern, _) in PANELS.iter().flat_map(|panel| panel.entities) {
            // A light is a road user to the pattern before it.
            let same = |seen: &&str| is_of(pattern, seen) || seen == pattern;
            assert!(seen.iter().any(same), "nobody wrote {pattern}");
        }
    }
}
