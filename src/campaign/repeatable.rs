//! Whether an ego answers twice alike: asked before it is believed once.

use super::TestStarts;
use super::Watch;
use crate::scenario::Scenario;
use crate::testbench::{Aftermath, Constant};

/// When the commands of two equal episodes first differ, in s.
///
/// The first start that is not trivial is played twice with coasting ados and
/// the same seed. `None`: they are alike, the ego is one of ours, which always
/// answers alike, or there was nothing to compare.
pub fn answers_differ(scenario: &Scenario, starts: &TestStarts, watch: &Watch<'_>) -> Option<f64> {
    let spec = scenario.drive()?;
    spec.egos().find(|(_, drive)| drive.is_foreign())?;
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
    Some(sample as f64 * spec.clock.sample_s)
}
