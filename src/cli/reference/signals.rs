//! Signals of both kinds of worlds, from the lists that publish them.

use super::page::{ReferencePage, ReferenceTable};
use crate::cli::failure::Failure;
use crate::scene::drive::signal_list;
use crate::scene::{Availability, World};
use crate::trace::Signal;
use crate::world::Scenario;

/// Shipped world whose list has all signals of grids.
const GRID: &str = "grid";

/// Units with the range of a derived signal that states none.
const RANGES: [[&str; 2]; 5] = [
    ["m", "0 to 100"],
    ["m/s", "0 to 30"],
    ["m/s²", "−5 to 5"],
    ["s", "0 to 20"],
    ["any other", "−1 to 1"],
];

/// Parts of a world with the signals of them that ados observe by default.
const OBSERVED: [[&str; 2]; 9] = [
    ["obstacle or standing vehicle B", "`ego.B.headway`"],
    ["any other road user B", "`ego.B.headway` and `B.speed`"],
    [
        "the same, if the road has several lanes, or B is on foot, on another road or not heading \
         along the road",
        "`ego.B.lateral` and `B.lateral_speed`, too",
    ],
    ["ado B with an actuator lag", "`B.accel`, too"],
    ["ego", "`ego.speed` and `ego.accel`"],
    ["light L", "`L.phase`, `L.phase_time` and `ego.L.line`"],
    [
        "weather W",
        "`W.friction`, `W.visibility` and `W.noise`, if they have bounds",
    ],
    [
        "road R that an ado lays",
        "`R.curvature`, `R.curvature_change`, `R.ahead`, `R.turned` and `ego.lateral`",
    ],
    ["episode", "`time_left`"],
];

pub(super) fn page() -> Result<ReferencePage, Failure> {
    let about = "\
A signal is a named quantity, with a value per sample. \
`brakecheck check WORLD --details` lists the signals of your world.

Replace A and B by the names of two agents. L is a light, W the weather, R a road that an \
ado lays, and P a parameter of the starts. \
Traces have a signal on demand only if a formula or an ado mentions it. \
`planned` needs a plan, `conflict` and `priority` need different roads, and W has signals of \
quantities with bounds only. \
A pedestrian has the heading in which it faces.";
    let listed = signal_list().into_iter();
    let driving = listed.map(|(signal, held)| (signal, held == Availability::Recorded));
    let mut tables = vec![table("Driving worlds", driving)];
    // Signals of grids depend on the spec, so a world with all of them stands for the
    // list.
    let grid = Scenario::shipped(GRID).transpose()?;
    if let Some(World::Grid(grid)) = grid.as_ref().map(Scenario::world) {
        let signals = grid.spec().catalogue().into_iter();
        tables.push(table(
            "Grid worlds",
            signals.map(|it| (it.signal, it.always)),
        ));
    }
    tables.extend([derived(), observed()]);
    Ok(ReferencePage {
        title: "Signals",
        about: about.to_owned(),
        tables,
    })
}

fn table(title: &str, signals: impl IntoIterator<Item = (Signal, bool)>) -> ReferenceTable {
    let rows = signals.into_iter().map(|(signal, is_recorded)| {
        let name = format!("`{}`", signal.name);
        let unit = signal.unit.into_owned();
        let held = if is_recorded { "always" } else { "on demand" };
        vec![name, unit, signal.about, held.to_owned()]
    });
    ReferenceTable::new(title, &["signal", "unit", "meaning", "in traces"], rows)
}

fn derived() -> ReferenceTable {
    let about = "\
`signals` of a world file defines signals from others, or from those above: \
`\"name\": \"expression\"` or \
`\"name\": Signal(expr: \"…\", unit: \"m\", about: \"…\", range: (0.0, 50.0))`.

Without `unit`, the signal has the unit of its signals. This requires that they share a unit, \
and that the expression only adds, subtracts, or uses `abs`, `min` or `max`. \
Otherwise it has none.

`range` is the scale on which an ado observes the signal. Choose the part that matters, \
because values beyond it are not cut off. Without `range`, it follows the unit. \
An absolute value hides the side on which the ado is: use it in formulas, and let the ado \
observe the signal with its sign.";
    let rows = RANGES.map(|row| row.map(str::to_owned).to_vec());
    ReferenceTable::new("Derived signals", &["unit", "default range"], rows)
        .with_about(about.to_owned())
}

fn observed() -> ReferenceTable {
    let about = "\
Ados of driving worlds without `observe` see these signals. \
`brakecheck check WORLD` lists those of your world with their scales.";
    let rows = OBSERVED.map(|row| row.map(str::to_owned).to_vec());
    ReferenceTable::new(
        "Default observation",
        &["part of the world", "signals"],
        rows,
    )
    .with_about(about.to_owned())
}
