//! Running robustness of ψ_ego and of every rule over time.

use re_chunk::TimeColumn;
use re_sdk_types::blueprint::components::ContainerKind;

use crate::rulebook::Verdict;
use crate::view::entity::path;
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, PlotRange, Views, height_of};
use crate::view::lines::{MARKS, every_sample, log_lines, log_marks, marks};
use crate::view::log_writer::{LogWriter, clock};
use crate::view::palette;
use crate::view::panel::{Column, Panel, PanelWorlds};
use crate::view::viewed_episode::ViewedEpisode;

pub(super) static PANEL: Panel = Panel {
    name: "running robustness",
    column: Column::Curves,
    shown: PanelWorlds::Everywhere,
    entities: &[
        ("/robustness/ego_spec", "running robustness of ψ_ego"),
        ("/robustness/rule/<name>", "and of each rule"),
        (
            "/robustness/zero",
            "the line that it crosses when a formula is lost",
        ),
        (
            "/marks/verdict",
            "the instant of the verdict, as an upright line",
        ),
        ("/marks/contact", "and that of the contact"),
    ],
    log,
    views,
};

/// Time in seconds whose margins fill the plot: the last ones before the least margin.
const NEAR_S: f64 = 2.0;

/// Robustness near zero, and in a tab behind it its whole range.
fn views(story: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let (all, marked) = ("+ /robustness/**", format!("+ {MARKS}/**"));
    let (least, greatest) = near_zero(story);
    let near = layout.plot(
        story,
        "running robustness ρ near 0",
        &[all, &marked],
        PlotRange::Fixed(least, greatest),
        true,
    )?;
    // Marks reach beyond every range.
    let whole = layout.plot(story, "whole range", &[all], PlotRange::Fitted, true)?;
    let tabs = layout.container(ContainerKind::Tabs, "robustness", &[near, whole], &[])?;
    // Two curves besides the rules: ψ_ego and zero.
    let marks = if layout.is_stream() { 0 } else { marks(story) };
    Ok(vec![(tabs, height_of(2 + story.rules.len() + marks))])
}

fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    log_robustness(story, &every_sample(story), journal)?;
    log_marks(story, journal)
}

/// Range of values around zero in which the deciding margin ends.
///
/// Its top is the greatest value of the margin in the last [`NEAR_S`] before it reaches its
/// last one, so that margins of another size do not flatten the end. The curves have all
/// values.
fn near_zero(story: &ViewedEpisode<'_>) -> (f64, f64) {
    let deciding = match story.episode.verdict {
        Verdict::Foul { rule, .. } => story.rules.get(rule).unwrap_or(&story.spec),
        _ => &story.spec,
    };
    let rho_max = story.scenario.rulebook().reward.rho_max();
    let values = finite(&deciding.values, rho_max);
    let judged = &values[..story.plotted_samples().min(values.len())];
    let last = judged.last().copied().unwrap_or(0.0);
    // Exactly equal, because a running minimum repeats its value bit by bit.
    let reached = judged.iter().position(|value| *value == last).unwrap_or(0);
    let before = (NEAR_S / story.episode.trace.dt_s()).round() as usize;
    let near = &judged[reached.saturating_sub(before)..judged.len().min(reached + 1)];
    // The limit stands for no value, and would flatten the end as well.
    let informative = near.iter().copied().filter(|value| value.abs() < rho_max);
    // A margin that hardly changes still has some room around it.
    let top = informative.fold((2.0 * last.abs()).max(1e-3), f64::max);
    // Below zero there is always some room, in which a violation would be
    // seen.
    ((-0.25 * top).min(1.2 * last), 1.05 * top)
}

/// Replaces infinite robustness (Boolean signals, empty windows) by ±ρ_max.
fn finite(values: &[f64], rho_max: f64) -> Vec<f64> {
    let clamp = |value: &f64| {
        if value.is_finite() {
            *value
        } else {
            // A plot cannot draw an infinite value, and would leave a gap.
            value.clamp(-rho_max, rho_max)
        }
    };
    values.iter().map(clamp).collect()
}

fn log_robustness(
    story: &ViewedEpisode<'_>,
    every_sample: &[TimeColumn; 2],
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let rho_max = story.scenario.rulebook().reward.rho_max();
    let spec = (
        path(["robustness", "ego_spec"]),
        &story.spec,
        ([255; 3], 3.0),
    );
    let rules = story.rules.iter().enumerate().map(|(i, running)| {
        let entity = path(["robustness", "rule", &running.name]);
        (entity, running, (palette::of_rule(i), 1.6))
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
