//! Check that an ego is deterministic.

use super::ego_under_test::EgoUnderTest;
use super::progress::Watch;
use super::test_starts::TestStarts;
use crate::testbench::{Aftermath, Constant};
use crate::world::Scenario;

/// Returns the time at which the commands of two equal episodes first differ, in s.
///
/// The first start that is not trivial is played twice with coasting ados and the same
/// seed. `None`: the episodes are equal, the ego is a stock controller, which is always
/// deterministic, or there was no start to compare.
pub(crate) fn first_divergence(
    scenario: &Scenario,
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Option<f64> {
    if !scenario.ego()?.is_foreign() {
        return None;
    }
    let index = starts.trivial.iter().position(|trivial| !trivial)?;
    let (start, noise) = &starts.starts[index];
    let mut bench = scenario.bench();
    let mut commands = || {
        let mut coasting = Constant(bench.spaces().neutral);
        let from = (start, *noise);
        let played = watch.play(&mut bench, from, index, &mut coasting, Aftermath::Skip);
        played.fault.is_none().then_some(played.commands)
    };
    let (first, again) = (commands()?, commands()?);
    let sample = first.iter().zip(&again).position(|(a, b)| a != b)?;
    Some(sample as f64 * bench.clock().sample_s)
}

/// Reports an ego that is not deterministic, with the fix.
pub fn note_if_unrepeatable(ego: &EgoUnderTest, starts: &TestStarts, watch: &Watch<'_>) {
    if 1 < ego.scenario().repeats.runs || watch.stopped() {
        return;
    }
    if let Some(at_s) = first_divergence(ego.scenario(), starts, watch) {
        watch.note(&format!(
            "`{}` does not answer twice alike: with the same seed its commands differ from \
             {at_s:.2} s on; give the world `repeats: 5`",
            ego.name()
        ));
    }
}
