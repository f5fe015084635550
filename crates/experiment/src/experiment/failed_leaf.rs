//! Part of the ego's specification that decides an episode.

use crate::stl::Interval;
use crate::testbench::Episode;
use crate::trace::Trace;
use crate::world::Scenario;

/// Returns the leaf of ψ_ego that decides an episode.
pub fn leaf(scenario: &Scenario, episode: &Episode) -> String {
    let explanation = scenario
        .rulebook()
        .spec
        .explain(&violated(scenario, episode));
    let leaf = explanation.leaf().map(|leaf| leaf.formula.clone());
    leaf.unwrap_or_default()
}

/// Returns the judged samples up to the first from which ψ_ego cannot be satisfied.
///
/// An episode that continues to the contact gets worse, so its worst sample is not the
/// time of the failure.
pub fn violated(scenario: &Scenario, episode: &Episode) -> Trace {
    let mut judged = episode.trace.clone();
    judged.truncate(episode.judged);
    let samples = scenario.world().clock().samples();
    let mut monitor = scenario.rulebook().spec.online_for(samples);
    let mut row = vec![0.0; judged.schema().len()];
    let lost = (0..judged.len()).find(|&sample| {
        judged.read_row(sample, &mut row);
        monitor.push(&row).is_ok_and(Interval::is_violated)
    });
    judged.truncate(lost.map_or(judged.len(), |sample| sample + 1));
    judged
}
