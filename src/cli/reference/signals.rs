//! Signals of both kinds of worlds, from the lists that publish them.

use super::page::{ReferencePage, ReferenceTable};
use crate::cli::failure::Failure;
use crate::scene::drive::signal_list;
use crate::scene::{Availability, World};
use crate::trace::Signal;
use crate::world::Scenario;

/// Shipped world whose list has all signals of grids.
const GRID: &str = "grid";

pub(super) fn page() -> Result<ReferencePage, Failure> {
    let about = "\
A signal is a named quantity, with a value per sample. \
`brakecheck check WORLD --details` lists the signals of your world.

Replace A and B by the names of two agents. L is a light, W the weather, R a road that an \
ado lays, and P a parameter of the starts. \
Traces have a signal on demand only if a formula or an ado mentions it. \
`planned` needs a plan, `conflict` and `priority` need different roads, and W has signals of \
quantities with bounds only.";
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
