//! Page of a merged campaign.

use std::path::PathBuf;

use super::cell_map::CellMap;
use super::dir::PlanDir;
use super::error::CampaignError;
use super::merge::{Merged, page_of};
use super::plan::Unit;
use super::regulation_boundary;
use super::summary::SummaryRow;
use crate::report::{CampaignPage, CellState, MapCell, StartMap, TextTable, known_if};
use crate::run_dir::{counted, write_file};
use crate::stats::StartOutcome;

/// Headings of the columns of [`SummaryRow::cells`].
pub const COLUMNS: [&str; 10] = [
    "ego", "ado", "starts", "fails %", "95 %", "recall", "fouls", "contact", "prev.", "closing",
];

impl PlanDir {
    /// Writes a page about a merged campaign beside the merged file.
    ///
    /// # Errors
    /// Returns an error if the page cannot be written.
    pub fn write_page(&self, merged: &Merged) -> Result<PathBuf, CampaignError> {
        let plan = self.plan();
        let summary = &merged.summary;
        let maps: Result<Vec<StartMap>, CampaignError> =
            summary.maps.iter().map(|map| self.map(map)).collect();
        let page = CampaignPage {
            name: plan.name.clone(),
            about: format!(
                "{}, {} of an ego and an ado, {}.",
                counted(plan.worlds.len(), "world"),
                counted(plan.units.len(), "pair"),
                counted(merged.rows, "row")
            ),
            rates: TextTable::new(
                std::iter::once("world").chain(COLUMNS),
                summary.rows.iter().map(cells),
            ),
            gates: summary
                .gates
                .iter()
                .map(|gate| (gate.to_string(), gate.decided.is_closed()))
                .collect(),
            maps: maps?,
            boundary: plan.boundary.as_ref().map(|(name, _)| name.clone()),
            again: vec![
                "brakecheck campaign plan campaign.ron -o DIR".to_owned(),
                "brakecheck campaign run DIR".to_owned(),
                "brakecheck campaign merge DIR".to_owned(),
                format!("# SHA-256 of the merged rows: {}", merged.sha256),
            ],
        };
        let path = page_of(self.path());
        write_file(&path, page.html().as_bytes())?;
        Ok(path)
    }

    fn map(&self, map: &CellMap) -> Result<StartMap, CampaignError> {
        let inside = self.inside(map)?;
        let label = |(name, unit, _): &(String, String, Vec<f64>)| {
            if unit.is_empty() {
                name.clone()
            } else {
                format!("{name} [{unit}]")
            }
        };
        let values = |(_, _, values): &(String, String, Vec<f64>)| values.clone();
        // An empty axis must not divide by zero.
        let columns = map.x.2.len().max(1);
        let cell = |nth: usize| {
            let (x, y) = (map.x.2[nth % columns], map.y.2[nth / columns]);
            let said: Vec<String> = map
                .ados
                .iter()
                .zip(&map.outcomes)
                .map(|(ado, outcomes)| format!("{ado}: {}", <&str>::from(outcomes[nth])))
                .collect();
            MapCell {
                state: state(map, nth),
                // The first ado plays the protocol's own point, and later ados vary it.
                protocol: map.ados.len() > 1 && map.outcomes[0][nth] == StartOutcome::Solved,
                inside: inside.as_ref().map(|inside| inside[nth]),
                about: format!("{x}, {y}: {}", said.join("; ")),
            }
        };
        let at = map
            .at
            .iter()
            .map(|(name, value)| format!(", {name} = {value:.1}"));
        Ok(StartMap {
            group: format!("{}, {}", map.world, map.plant),
            title: format!("{}{}", map.ego, at.collect::<String>()),
            x: (label(&map.x), values(&map.x)),
            y: (label(&map.y), values(&map.y)),
            cells: (0..columns * map.y.2.len()).map(cell).collect(),
        })
    }

    /// Returns, per cell, whether the regulation requires the ego to hold there.
    fn inside(&self, map: &CellMap) -> Result<Option<Vec<bool>>, CampaignError> {
        let plan = self.plan();
        let Some((_, formula)) = &plan.boundary else {
            return Ok(None);
        };
        // The formula reads the starts, which are the same for every ado.
        let is_of = |unit: &&Unit| self.world(unit).name() == map.world && unit.ego.name == map.ego;
        let Some(unit) = plan.units.iter().find(is_of) else {
            return Ok(None);
        };
        let world = self.world(unit);
        let monitor = regulation_boundary::monitor(world, formula)
            .map_err(|error| CampaignError::Fault(error.to_string()))?;
        let cells = map.x.2.len() * map.y.2.len();
        // The starts of a map are consecutive, because the last two axes vary fastest.
        let starts = plan.starts.of(world, map.first..map.first + cells);
        Ok(Some(regulation_boundary::holds(world, &monitor, &starts)))
    }
}

/// Formats a row of the page's table.
fn cells(row: &SummaryRow) -> impl Iterator<Item = String> {
    let world = format!("{}, {}", row.world, row.plant);
    std::iter::once(world).chain(row.cells())
}

/// Combines the outcomes of all ados to the state of a cell.
fn state(map: &CellMap, nth: usize) -> CellState {
    let outcomes = || map.outcomes.iter().map(|of_ado| of_ado[nth]);
    // A failure under any ado is a failure of the cell.
    let fails = outcomes().any(|outcome| outcome == StartOutcome::Solved);
    let preventable = map
        .preventable
        .iter()
        .any(|of_ado| of_ado[nth] == Some(true));
    if fails {
        return if preventable {
            CellState::FailsPreventably
        } else {
            CellState::Fails
        };
    }
    if outcomes().all(|outcome| outcome == StartOutcome::Trivial) {
        return CellState::Trivial;
    }
    // Trivial and invalid starts say nothing about an ado, so a cell of such starts alone
    // is unknown.
    let is_judged = |outcome| {
        matches!(
            outcome,
            StartOutcome::Held | StartOutcome::RuleViolation | StartOutcome::Uncounted
        )
    };
    if outcomes().any(is_judged) {
        CellState::Holds
    } else {
        CellState::Unknown
    }
}

impl SummaryRow {
    /// Returns the cells of the row, in the order of the columns.
    pub fn cells(&self) -> [String; 10] {
        let who = match (self.train_seed, self.trainings) {
            (Some(seed), _) => format!("{} {seed}", self.ado),
            (None, 2..) => {
                let left_out = match self.unrated {
                    0 => String::new(),
                    some => format!(", {some} without a valid start"),
                };
                format!("{}, mean of {}{left_out}", self.ado, self.trainings)
            }
            _ => self.ado.to_string(),
        };
        let [lo, hi] = self.ci95.map(|share| 100.0 * share);
        let dash = || "–".to_owned();
        let known = |text: String| known_if(self.starts > 0, || text);
        // The row keeps rates, and readers of a table compare whole starts.
        let count = |rate: f64| known(format!("{:.0}", rate * self.starts as f64));
        [
            self.ego.clone(),
            who,
            self.starts.to_string(),
            known(format!("{:.1}", 100.0 * self.success_rate)),
            known(format!("{lo:.1}–{hi:.1}")),
            self.recall
                .map_or_else(dash, |recall| format!("{recall:.2}")),
            count(self.foul_rate),
            count(self.contact_rate),
            self.preventable
                .map_or_else(dash, |count| count.to_string()),
            self.success_closing_mps
                .map_or_else(dash, |speed| format!("{:.1}", speed.median)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Dynamics;

    #[test]
    fn a_cell_holds_only_where_a_start_was_judged() {
        use StartOutcome::{Held, Invalid, RuleViolation, Solved, Trivial, Uncounted};
        let axis = || (String::new(), String::new(), vec![0.0]);
        let cases = [
            (vec![Trivial, Trivial], CellState::Trivial),
            (vec![Trivial, Invalid], CellState::Unknown),
            (vec![Invalid, Invalid], CellState::Unknown),
            (vec![Trivial, Held], CellState::Holds),
            (vec![Invalid, RuleViolation], CellState::Holds),
            (vec![Uncounted, Invalid], CellState::Holds),
            (vec![Held, Solved], CellState::Fails),
        ];
        for (outcomes, expect) in cases {
            let map = CellMap {
                world: String::new(),
                plant: Dynamics::Kinematic,
                ego: String::new(),
                x: axis(),
                y: axis(),
                at: Vec::new(),
                first: 0,
                ados: vec![String::new(); outcomes.len()],
                preventable: vec![vec![None]; outcomes.len()],
                outcomes: outcomes.iter().map(|outcome| vec![*outcome]).collect(),
            };
            assert_eq!(state(&map, 0), expect, "{outcomes:?}");
        }
    }
}
