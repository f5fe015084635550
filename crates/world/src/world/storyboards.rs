//! Storyboard of a world, with the names of its agents, lights and parameters.

use std::sync::Arc;

use crate::ron_file::{Problems, ValuePath};
use crate::scene::drive::{DriveSpec, MotionPlan};
use crate::story::check::{CheckedStoryboard, StoryNames, check};
use crate::story::values::Storyboard;

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

/// Checks a storyboard at all points of a table.
pub(super) fn check_points(problems: &mut Problems, path: &ValuePath, spec: &DriveSpec) {
    let Some(story) = spec.story.as_ref().filter(|it| it.has_parameters()) else {
        return;
    };
    for (i, start) in spec.points.iter().enumerate() {
        if let Err(what) = story.at_values(&spec.parameters_of(start)) {
            let help = "change the row, or the number of the storyboard".to_owned();
            problems.add(&path.at(i), what, "wrong for the storyboard", Some(help));
            return;
        }
    }
}
