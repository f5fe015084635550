//! Storyboard of a world, with the names of its agents, lights and parameters.

use std::sync::Arc;

use crate::ron_file::{Problems, ValuePath};
use crate::scene::drive::{DriveSpec, MotionPlan};
use crate::story::check::{CheckedStoryboard, StoryNames, check};
use crate::story::values::Storyboard;

/// Checks a storyboard against the agents of its world.
pub(super) fn read(
    problems: &mut Problems,
    path: &ValuePath,
    board: &Storyboard,
    spec: &DriveSpec,
) -> Option<Arc<CheckedStoryboard>> {
    let named = |is_chosen: &dyn Fn(usize) -> bool| -> Vec<&str> {
        let agents = spec.agents.iter().enumerate();
        let chosen = agents.filter(|(i, _)| is_chosen(*i));
        chosen.map(|(_, agent)| agent.name.as_str()).collect()
    };
    // Steps of a script would compete with the story for the same motion.
    let follows_story = |i: usize| matches!(spec.agents[i].plan(), Some(MotionPlan::Script(steps)) if steps.is_empty());
    let lights: Vec<&str> = spec.lights.iter().map(|it| it.name.as_str()).collect();
    let parameters: Vec<&str> = spec.parameters.keys().map(String::as_str).collect();
    let values: Vec<f64> = spec.parameters.values().map(|it| it.lo).collect();
    let roads: Vec<&str> = spec.roads.keys().map(String::as_str).collect();
    let lanes: Vec<usize> = (0..spec.agents.len())
        .map(|i| spec.road_of(i).lanes())
        .collect();
    let names = StoryNames {
        agents: &named(&|_| true),
        actors: &named(&follows_story),
        on_foot: &named(&|i| spec.agents[i].body.is_on_foot()),
        lanes: &lanes,
        lights: &lights,
        roads: &roads,
        parameters: &parameters,
        values: &values,
    };
    check(problems, path, board, names).map(Arc::new)
}
