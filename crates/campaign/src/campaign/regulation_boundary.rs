//! Region in which a regulation requires the ego to hold: a formula on the first sample.

use crate::scene::Start;
use crate::stl::{Formula, Monitor, Scratch, Settings, StlError};
use crate::testbench::Aftermath;
use crate::world::Scenario;

/// Binds the formula to the signals of a world.
pub(super) fn monitor(world: &Scenario, formula: &str) -> Result<Monitor, StlError> {
    let parsed: Formula = formula.parse()?;
    parsed.bind_with(world.world().schema(), world.names(), &Settings::default())
}

/// Returns whether the formula holds at each of the starts.
pub(super) fn holds(world: &Scenario, monitor: &Monitor, starts: &[(Start, u64)]) -> Vec<bool> {
    let mut bench = world.bench();
    let mut scratch = Scratch::default();
    let one = |(start, noise): &(Start, u64)| {
        // Only the first sample is needed, so the episode is begun and not played.
        bench.begin(start, *noise, Aftermath::Skip);
        // A robustness of 0 is undecided in STL, so the border itself is outside.
        monitor.robustness(bench.trace(), &mut scratch) > 0.0
    };
    starts.iter().map(one).collect()
}
