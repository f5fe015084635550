//! Test protocols: which points an ego passes, and which lawful variations of
//! those points it does not.
//!
//! A point is a start of a world whose ado, while nothing is added to its plan,
//! does what the protocol prescribes. What its rules let it add is searched, per
//! point that is passed, for the first variation that makes the ego fail.

use serde::{Deserialize, Serialize};

use crate::campaign::{EgoUnderTest, SearchRequest, Switches, Watch, search, test_starts};
use crate::scenario::Scenario;
use crate::testbench::{Aftermath, Replay, play};

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
    let scenario = ego.scenario();
    let most = match (scenario.starts(), scenario.axes().is_empty()) {
        (Some(all), _) => all.len(),
        (None, true) => 1,
        (None, false) => starts,
    };
    // A point counts as failed by the very ego that is tested, not by another.
    let points = test_starts(scenario, 0, most, watch)?;
    watch.phase(&format!("{name}: {}", ego.name()));
    let request = SearchRequest {
        scenario,
        ego: ego.name(),
        method: Switches(SWITCHES).into(),
        budget: 0,
        starts: &points,
    };
    let searched = search(&request, watch);
    if watch.stopped() {
        return None;
    }
    let failed = points.trivial.iter().filter(|trivial| **trivial).count();
    let mut row = ProtocolRow {
        world: name.to_owned(),
        ego: ego.name().to_owned(),
        points: points.starts.len(),
        passed: points.starts.len() - failed - searched.row.invalid,
        strayed: 0,
        preventable: 0,
        unjudged: 0,
        worst_closing_mps: None,
    };
    let mut bench = scenario.bench();
    for (found, (start, noise)) in searched.found.iter().zip(&points.starts) {
        let actions = found.as_ref().and_then(|found| found.actions.as_deref());
        let Some(actions) = actions else {
            continue;
        };
        let mut ado = Replay::holding(actions);
        let episode = play(&mut bench, start, *noise, &mut ado, Aftermath::Play);
        row.strayed += 1;
        match scenario.preventability(&episode).human_model_avoids() {
            Some(true) => row.preventable += 1,
            Some(false) => {}
            None => row.unjudged += 1,
        }
        let closing = episode
            .contact
            .as_ref()
            .map(|contact| contact.closing_speed_mps);
        row.worst_closing_mps = match (row.worst_closing_mps, closing) {
            (Some(worst), Some(closing)) => Some(worst.max(closing)),
            (worst, closing) => worst.or(closing),
        };
    }
    Some(row)
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
) -> Result<Vec<EgoUnderTest>, crate::campaign::CampaignError> {
    let all = ["all".to_owned()];
    let asked = if asked.is_empty() { &all[..] } else { asked };
    let mut egos = Vec::new();
    for one in asked {
        egos.extend(EgoUnderTest::find(world, one)?);
    }
    Ok(egos)
}
