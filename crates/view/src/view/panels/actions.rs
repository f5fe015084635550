//! Chosen actions of the ados and phases of lights, as coloured lanes.

use rerun::archetypes::{StateChange, StateConfiguration};

use crate::experiment::action_runs;
use crate::view::entity::path;
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, Views};
use crate::view::lights;
use crate::view::lines::colour;
use crate::view::log_writer::{LogWriter, clock};
use crate::view::panel::{Column, Panel, PanelWorlds};
use crate::view::viewed_episode::ViewedEpisode;
use crate::world::ScenarioKind;

pub(super) static PANEL: Panel = Panel {
    name: "actions",
    column: Column::Space,
    shown: PanelWorlds::Everywhere,
    entities: &[
        ("/actions/<ado>", "what the ado chose, decision by decision"),
        (
            "/lights/<light>",
            "the phases of a light, as coloured lanes",
        ),
    ],
    log,
    views,
};

fn views(story: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let title = if story.shown.stage.lights.is_empty() {
        "actions of the ado"
    } else {
        "actions of the ado, and lights"
    };
    let contents = ["$origin/**", "+ /lights/**"];
    let lanes = layout.view("StateTimeline", title, "/actions", &contents)?;
    Ok(vec![(lanes, lanes_share(story))])
}

/// Share of the column for the lanes, which need room for each agent and light.
fn lanes_share(story: &ViewedEpisode<'_>) -> f32 {
    let ados = match story.scenario.kind() {
        ScenarioKind::Drive(driving) => driving.spec().action_sets().count(),
        ScenarioKind::Grid(_) => 1,
    };
    let lanes = ados + story.shown.stage.lights.len();
    0.5 + 0.5 * lanes as f32
}

fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    lights::log_phases(story, journal)?;
    log_actions(story, journal)
}

/// Logs the chosen actions of each ado as coloured lanes.
fn log_actions(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let joint = &story.episode.actions;
    let driving = match story.scenario.kind() {
        ScenarioKind::Drive(driving) => driving,
        ScenarioKind::Grid(grid) => {
            let spaces = grid.world().spaces();
            let labels: Vec<String> = (0..spaces.actions)
                .map(|action| grid.action_label(action))
                .collect();
            return log_choice(story, "ado", joint, &labels, spaces.neutral, journal);
        }
    };
    let mut stride = 1;
    for (agent, set, neutral) in driving.spec().action_sets() {
        // In a joint action, the first ado's action varies fastest.
        let own: Vec<usize> = joint
            .iter()
            .map(|joint| joint / stride % set.len())
            .collect();
        stride *= set.len();
        let labels: Vec<String> = (0..set.len()).map(|action| set.label(action)).collect();
        log_choice(story, agent, &own, &labels, neutral, journal)?;
    }
    Ok(())
}

/// Logs the chosen actions of one ado, decision by decision.
fn log_choice(
    story: &ViewedEpisode<'_>,
    name: &str,
    own: &[usize],
    labels: &[String],
    neutral: usize,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let entity = path(["actions", name]);
    // Among accelerations, those below the neutral action brake.
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
        .with_state(runs.iter().map(|run| labels[run.action].as_str()))
        .columns_of_unit_batches();
    let instants = runs.iter().map(|run| {
        let sample = story.decision_sample(run.from);
        (sample, story.time_s(sample))
    });
    journal.columns(entity, clock(instants), states)
}
