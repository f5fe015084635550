//! Maps of a grid of starts, over its last two axes.

use serde::Serialize;

use super::dir::PlanDir;
use super::file::RequestedStarts;
use super::plan::Unit;
use super::unit_counts::{UnitCounts, plant};
use crate::scene::Dynamics;
use crate::stats::StartOutcome;

/// Grid of starts, cell by cell, over its last two axes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct CellMap {
    /// Name of the world.
    pub world: String,
    /// The plant.
    pub plant: Dynamics,
    /// Name of the ego.
    pub ego: String,
    /// Axis x: name, unit, values.
    pub x: (String, String, Vec<f64>),
    /// Axis y: name, unit, values.
    pub y: (String, String, Vec<f64>),
    /// Name and value of each further axis, if the grid has more than two.
    pub at: Vec<(String, f64)>,
    /// Position of its first cell among the starts.
    pub first: usize,
    /// Names of the ados, in order.
    pub ados: Vec<String>,
    /// Outcome per ado and cell, row by row from the smallest y.
    pub outcomes: Vec<Vec<StartOutcome>>,
    /// Per ado and cell, whether CC_LATCHED or FSM would have avoided the failure.
    pub preventable: Vec<Vec<Option<bool>>>,
}

impl CellMap {
    /// Returns the maps of every world and ego. A grid with fewer than two axes has none.
    pub(super) fn all(dir: &PlanDir, units: &[(&Unit, &UnitCounts)]) -> Vec<CellMap> {
        let RequestedStarts::Grid { axes, .. } = &dir.plan().starts else {
            return Vec::new();
        };
        // A grid with fewer than two axes has no map.
        let [others @ .., y, x] = &axes[..] else {
            return Vec::new();
        };
        let mut maps: Vec<CellMap> = Vec::new();
        let cells = x.1.len() * y.1.len();
        let slices: usize = others.iter().map(|(_, values)| values.len()).product();
        let mut seen: Vec<(usize, &str)> = Vec::new();
        for (unit, _) in units {
            let key = (unit.world, unit.ego.name.as_str());
            if seen.contains(&key) {
                continue;
            }
            seen.push(key);
            let of_key =
                |(other, _): &&(&Unit, &UnitCounts)| (other.world, other.ego.name.as_str()) == key;
            let all: Vec<&(&Unit, &UnitCounts)> = units.iter().filter(of_key).collect();
            let world = dir.world(unit);
            // The plan keeps names and values of the axes, and only the world knows their
            // units.
            let unit_of = |name: &str| {
                let axes = world.axes();
                let axis = axes.iter().find(|axis| axis.name == name);
                axis.map_or("", |axis| axis.unit).to_owned()
            };
            for slice in 0..slices {
                let mut left = slice;
                let mut at = Vec::new();
                // The last of these axes varies fastest between slices, as in `point`.
                for (name, values) in others.iter().rev() {
                    at.push((name.clone(), values[left % values.len()]));
                    left /= values.len();
                }
                at.reverse();
                let cut = |nth: usize| slice * cells + nth;
                let outcome = |tally: &UnitCounts, nth| {
                    let outcome = tally.outcomes.get(cut(nth)).copied();
                    // A missing outcome is shown as unknown.
                    let known = outcome.filter(|outcome| *outcome != StartOutcome::NotReached);
                    known.unwrap_or(StartOutcome::Invalid)
                };
                let outcomes = |(_, tally): &&(&Unit, &UnitCounts)| -> Vec<StartOutcome> {
                    (0..cells).map(|nth| outcome(tally, nth)).collect()
                };
                let preventable = |(_, tally): &&(&Unit, &UnitCounts)| -> Vec<Option<bool>> {
                    let one = |nth: usize| tally.avoidability.get(cut(nth))?.preventable();
                    (0..cells).map(one).collect()
                };
                maps.push(CellMap {
                    world: world.name().to_owned(),
                    plant: plant(dir, unit),
                    ego: unit.ego.name.clone(),
                    x: (x.0.clone(), unit_of(&x.0), x.1.clone()),
                    y: (y.0.clone(), unit_of(&y.0), y.1.clone()),
                    at,
                    first: slice * cells,
                    ados: all
                        .iter()
                        .map(|(unit, _)| unit.ado.id.to_string())
                        .collect(),
                    outcomes: all.iter().map(outcomes).collect(),
                    preventable: all.iter().map(preventable).collect(),
                });
            }
        }
        maps
    }
}
