//! Running robustness of ψ_ego and of every rule over time.

use re_chunk::TimeColumn;
use rerun::blueprint::components::Corner2D;

use crate::view::entity::path;
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, Views, height_of};
use crate::view::lines::{every_sample, log_lines, log_marks, roomy, span, union};
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
            "the instant of the verdict, as an upright line in all plots",
        ),
        ("/marks/contact", "and that of the contact"),
    ],
    log,
    views,
};

fn views(story: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let legend = Some(Corner2D::RightTop);
    let axis = roomy(robustness_span(story));
    let plot = layout.plot(story, "running robustness ρ", "/robustness", axis, legend)?;
    // Two curves besides the rules: ψ_ego and zero.
    Ok(vec![(plot, height_of(story, 2 + story.rules.len()))])
}

fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    log_robustness(story, &every_sample(story), journal)?;
    log_marks(story, journal)
}

fn robustness_span(story: &ViewedEpisode<'_>) -> (f64, f64) {
    let rho_max = story.scenario.rulebook().reward.rho_max();
    let all = std::iter::once(&story.spec).chain(&story.rules);
    let spans = all.map(|running| span(&finite(&running.values, rho_max)));
    // Zero is always visible, since its crossing is the violation.
    union(spans.chain([(0.0, 0.0)]))
}

/// Replaces infinite robustness (Boolean signals, empty windows) by ±ρ_max.
fn finite(values: &[f64], rho_max: f64) -> Vec<f64> {
    let clamp = |value: &f64| {
        if value.is_finite() {
            *value
        } else {
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
