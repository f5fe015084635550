//! Grid world in the plane: cells, both players, their trails and the capture.
//!
//! Pictures have y downward and maps have it upward, so rows are mirrored here.

use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::{Arrows2D, Boxes2D, LineStrips2D, Points2D};
use re_sdk_types::blueprint::archetypes::{Background, VisualBounds2D};
use re_sdk_types::blueprint::components::BackgroundKind;
use re_sdk_types::datatypes::{Range1D, Range2D};

use crate::experiment::SampleInstant;
use crate::rulebook::Verdict;
use crate::scene::grid::Arena;
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, Views};
use crate::view::log_writer::LogWriter;
use crate::view::palette::{self, Rgb};
use crate::view::panel::{Column, Panel, PanelWorlds};
use crate::view::viewed_episode::ViewedEpisode;

pub(super) static PANEL: Panel = Panel {
    name: "map",
    column: Column::Space,
    shown: PanelWorlds::OnGrids,
    entities: &[
        ("/map/cells", "the cells, and fine ones"),
        ("/map/walls", "the walls around them"),
        ("/map/<player>", "the ego as a square, the ado as a disc"),
        ("/map/trail/<player>", "its way so far and its last move"),
        (
            "/map/outcome",
            "a frame around the cell where it was decided",
        ),
    ],
    log,
    views,
};

/// Entity that contains all entities with a place on the map.
const MAP: &str = "/map";
/// Margin around the map, in cells.
const MARGIN_CELLS: f64 = 0.6;

const CELL: Rgb = [84, 92, 104];
const FINE_LINE: Rgb = [50, 55, 63];
const WALL: Rgb = [225, 225, 220];

/// Map of the episode. Panels on grids have one.
fn arena<'a>(story: &ViewedEpisode<'a>) -> Option<&'a Arena> {
    Some(&story.scenario.grid()?.world().spec().arena)
}

/// View of the complete map.
fn views(story: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let Some(arena) = arena(story) else {
        return Ok(Vec::new());
    };
    let view = layout.view("2D", "map", MAP, &["$origin/**"])?;
    let dark = Background::new(BackgroundKind::SolidColor)
        .with_color(re_sdk_types::components::Color::from_rgb(17, 20, 26));
    layout.property(&view, "Background", &dark)?;
    let size = f64::from(arena.size);
    // The walls lie on the border of the map, and would be cut in half there.
    let range = Range1D([-MARGIN_CELLS, size + MARGIN_CELLS]);
    let bounds = VisualBounds2D::new(Range2D {
        x_range: range,
        y_range: range,
    });
    layout.property(&view, "VisualBounds2D", &bounds)?;
    Ok(vec![(view, 7.0)])
}

/// Logs all entities with a place on the map.
fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let Some(arena) = arena(story) else {
        return Ok(());
    };
    log_map(arena, journal)?;
    for who in 0..story.shown.stage.agents.len() {
        log_player(story, arena, who, journal)?;
    }
    log_outcome(story, arena, journal)
}

/// Place on the map as a place in the picture.
fn shown(arena: &Arena, [x, y, _]: [f64; 3]) -> [f32; 2] {
    // The only cast from the map to the picture.
    [x as f32, (f64::from(arena.size) - y) as f32]
}

fn log_map(arena: &Arena, journal: &mut LogWriter) -> Result<(), ViewError> {
    let size = arena.size;
    let side = f64::from(size);
    // Players move on the fine cells, which the refinement counts per cell.
    let fine = size * arena.refine;
    let (mut strips, mut colours) = (Vec::new(), Vec::new());
    for line in 0..=fine {
        let at = f64::from(line) / f64::from(arena.refine);
        let across = [[0.0, at, 0.0], [side, at, 0.0]];
        let along = [[at, 0.0, 0.0], [at, side, 0.0]];
        strips.extend([across, along].map(|ends| ends.map(|end| shown(arena, end))));
        let colour = match line % arena.refine {
            0 => CELL,
            _ => FINE_LINE,
        };
        // A row and a column per line.
        colours.extend([colour; 2]);
    }
    let lines = LineStrips2D::new(strips)
        .with_colors(colours)
        .with_radii([0.008])
        .with_draw_order(1.0);
    journal.always("map/cells", &[&lines])?;
    let corners = [
        [0.0, 0.0],
        [side, 0.0],
        [side, side],
        [0.0, side],
        [0.0, 0.0],
    ];
    let wall = corners.map(|[x, y]| shown(arena, [x, y, 0.0]));
    let walls = LineStrips2D::new([wall])
        .with_colors([WALL])
        .with_radii([0.04])
        .with_draw_order(2.0);
    journal.always("map/walls", &[&walls])
}

/// Logs a player, its trail so far and its last move, step by step.
///
/// Trail and move share an entity, and so do body and name, which gives fewer
/// and smaller chunks.
fn log_player(
    story: &ViewedEpisode<'_>,
    arena: &Arena,
    who: usize,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let name = &story.shown.stage.agents[who].name;
    let is_ego = who == story.ego();
    let colour = story.colour(who);
    // Trails on the same path lie side by side.
    let aside = if is_ego { 0.07 } else { -0.07 };
    let centres: Vec<[f32; 2]> = story
        .poses()
        .map(|frame| frame.placements[who].centre_m)
        .map(|centre| shown(arena, centre))
        .collect();
    let beside = |[x, y]: [f32; 2]| [x + aside, y + aside];
    for (sample, centre) in centres.iter().enumerate() {
        let at = story.instant(sample);
        // The whole way at every step, because the viewer shows only the newest strip.
        let places: Vec<[f32; 2]> = centres[..=sample].iter().copied().map(beside).collect();
        let trail = LineStrips2D::new([places])
            .with_radii([0.03])
            .with_colors([palette::dimmed(colour, 0.8)])
            .with_draw_order(10.0);
        // At the first step the arrow has no length.
        let from = centres[sample.saturating_sub(1)];
        let step = [centre[0] - from[0], centre[1] - from[1]];
        let arrow = Arrows2D::from_vectors([step])
            .with_origins([from])
            .with_radii([0.045])
            .with_colors([colour])
            .with_draw_order(20.0);
        let way: [&dyn AsComponents; 2] = [&trail, &arrow];
        journal.from(at, format!("map/trail/{name}").as_str(), &way)?;
        log_body(name, is_ego, *centre, colour, at, journal)?;
    }
    Ok(())
}

/// Logs the body: a square for the ego, a disc for the ado.
fn log_body(
    name: &str,
    is_ego: bool,
    centre: [f32; 2],
    colour: Rgb,
    at: SampleInstant,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let entity = format!("map/{name}");
    let label = Points2D::new([centre])
        .with_labels([name])
        .with_colors([colour])
        .with_show_labels(true);
    if !is_ego {
        let disc = label.with_radii([0.2]).with_draw_order(31.0);
        return journal.from(at, entity.as_str(), &[&disc]);
    }
    let square = Boxes2D::from_centers_and_half_sizes([centre], [[0.3, 0.3]])
        .with_colors([colour])
        .with_radii([0.06])
        .with_draw_order(30.0);
    let dot = label.with_radii([0.1]).with_draw_order(30.0);
    let body: [&dyn AsComponents; 2] = [&square, &dot];
    journal.from(at, entity.as_str(), &body)
}

/// Logs a frame around the cell of the decision, from then on.
fn log_outcome(
    story: &ViewedEpisode<'_>,
    arena: &Arena,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let Some(decided) = story.shown.decided else {
        return Ok(());
    };
    let Some(frame) = story.shown.at_sample(decided.sample) else {
        return Ok(());
    };
    let what = match story.episode.verdict {
        Verdict::Counterexample { .. } => "captured",
        // Invariant: in a world of cells every violation counts.
        Verdict::Uncounted { .. } => "uncounted",
        Verdict::Foul { .. } => "rule broken",
        Verdict::Held { .. } => "held",
        Verdict::Invalid => "fault",
    };
    let centre = frame.placements[story.ego()].centre_m;
    // Slightly smaller than a cell, so that the lines of the map stay visible.
    let frame = Boxes2D::from_centers_and_half_sizes([shown(arena, centre)], [[0.48, 0.48]])
        .with_colors([palette::CONTACT])
        .with_radii([0.05])
        .with_labels([format!("{what} at step {}", decided.sample)])
        .with_show_labels(true)
        .with_draw_order(40.0);
    journal.from(decided, "map/outcome", &[&frame])
}
