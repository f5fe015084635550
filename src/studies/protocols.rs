//! Test protocols: which points an ego passes, and which lawful variations of
//! those points it does not.
//!
//! A point is a start of a world whose ado, while nothing is added to its plan,
//! does what the protocol prescribes. What its rules let it add is searched, per
//! point that is passed, for the first variation that makes the ego fail.

use serde::{Deserialize, Serialize};

use crate::evaluation::{PointsRequest, points};
use crate::experiment::{EgoUnderTest, Watch};
use crate::world::Scenario;

/// Most changes of what is added to a plan.
const SWITCHES: usize = 2;

/// One ego at the points of one world.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ProtocolRow {
    /// Name of the world.
    pub world: String,
    /// Name of the ego.
    pub ego: String,
    /// Points of the protocol.
    pub points: usize,
    /// Those at which the ego does not fail.
    pub passed: usize,
    /// Of those, at how many a lawful variation makes it fail.
    pub strayed: usize,
    /// Of those, at how many CC_LATCHED or FSM in its place would not have.
    pub preventable: usize,
    /// Of those, at how many the reference drivers have nothing to say: they
    /// follow others, and judge nobody who crosses.
    pub unjudged: usize,
    /// The greatest closing speed of a contact, m/s.
    pub worst_closing_mps: Option<f64>,
}

/// Lets an ego meet every point, and searches for variations of those it passes;
/// of a world without a table of points, `starts` of its starts.
///
/// `None`: stopped.
pub fn protocol_row(
    name: &str,
    ego: &EgoUnderTest,
    starts: usize,
    watch: &Watch<'_>,
) -> Option<ProtocolRow> {
    let request = PointsRequest {
        ego,
        starts: (starts, 0),
        switches: Some(SWITCHES),
    };
    let table = points(&request, watch)?;
    if watch.stopped() {
        return None;
    }
    let varied = table.points.iter().filter_map(|it| it.varied.as_ref());
    let varied = varied.filter(|varied| varied.fails);
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
            .reduce(f64::max),
    })
}

/// The worlds' rows as a Markdown table, a column per ego.
pub fn protocols_markdown(rows: &[ProtocolRow]) -> String {
    let (mut worlds, mut egos) = (Vec::new(), Vec::new());
    for row in rows {
        if !worlds.contains(&row.world.as_str()) {
            worlds.push(row.world.as_str());
        }
        if !egos.contains(&row.ego.as_str()) {
            egos.push(row.ego.as_str());
        }
    }
    let mut text = format!(
        "Per ego: points passed; *!* at how many of those a lawful variation makes it fail, \
         found by a search with at most {SWITCHES} switches of what is added to the plan; \
         *c* at how many of those CC_LATCHED or FSM in its place would not have failed.\n\n\
         | world | points |{}\n| --- | --- |{}\n",
        egos.iter()
            .map(|ego| format!(" {ego} |"))
            .collect::<String>(),
        " --- |".repeat(egos.len()),
    );
    let at = |world: &str, ego: &str| {
        let mut rows = rows.iter();
        rows.find(|row| row.world == world && row.ego == ego)
    };
    for world in &worlds {
        let points = rows.iter().find(|row| row.world == *world);
        let points = points.map_or(0, |row| row.points);
        let cells = egos
            .iter()
            .map(|ego| at(world, ego).map_or("–".to_owned(), cell));
        text.push_str(&line(world, points, cells));
    }
    let sums: Vec<ProtocolRow> = egos.iter().map(|ego| sum(rows, ego)).collect();
    let points = sums.first().map_or(0, |row| row.points);
    text.push_str(&line("all", points, sums.iter().map(cell)));
    text
}

fn line(world: &str, points: usize, cells: impl Iterator<Item = String>) -> String {
    let cells: String = cells.map(|cell| format!(" {cell} |")).collect();
    format!("| {world} | {points} |{cells}\n")
}

/// How many points are passed, `!` of which fail varied, `c` of those preventably.
fn cell(row: &ProtocolRow) -> String {
    let mut text = row.passed.to_string();
    if 0 < row.strayed {
        text.push_str(&format!(" !{}", row.strayed));
    }
    if 0 < row.preventable {
        text.push_str(&format!(" c{}", row.preventable));
    }
    text
}

/// One ego over all worlds.
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

/// The egos of a protocol's world that are compared: its own, and those under
/// `reuse`, or those asked for.
pub fn protocol_egos(
    world: &Scenario,
    asked: &[String],
) -> Result<Vec<EgoUnderTest>, crate::experiment::EgoError> {
    let all = ["all".to_owned()];
    let asked = if asked.is_empty() { &all[..] } else { asked };
    let mut egos = Vec::new();
    for one in asked {
        egos.extend(EgoUnderTest::find(world, one)?);
    }
    Ok(egos)
}
