//! Storyboard of a world, with the names of its agents, lights and parameters.

use std::sync::Arc;

use super::language::{Language, formula};
use super::limits::{self, STL_BYTES};
use crate::ron_file::{Problems, ValuePath};
use crate::scene::drive::{Actions, DriveSpec, MotionPlan};
use crate::stl::Names;
use crate::story::check::{CheckedStoryboard, StoryFormula, StoryNames, check};
use crate::story::values::Storyboard;
use crate::world_file::{AdoFile, AgentFile, DriveFile, ScenarioFile};

/// Checks a storyboard against the agents of its world, at both ends of all parameters.
pub(super) fn read(
    problems: &mut Problems,
    path: &ValuePath,
    board: &Storyboard,
    spec: &DriveSpec,
) -> Option<Arc<CheckedStoryboard>> {
    let named = |is_chosen: &dyn Fn(usize) -> bool| -> Vec<String> {
        let agents = spec.agents.iter().enumerate();
        let chosen = agents.filter(|(i, _)| is_chosen(*i));
        chosen.map(|(_, agent)| agent.name.clone()).collect()
    };
    // Steps of a script would compete with the story for the same motion.
    let follows_story = |i: usize| matches!(spec.agents[i].plan(), Some(MotionPlan::Script(steps)) if steps.is_empty());
    let names = StoryNames {
        agents: named(&|_| true),
        actors: named(&follows_story),
        on_foot: named(&|i| spec.agents[i].body.is_on_foot()),
        lanes: (0..spec.agents.len())
            .map(|i| spec.road_of(i).lanes())
            .collect(),
        lights: spec.lights.iter().map(|it| it.name.clone()).collect(),
        roads: spec.roads.keys().cloned().collect(),
        parameters: spec.parameters.keys().cloned().collect(),
    };
    let ranges = spec.parameters.values();
    let (least, most): (Vec<f64>, Vec<f64>) = ranges.map(|it| (it.lo, it.hi)).unzip();
    let checked = check(problems, path, board, &names, &least)?;
    // All numbers between two that are in bounds are in bounds, too.
    if checked.has_parameters() {
        check(problems, path, board, &names, &most)?;
    }
    Some(Arc::new(checked))
}

/// Returns whether the actions of an ado add to those of the storyboard.
pub(super) fn deviates_from_story(ado: &AdoFile) -> bool {
    ado.base.is_none() && matches!(ado.actions, Actions::Deviate(_))
}

/// Reports agents that only the storyboard moves, but no action of it.
///
/// `entries` are the agents' positions in the file's list.
pub(super) fn check_actors(
    problems: &mut Problems,
    list: &ValuePath,
    file: &ScenarioFile,
    spec: &DriveSpec,
    entries: &[usize],
) {
    let Some(story) = &spec.story else {
        return;
    };
    for (agent, entry) in entries.iter().enumerate() {
        let (AgentFile::Vehicle { name, drive, .. } | AgentFile::Pedestrian { name, drive, .. }) =
            &file.agents[*entry]
        else {
            continue;
        };
        let follows_story = match drive {
            DriveFile::Story => true,
            DriveFile::Ado(ado) => deviates_from_story(ado),
            _ => false,
        };
        if follows_story && !story.moves(agent) {
            let what = format!("no action of the storyboard moves `{name}`");
            let help = "name it among the `actors` of a maneuver group".to_owned();
            let place = list.at(*entry).to("drive");
            problems.add(&place, what, "moved by the storyboard", Some(help));
        }
    }
}

/// Binds the formulas of its conditions, which must not look ahead.
pub(super) fn bind(
    problems: &mut Problems,
    language: &mut Language,
    names: &Names,
    spec: &DriveSpec,
) {
    for StoryFormula { path, text } in spec.story.iter().flat_map(|story| story.formulas()) {
        // The counts of a file leave out what a storyboard holds.
        limits::within(problems, path, text.len(), STL_BYTES);
        if let Some(formula) = formula(problems, path, text) {
            language.bind_past(problems, path, &formula, names);
        }
    }
}

/// Checks a storyboard at all points of a table.
pub(super) fn check_points(problems: &mut Problems, path: &ValuePath, spec: &DriveSpec) {
    let Some(story) = spec.story.as_ref().filter(|it| it.has_parameters()) else {
        return;
    };
    for (i, start) in spec.points.iter().enumerate() {
        if let Err(what) = story.at_values(&spec.parameters_of(start)) {
            let help = "change the row, or the number of the storyboard".to_owned();
            problems.add(&path.at(i), what, "wrong for the storyboard", Some(help));
            // One row is enough, as the rows of a table are usually wrong alike.
            return;
        }
    }
}
