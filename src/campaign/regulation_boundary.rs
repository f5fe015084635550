//! Where a regulation asks the ego to hold: a formula on the first sample.

use crate::scene::Start;
use crate::stl::{Formula, Monitor, Scratch, Settings, StlError};
use crate::testbench::Aftermath;
use crate::world::Scenario;

/// The formula, bound to the signals of a world.
pub(super) fn monitor(world: &Scenario, formula: &str) -> Result<Monitor, StlError> {
    let parsed: Formula = formula.parse()?;
    parsed.bind_with(world.world().schema(), world.names(), &Settings::default())
}

/// Whether the formula holds at each of some starts.
pub(super) fn holds(world: &Scenario, monitor: &Monitor, starts: &[(Start, u64)]) -> Vec<bool> {
    let mut bench = world.bench();
    let mut scratch = Scratch::default();
    let one = |(start, noise): &(Start, u64)| {
        bench.begin(start, *noise, Aftermath::Skip);
        0.0 < monitor.robustness(bench.trace(), &mut scratch)
    };
    starts.iter().map(one).collect()
}
