//! Signals of both kinds of worlds, from the lists that publish them.

use super::page::{ReferencePage, ReferenceTable};
use crate::cli::failure::Failure;
use crate::scene::Availability;
use crate::scene::drive::signal_list;
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
Traces always have recorded signals. They have a signal on demand only if a formula or an ado \
mentions it. \
`planned` needs a plan, `conflict` and `priority` need different roads, and W has signals of \
quantities with bounds only.";
    let mut tables = vec![table("Driving worlds", signal_list())];
    if let Some(grid) = Scenario::shipped(GRID).transpose()? {
        let signals = grid.signals().into_iter();
        let own = signals.filter(|(_, held)| *held != Availability::Derived);
        tables.push(table("Grid worlds", own));
    }
    Ok(ReferencePage {
        title: "Signals",
        about: about.to_owned(),
        tables,
    })
}

fn table(title: &str, signals: impl IntoIterator<Item = (Signal, Availability)>) -> ReferenceTable {
    let rows = signals.into_iter().map(|(signal, held)| {
        let name = format!("`{}`", signal.name);
        let unit = signal.unit.into_owned();
        vec![name, unit, signal.about, held.word().to_owned()]
    });
    ReferenceTable::new(title, &["signal", "unit", "meaning", "in traces"], rows)
}
