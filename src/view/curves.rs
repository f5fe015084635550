//! Everything over time: signals by unit, running robustness, actions.

use rerun::{Color, EntityPath, Scalars, SeriesLines, StateChange, StateConfiguration, TimeColumn};

use super::journal::{Journal, clock};
use super::palette::{self, Rgb};
use super::story::Story;
use super::words::action_runs;
use super::{ViewError, path};
use crate::scene::drive::Road;

/// Curves that share an axis.
pub(super) struct Plot {
    /// The entity that holds them.
    pub entity: EntityPath,
    /// Title with unit.
    pub title: String,
    /// Whether it is worth a place of its own.
    pub prominent: bool,
    /// Positions of the signals in the schema.
    signals: Vec<usize>,
    names: Vec<String>,
    colours: Vec<Rgb>,
    nobodys: usize,
    /// The least and the greatest value.
    pub span: (f64, f64),
}

impl Plot {
    fn empty((group, title): (&str, &str)) -> Plot {
        Plot {
            entity: path(["signals", group]),
            title: title.to_owned(),
            prominent: !matches!(group, "position" | "other"),
            signals: Vec::new(),
            names: Vec::new(),
            colours: Vec::new(),
            nobodys: 0,
            span: (0.0, 0.0),
        }
    }

    /// Whether colour and title do not name every curve.
    pub fn needs_legend(&self) -> bool {
        0 < self.nobodys && 1 < self.names.len()
    }
}

/// The groups of signals, in the order in which they are shown.
const GROUPS: [(&str, &str); 7] = [
    ("chase", "Manhattan distance [cell]"),
    ("distance", "distance [m]"),
    ("lateral", "lateral [m]"),
    ("speed", "speed [m/s]"),
    ("acceleration", "acceleration [m/s²]"),
    ("position", "position [m]"),
    ("other", "other signals"),
];

/// The group of a signal; `lanes` says whether anybody leaves theirs.
fn group_of(name: &str, unit: &str, owner: Option<usize>, lanes: Lanes) -> &'static str {
    let field = name.rsplit('.').next().unwrap_or(name);
    match (unit, field) {
        ("m", "y" | "lateral") if lanes == Lanes::Left => "lateral",
        ("m", "lateral") if lanes == Lanes::Bent => "lateral",
        ("m", "x" | "s" | "y" | "lateral") if owner.is_some() => "position",
        ("m", _) => "distance",
        ("cell", "d_man") => "chase",
        ("m/s", _) => "speed",
        ("m/s²", _) => "acceleration",
        _ => "other",
    }
}

/// Lanes are left or they are not: only then lateral motion earns a plot. On a
/// road that bends, y says nothing about it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lanes {
    Kept,
    Left,
    Bent,
}

impl Lanes {
    fn of(story: &Story<'_>) -> Lanes {
        let road = story.scenario.drive().map(|spec| &spec.road);
        if road.is_some_and(|road| !matches!(road, Road::Straight { .. })) {
            return Lanes::Bent;
        }
        let moves = (0..story.stage.cast.len()).any(|who| {
            let lateral = story
                .frames
                .iter()
                .map(|frame| frame.placements[who].centre_m[1]);
            let (least, greatest) = span(&lateral.collect::<Vec<f64>>());
            least + 0.5 < greatest
        });
        if moves { Lanes::Left } else { Lanes::Kept }
    }
}

/// The signals of an episode, sorted into plots, the prominent ones first.
pub(super) fn plots(story: &Story<'_>) -> Vec<Plot> {
    let schema = story.episode.trace.schema();
    let lanes = Lanes::of(story);
    let mut plots: Vec<Plot> = GROUPS.map(Plot::empty).into();
    for (i, signal) in schema.signals().iter().enumerate() {
        let owner = owner_of(story, &signal.name);
        let group = group_of(&signal.name, &signal.unit, owner, lanes);
        let Some(at) = GROUPS.iter().position(|(name, _)| *name == group) else {
            continue;
        };
        let plot = &mut plots[at];
        plot.colours.push(match owner {
            Some(who) => story.colour(who),
            None => palette::neutral(plot.nobodys),
        });
        plot.nobodys += usize::from(owner.is_none());
        plot.signals.push(i);
        plot.names.push(signal.name.clone());
    }
    plots.retain(|plot| !plot.signals.is_empty());
    for plot in &mut plots {
        if let ([name], Some((group, unit))) = (&plot.names[..], plot.title.split_once(" [")) {
            plot.title = format!("{group}: {name} [{unit}");
        }
        let columns = plot.signals.iter().map(|&i| story.episode.trace.column(i));
        plot.span = union(columns.map(span));
    }
    plots
}

/// The agent whose own quantity a signal is.
fn owner_of(story: &Story<'_>, signal: &str) -> Option<usize> {
    let (name, field) = signal.split_once('.')?;
    let owner = story.stage.cast.iter().position(|cast| cast.name == name)?;
    (!field.contains('.')).then_some(owner)
}

/// Logs every curve.
pub(super) fn log(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let trace = &story.episode.trace;
    let every_sample: [TimeColumn; 2] =
        clock((0..story.samples()).map(|sample| (sample, story.time_s(sample))));
    for plot in plots(story) {
        let columns: Vec<&[f64]> = plot.signals.iter().map(|&i| trace.column(i)).collect();
        let rows = (0..trace.len()).flat_map(|i| columns.iter().map(move |column| column[i]));
        let pens = plot.names.iter().zip(&plot.colours);
        let pens: Vec<Pen<'_>> = pens.map(|(name, rgb)| (name.as_str(), *rgb, 1.8)).collect();
        log_lines(
            plot.entity.clone(),
            &pens,
            every_sample.clone(),
            rows.collect(),
            journal,
        )?;
    }
    log_robustness(story, &every_sample, journal)?;
    log_marks(story, journal)?;
    log_actions(story, journal)
}

/// The y axis of the robustness plot: zero and what is near it are visible.
pub(super) fn robustness_axis(story: &Story<'_>) -> (f64, f64) {
    roomy(robustness_span(story))
}

/// An axis with some room above and, for labels, below.
pub(super) fn roomy((least, greatest): (f64, f64)) -> (f64, f64) {
    let height = (greatest - least).max(1.0);
    (least - 0.12 * height, greatest + 0.05 * height)
}

fn robustness_span(story: &Story<'_>) -> (f64, f64) {
    let rho_max = story.scenario.rulebook().reward.rho_max();
    let all = std::iter::once(&story.spec).chain(&story.rules);
    let spans = all.map(|running| span(&finite(&running.values, rho_max)));
    union(spans.chain([(0.0, 0.0)]))
}

/// Infinite robustness (Boolean signals, empty windows) is drawn at ±ρ_max.
fn finite(values: &[f64], rho_max: f64) -> Vec<f64> {
    let clamp = |value: &f64| match value.is_finite() {
        true => *value,
        false => value.clamp(-rho_max, rho_max),
    };
    values.iter().map(clamp).collect()
}

fn log_robustness(
    story: &Story<'_>,
    every_sample: &[TimeColumn; 2],
    journal: &mut Journal,
) -> Result<(), ViewError> {
    let rho_max = story.scenario.rulebook().reward.rho_max();
    let spec = (
        path(["robustness", "ego_spec"]),
        &story.spec,
        ([255; 3], 3.0),
    );
    let rules = story.rules.iter().enumerate().map(|(i, running)| {
        let entity = path(["robustness", "rule", &running.name]);
        (entity, running, (palette::neutral(i), 1.6))
    });
    for (entity, running, (rgb, width)) in std::iter::once(spec).chain(rules) {
        let pen = (running.name.as_str(), rgb, width);
        let values = finite(&running.values, rho_max);
        log_lines(entity, &[pen], every_sample.clone(), values, journal)?;
    }
    let last = story.samples().saturating_sub(1);
    let ends = clock([(0, 0.0), (last, story.end_s())]);
    let pen = ("0", palette::ZERO, 1.0);
    log_lines(
        path(["robustness", "zero"]),
        &[pen],
        ends,
        vec![0.0; 2],
        journal,
    )?;
    Ok(())
}

/// The entity of the marks that all plots show.
pub(super) const MARKS: &str = "/marks";
/// How far a mark reaches up and down: beyond the axis of any plot.
const MARK_REACH: f64 = 2e3;

/// Whether there is an instant to be marked.
pub(super) fn has_marks(story: &Story<'_>) -> bool {
    story.decided.is_some() || story.episode.contact.is_some()
}

/// Upright lines at the instants of the verdict and of the contact.
fn log_marks(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let mut upright = |what: &str, (sample, time_s): (usize, f64), name: &str, rgb: Rgb| {
        // One curve cannot have two values at one instant.
        let instants = clock([(sample, time_s), (sample, time_s + 1e-6)]);
        let entity = path(["marks", what]);
        let ends = vec![-MARK_REACH, MARK_REACH];
        log_lines(entity, &[(name, rgb, 1.2)], instants, ends, journal)
    };
    if let Some(sample) = story.decided {
        let time_s = story.time_s(sample);
        let name = format!("{} {time_s:.2} s", story.episode.verdict.word());
        upright("verdict", (sample, time_s), &name, palette::DECIDED)?;
    }
    if let Some(touch) = &story.episode.contact {
        let sample = (touch.time_s / story.episode.trace.dt_s()).ceil() as usize;
        let name = format!("contact {:.2} s", touch.time_s);
        upright("contact", (sample, touch.time_s), &name, palette::CONTACT)?;
    }
    Ok(())
}

/// How a line is drawn: name, colour, width.
type Pen<'a> = (&'a str, Rgb, f32);

/// Lines of one entity: `values` has one per pen for every instant.
fn log_lines(
    entity: EntityPath,
    pens: &[Pen<'_>],
    instants: [TimeColumn; 2],
    values: Vec<f64>,
    journal: &mut Journal,
) -> Result<(), ViewError> {
    let rows = values.len() / pens.len();
    let style = SeriesLines::new()
        .with_names(pens.iter().map(|(name, _, _)| *name))
        .with_colors(pens.iter().map(|(_, rgb, _)| colour(*rgb)))
        .with_widths(pens.iter().map(|(_, _, width)| *width));
    journal.always(entity.clone(), &[&style])?;
    let scalars = Scalars::new(values).columns(vec![pens.len(); rows]);
    journal.columns(entity, instants, scalars)
}

/// What each ado chose, as coloured lanes.
fn log_actions(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let joint = &story.episode.actions;
    if story.scenario.grid().is_some() {
        let spaces = story.scenario.world().spaces();
        let labels = 0..spaces.actions;
        let labels = labels.map(|action| story.scenario.action_label(action));
        return log_choice(
            story,
            "ado",
            joint,
            &labels.collect::<Vec<_>>(),
            spaces.neutral,
            journal,
        );
    }
    let Some(spec) = story.scenario.drive() else {
        return Ok(());
    };
    let mut stride = 1;
    for (agent, set, neutral) in spec.action_sets() {
        let own = joint.iter().map(|joint| joint / stride % set.len());
        let own: Vec<usize> = own.collect();
        stride *= set.len();
        let labels: Vec<String> = (0..set.len()).map(|action| set.label(action)).collect();
        log_choice(story, agent, &own, &labels, neutral, journal)?;
    }
    Ok(())
}

/// What one ado chose, decision by decision.
fn log_choice(
    story: &Story<'_>,
    name: &str,
    own: &[usize],
    labels: &[String],
    neutral: usize,
    journal: &mut Journal,
) -> Result<(), ViewError> {
    let entity = path(["actions", name]);
    let colours = (0..labels.len()).map(|action| match action.cmp(&neutral) {
        std::cmp::Ordering::Less => colour([192, 72, 60]),
        std::cmp::Ordering::Equal => colour([96, 104, 116]),
        std::cmp::Ordering::Greater => colour([66, 148, 92]),
    });
    let lanes = StateConfiguration::new()
        .with_values(labels.iter().map(String::as_str))
        .with_labels(labels.iter().map(String::as_str))
        .with_colors(colours);
    journal.always(entity.clone(), &[&lanes])?;
    let runs = action_runs(own);
    let states = StateChange::update_fields()
        .with_state(runs.iter().map(|(_, _, action)| labels[*action].as_str()))
        .columns_of_unit_batches();
    let instants = runs.iter().map(|(from, _, _)| {
        let sample = story.decision_sample(*from);
        (sample, story.time_s(sample))
    });
    journal.columns(entity, clock(instants), states)
}

fn colour([r, g, b]: Rgb) -> Color {
    Color::from_rgb(r, g, b)
}

/// The least and the greatest of some finite numbers.
fn span(values: &[f64]) -> (f64, f64) {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (least, greatest)
}

fn union(spans: impl IntoIterator<Item = (f64, f64)>) -> (f64, f64) {
    let grow = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
    spans
        .into_iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), grow)
}
