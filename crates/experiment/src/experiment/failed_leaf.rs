//! Part of the ego's specification that decides an episode.

use super::running_robustness::RunningRobustness;
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
    let lost = RunningRobustness::of_spec(scenario, episode).lost;
    let mut judged = episode.trace.clone();
    // The robustness runs on over the aftermath, and only judged samples count.
    judged.truncate(lost.map_or(episode.judged, |sample| episode.judged.min(sample + 1)));
    judged
}
