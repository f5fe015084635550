//! Test protocols: points that an ego passes, and variations on which it fails.
//!
//! A point is a start of a world. Without additions to its plan, the ado follows the
//! protocol. The additions that its rules allow are searched per passed point, until the
//! first variation makes the ego fail.

use serde::{Deserialize, Serialize};

use brakecheck::evaluation::{PointsRequest, points};
use brakecheck::experiment::{EgoUnderTest, Watch};
use brakecheck::world::Scenario;
use brakecheck_report::report::table::TextTable;

/// Largest number of switches in the additions to a plan.
const SWITCHES: usize = 2;

/// Results of an ego at the points of a world.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ProtocolRow {
    /// Name of the world.
    pub world: String,
    /// Name of the ego.
    pub ego: String,
    /// Number of points of the protocol.
    pub points: usize,
    /// Points at which the ego does not fail.
    pub passed: usize,
    /// Passed points with a variation within the rules that makes the ego fail.
    pub strayed: usize,
    /// Such points at which CC_LATCHED or FSM would not have failed.
    pub preventable: usize,
    /// Such points that the reference drivers cannot judge.
    ///
    /// These drivers follow other vehicles and cannot judge crossing traffic.
    pub unjudged: usize,
    /// Largest closing speed of a contact, m/s.
    pub worst_closing_mps: Option<f64>,
}

/// Plays every point against an ego, and searches variations of the passed points.
///
/// A world without a table of points uses `starts` of its starts. `None`: stopped.
pub fn protocol_row(
    name: &str,
    ego: &EgoUnderTest,
    starts: usize,
    watch: &Watch<'_>,
) -> Option<ProtocolRow> {
    let request = PointsRequest {
        ego,
        // Seed 0 is an open seed. Protocols with a table use it for noise only.
        starts: (starts, 0),
        switches: Some(SWITCHES),
    };
    let table = points(&request, watch)?;
    if watch.stopped() {
        return None;
    }
    let varied = table
        .points
        .iter()
        .filter_map(|it| it.varied.as_ref())
        // Only variations that make the ego fail can be preventable.
        .filter(|varied| varied.fails);
    let judged = |preventable| {
        let varied = varied.clone();
        varied.filter(move |it| it.preventable == preventable)
    };
    Some(ProtocolRow {
        world: name.to_owned(),
        ego: ego.name().to_owned(),
        points: table.points.len(),
        passed: table.passed,
        strayed: varied.clone().count(),
        preventable: judged(Some(true)).count(),
        unjudged: judged(None).count(),
        worst_closing_mps: varied
            .clone()
            .filter_map(|varied| varied.closing_mps)
            // Without a contact there is no speed, and 0 would claim a contact.
            .reduce(f64::max),
    })
}

/// Formats the rows as a Markdown table, with a column per ego.
pub fn protocols_markdown(rows: &[ProtocolRow]) -> String {
    // Worlds and egos keep the order of their first rows.
    let (mut worlds, mut egos) = (Vec::new(), Vec::new());
    for row in rows {
        if !worlds.contains(&row.world.as_str()) {
            worlds.push(row.world.as_str());
        }
        if !egos.contains(&row.ego.as_str()) {
            egos.push(row.ego.as_str());
        }
    }
    let at = |world: &str, ego: &str| {
        let mut rows = rows.iter();
        rows.find(|row| row.world == world && row.ego == ego)
    };
    let mut lines: Vec<Vec<String>> = Vec::new();
    for world in &worlds {
        // Every ego plays the same points, so any row gives their number.
        let row = rows.iter().find(|row| row.world == *world);
        let points = row.map_or(0, |row| row.points);
        let cells = egos
            .iter()
            .map(|ego| at(world, ego).map_or("–".to_owned(), cell));
        lines.push(line(world, points, cells));
    }
    // The sum over worlds counts every point once.
    let sums: Vec<ProtocolRow> = egos.iter().map(|ego| sum(rows, ego)).collect();
    let points = sums.first().map_or(0, |row| row.points);
    lines.push(line("all", points, sums.iter().map(cell)));
    let columns = ["world", "points"].into_iter().chain(egos);
    format!(
        "Per ego: points passed; *!* at how many of those a lawful variation makes it fail, \
         found by a search with at most {SWITCHES} switches of what is added to the plan; \
         *c* at how many of those CC_LATCHED or FSM in its place would not have failed.\n\n{}",
        TextTable::new(columns, lines).to_markdown()
    )
}

fn line(world: &str, points: usize, cells: impl Iterator<Item = String>) -> Vec<String> {
    [world.to_owned(), points.to_string()]
        .into_iter()
        .chain(cells)
        .collect()
}

/// Formats a cell: passed points, `!` failing variations, `c` preventable ones.
fn cell(row: &ProtocolRow) -> String {
    let mut text = row.passed.to_string();
    if row.strayed > 0 {
        text.push_str(&format!(" !{}", row.strayed));
    }
    if row.preventable > 0 {
        text.push_str(&format!(" c{}", row.preventable));
    }
    text
}

/// Sums the results of an ego over all worlds.
fn sum(rows: &[ProtocolRow], ego: &str) -> ProtocolRow {
    let own = || rows.iter().filter(|row| row.ego == ego);
    ProtocolRow {
        world: "all".to_owned(),
        ego: ego.to_owned(),
        points: own().map(|row| row.points).sum(),
        passed: own().map(|row| row.passed).sum(),
        strayed: own().map(|row| row.strayed).sum(),
        preventable: own().map(|row| row.preventable).sum(),
        unjudged: own().map(|row| row.unjudged).sum(),
        worst_closing_mps: own()
            .filter_map(|row| row.worst_closing_mps)
            .reduce(f64::max),
    }
}

/// Returns the egos to compare in a protocol's world.
///
/// They are the requested egos, or the world's own and all egos under `reuse`.
pub fn protocol_egos(
    world: &Scenario,
    requested: &[String],
) -> Result<Vec<EgoUnderTest>, brakecheck::experiment::EgoError> {
    let all = ["all".to_owned()];
    let requested = if requested.is_empty() {
        &all[..]
    } else {
        requested
    };
    let mut egos = Vec::new();
    for one in requested {
        egos.extend(EgoUnderTest::find(world, one)?);
    }
    Ok(egos)
}
