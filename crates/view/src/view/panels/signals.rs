//! Signals by unit. The most informative groups have plots of their own.

use re_log_types::EntityPath;
use re_sdk_types::blueprint::components::ContainerKind;

use crate::road::Road;
use crate::view::entity::path;
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, BlueprintNode, PlotRange, Views, height_of};
use crate::view::lines::{Pen, every_sample, log_lines, roomy, span, union};
use crate::view::log_writer::LogWriter;
use crate::view::palette::{self, Rgb};
use crate::view::panel::{Column, Panel, PanelWorlds};
use crate::view::viewed_episode::ViewedEpisode;
use crate::world::DriveScenario;

pub(super) static PANEL: Panel = Panel {
    name: "signals",
    column: Column::Curves,
    shown: PanelWorlds::Everywhere,
    entities: &[(
        "/signals/<group>",
        "curves, grouped by unit, e.g. `/signals/speed`",
    )],
    log,
    views,
};

fn views(story: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let mut column = Vec::new();
    let mut filters = vec!["+ /signals/**".to_owned()];
    for plot in plots(story).iter().filter(|plot| plot.prominent) {
        let entity = plot.entity.to_string();
        // Excluded from the tab of the other signals, since each curve is
        // shown once.
        filters.push(format!("- {entity}/**"));
        let has_legend = plot.needs_legend();
        let lines = if has_legend { plot.names.len() } else { 0 };
        // Fixed, so that the axis does not change while the viewer plays.
        let (least, greatest) = roomy(plot.span);
        // In a stream the axis fits the curves of the current episode.
        let range = if layout.is_stream() {
            PlotRange::Fitted
        } else {
            PlotRange::Fixed(least, greatest)
        };
        let contents = format!("+ {entity}/**");
        let node = layout.plot(story, &plot.title, &[&contents], range, has_legend)?;
        column.push((node, height_of(lines)));
    }
    // Less informative signals are in a tab behind the last prominent plot.
    let others: Vec<&str> = filters.iter().map(String::as_str).collect();
    let rest = layout.plot(story, "other signals", &others, PlotRange::Fitted, true)?;
    let last = column.pop();
    let height = last.as_ref().map_or(1.0, |(_, height)| *height);
    let tabs: Vec<BlueprintNode> = last
        .into_iter()
        .map(|(node, _)| node)
        .chain([rest])
        .collect();
    let more = layout.container(ContainerKind::Tabs, "more", &tabs, &[])?;
    column.push((more, height));
    Ok(column)
}

fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let trace = &story.episode.trace;
    let every_sample = every_sample(story);
    for plot in plots(story) {
        let columns: Vec<&[f64]> = plot.signals.iter().map(|&i| trace.column(i)).collect();
        let rows = (0..trace.len()).flat_map(|i| columns.iter().map(move |column| column[i]));
        let pens: Vec<Pen<'_>> = plot
            .names
            .iter()
            .zip(&plot.colours)
            .map(|(name, rgb)| (name.as_str(), *rgb, 1.8))
            .collect();
        log_lines(
            plot.entity.clone(),
            &pens,
            every_sample.clone(),
            rows.collect(),
            journal,
        )?;
    }
    Ok(())
}

/// Curves with a common axis.
struct Plot {
    /// Entity of the curves.
    entity: EntityPath,
    /// Title with the unit.
    title: String,
    /// True for a plot of its own.
    prominent: bool,
    /// Indices of the signals in the schema.
    signals: Vec<usize>,
    names: Vec<String>,
    colours: Vec<Rgb>,
    nobodys: usize,
    /// Least and greatest value up to the verdict.
    span: (f64, f64),
}

impl Plot {
    fn empty(group: &str, title: &str) -> Plot {
        Plot {
            entity: path(["signals", group]),
            title: title.to_owned(),
            prominent: !matches!(group, "sideways" | "position" | "other"),
            signals: Vec::new(),
            names: Vec::new(),
            colours: Vec::new(),
            nobodys: 0,
            span: (0.0, 0.0),
        }
    }

    /// Returns true if colour and title do not identify every curve.
    fn needs_legend(&self) -> bool {
        self.nobodys > 0 && self.names.len() > 1
    }
}

/// Groups of signals, in the order of display.
const GROUPS: [(&str, &str); 8] = [
    ("chase", "Manhattan distance [cell]"),
    ("distance", "distance [m]"),
    ("lateral", "lateral [m]"),
    ("speed", "speed [m/s]"),
    ("acceleration", "acceleration [m/s²]"),
    // Beside the forward speed, an agent's colour would appear twice.
    ("sideways", "speed to the left [m/s]"),
    ("position", "position [m]"),
    ("other", "other signals"),
];

/// Group of a signal. `lanes` states the lane keeping of the agents.
fn group_of(name: &str, unit: &str, owner: Option<usize>, lanes: LaneKeepingState) -> &'static str {
    // The last part is the quantity, and those before it are names of agents.
    let field = name.rsplit('.').next().unwrap_or(name);
    match (unit, field) {
        // The first two rows take lateral motion out of the positions below.
        ("m", "y" | "lateral") if lanes == LaneKeepingState::Left => "lateral",
        ("m", "lateral") if lanes == LaneKeepingState::Bent => "lateral",
        ("m", "x" | "s" | "y" | "lateral") if owner.is_some() => "position",
        // A road is no distance of bodies, and 10 km of radius would flatten them.
        ("m", "radius") => "other",
        ("m", _) => "distance",
        ("cell", "d_man") => "chase",
        ("m/s", "lateral_speed") => "sideways",
        ("m/s", _) => "speed",
        ("m/s²", _) => "acceleration",
        _ => "other",
    }
}

/// Lane keeping of the agents, which decides on a plot of lateral motion.
///
/// On a bent road, y is no measure of it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum LaneKeepingState {
    Kept,
    Left,
    Bent,
}

impl LaneKeepingState {
    fn of(story: &ViewedEpisode<'_>) -> LaneKeepingState {
        let spec = story.scenario.drive().map(DriveScenario::spec);
        if spec.is_some_and(|spec| !matches!(spec.road, Road::Straight { .. })) {
            return LaneKeepingState::Bent;
        }
        let moves = (0..story.shown.stage.agents.len()).any(|who| {
            let lateral = story.poses().map(|frame| frame.placements[who].centre_m[1]);
            let (least, greatest) = span(&lateral.collect::<Vec<f64>>());
            // Half a metre is more than the sway of an agent within its lane.
            least + 0.5 < greatest
        });
        if moves {
            LaneKeepingState::Left
        } else {
            LaneKeepingState::Kept
        }
    }
}

/// Signals of an episode in plots, the prominent plots first.
fn plots(story: &ViewedEpisode<'_>) -> Vec<Plot> {
    let schema = story.episode.trace.schema();
    let lanes = LaneKeepingState::of(story);
    let mut plots: Vec<Plot> = GROUPS
        .map(|(group, title)| Plot::empty(group, title))
        .into();
    let mut nobodys = 0;
    for (i, signal) in schema.signals().iter().enumerate() {
        let owner = owner_of(story, &signal.name);
        let group = group_of(&signal.name, &signal.unit, owner, lanes);
        let Some(at) = GROUPS.iter().position(|(name, _)| *name == group) else {
            continue;
        };
        let plot = &mut plots[at];
        plot.colours.push(match owner {
            Some(who) => story.colour(who),
            // The counter runs over all plots, so a colour identifies one
            // quantity.
            None => palette::neutral(nobodys),
        });
        nobodys += usize::from(owner.is_none());
        plot.nobodys += usize::from(owner.is_none());
        plot.signals.push(i);
        plot.names.push(signal.name.clone());
    }
    // After the assignment, whose positions are those of all groups.
    plots.retain(|plot| !plot.signals.is_empty());
    for plot in &mut plots {
        // A plot of one curve names it in its title and needs no legend.
        if let ([name], Some((group, unit))) = (&plot.names[..], plot.title.split_once(" [")) {
            plot.title = format!("{group}: {name} [{unit}");
        }
        // An aftermath may have values that would flatten the rest.
        let plotted = ..story.plotted_samples();
        let column = |i: &usize| &story.episode.trace.column(*i)[plotted];
        let columns = plot.signals.iter().map(column);
        plot.span = union(columns.map(span));
    }
    plots
}

/// Agent that owns a signal.
fn owner_of(story: &ViewedEpisode<'_>, signal: &str) -> Option<usize> {
    let (name, field) = signal.split_once('.')?;
    let owner = story
        .shown
        .stage
        .agents
        .iter()
        .position(|agent| agent.name == name)?;
    // A name of two agents, such as `ego.ado.gap`, belongs to neither.
    (!field.contains('.')).then_some(owner)
}
