//! Chosen actions of the ados and phases of lights, as coloured lanes.

use re_sdk_types::archetypes::StateConfiguration;

use crate::experiment::action_runs;
use crate::scene::drive::{Actions, Maneuver, PhaseAction};
use crate::view::entity::path;
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, Views};
use crate::view::lines::{colour, log_states};
use crate::view::log_writer::LogWriter;
use crate::view::palette::{self, Rgb};
use crate::view::panel::{Column, Panel, PanelWorlds};
use crate::view::viewed_episode::ViewedEpisode;
use crate::view::{lights, sight};
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
        ("/sight/<agent>", "when the ego sees it, as coloured lanes"),
    ],
    log,
    views,
};

fn views(story: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let mut title = "actions of the ado".to_owned();
    if !story.shown.stage.lights.is_empty() {
        title += ", lights";
    }
    if sight::lanes(story) > 0 {
        title += ", sight of the ego";
    }
    let contents = ["$origin/**", "+ /lights/**", "+ /sight/**"];
    let lanes = layout.view("StateTimeline", &title, "/actions", &contents)?;
    Ok(vec![(lanes, lanes_share(story))])
}

/// Share of the column for the lanes, which need room for each agent and light.
fn lanes_share(story: &ViewedEpisode<'_>) -> f32 {
    let ados = match story.scenario.kind() {
        ScenarioKind::Drive(driving) => driving.spec().action_sets().count(),
        ScenarioKind::Grid(_) => 1,
    };
    let lanes = ados + story.shown.stage.lights.len() + sight::lanes(story);
    0.5 + 0.5 * lanes as f32
}

fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    lights::log_phases(story, journal)?;
    sight::log_lanes(story, journal)?;
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
            let colours = labels_colours(&labels, spaces.neutral);
            return log_choice(story, "ado", joint, &labels, &colours, journal);
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
        let colours = match set {
            Actions::Turns(_) => labels_colours(&labels, neutral),
            _ => (0..set.len())
                .map(|action| colour_of(set, action))
                .collect(),
        };
        log_choice(story, agent, &own, &labels, &colours, journal)?;
    }
    Ok(())
}

/// Colours of actions that have no direction: grey for the neutral one.
fn labels_colours(labels: &[String], neutral: usize) -> Vec<Rgb> {
    let colour = |action: usize| {
        if action == neutral {
            palette::IDLE
        } else {
            palette::dimmed(palette::neutral(action), 0.75)
        }
    };
    (0..labels.len()).map(colour).collect()
}

/// Colour of an action by its effect.
///
/// Braking is red and accelerating green, lighter to the left and darker to the right.
/// Without either, moving to the left is blue and to the right violet. No effect is grey.
fn colour_of(set: &Actions, action: usize) -> Rgb {
    let (faster, left) = effect(set.choice(action));
    // Of the set, so that colours of one world are comparable.
    let strongest = (0..set.len())
        .map(|action| effect(set.choice(action)).0.abs())
        .fold(0.0, f64::max);
    if faster == 0.0 {
        return match left {
            0.0 => palette::IDLE,
            left if left > 0.0 => palette::LEFTWARD,
            _ => palette::RIGHTWARD,
        };
    }
    let full = if faster < 0.0 {
        palette::BRAKING
    } else {
        palette::ACCELERATING
    };
    // A weak action still has most of its colour.
    let share = 0.6 + 0.4 * (faster.abs() / strongest) as f32;
    let colour = palette::mixed(palette::IDLE, full, share);
    match left {
        0.0 => colour,
        left if left > 0.0 => palette::brightened(colour, 0.25),
        _ => palette::dimmed(colour, 0.7),
    }
}

/// Effect of an action: how much faster it makes an agent, and how far it moves it to the left.
///
/// Better weather lets an ego drive faster. A walk across the road only moves.
fn effect(choice: Maneuver) -> (f64, f64) {
    match choice {
        Maneuver::Drive {
            accel_mps2,
            lateral_mps,
        } => (accel_mps2, lateral_mps),
        Maneuver::Walk {
            along_mps,
            left_mps,
        } => match left_mps {
            0.0 => (along_mps, 0.0),
            // A person who crosses the road is a matter of direction, even if
            // it moves along it, too.
            left_mps => (0.0, left_mps),
        },
        Maneuver::Turn(PhaseAction::Hold) => (0.0, 0.0),
        Maneuver::Turn(PhaseAction::Advance) => (0.0, 1.0),
        Maneuver::Change(rates) => (rates.mildness(), 0.0),
        Maneuver::Bend { curvature_per_m } => (0.0, curvature_per_m),
    }
}

/// Logs the chosen actions of one ado, decision by decision.
fn log_choice(
    story: &ViewedEpisode<'_>,
    name: &str,
    own: &[usize],
    labels: &[String],
    colours: &[Rgb],
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let entity = path(["actions", name]);
    let lanes = StateConfiguration::new()
        .with_values(labels.iter().map(String::as_str))
        .with_labels(labels.iter().map(String::as_str))
        .with_colors(colours.iter().copied().map(colour));
    journal.always(entity.clone(), &[&lanes])?;
    let runs = action_runs(own);
    let instants = runs.iter().map(|run| {
        let sample = story.decision_sample(run.from);
        (sample, story.time_s(sample))
    });
    let states = runs.iter().map(|run| labels[run.action].as_str());
    log_states(entity, instants, states, story, journal)
}
