//! Planning problem of a scenario: the start of the ego and its goals.

use super::elements::{ValueRange, exact, identity, interval, needed, position, references};
use super::obstacles::{outline, whole_step};
use crate::opendrive::ImportError;
use crate::opendrive::error::{At, Blockers};
use crate::opendrive::tree::XmlNode;

/// Rates in rad/s and angles in rad below which a value is 0.
const TURNS_RAD: f64 = 1e-3;

/// Start and goals of the ego.
#[derive(Debug)]
pub(super) struct PlanningProblem {
    pub(super) id: String,
    pub(super) at: At,
    pub(super) line: usize,
    pub(super) position_m: [f64; 2],
    pub(super) heading_rad: f64,
    pub(super) speed_mps: f64,
    /// Time step of the start.
    pub(super) step: f64,
    pub(super) goals: Vec<GoalState>,
    /// Whether the ego turns or slips at the start.
    pub(super) is_turning: bool,
}

/// States of which one must be reached.
#[derive(Debug)]
pub(super) struct GoalState {
    pub(super) at: At,
    pub(super) line: usize,
    /// Time steps.
    pub(super) steps: ValueRange,
    /// Outlines of shapes.
    pub(super) shapes_m: Vec<Vec<[f64; 2]>>,
    pub(super) lanelets: Vec<String>,
    pub(super) speed_mps: Option<ValueRange>,
    pub(super) has_heading: bool,
}

/// Reads the planning problem of an identity, by default the only one.
///
/// Returns it with the number of further ones.
pub(super) fn read(
    root: &XmlNode,
    id: Option<&str>,
    blockers: &mut Blockers,
) -> Option<(PlanningProblem, usize)> {
    let all: Vec<&XmlNode> = root.all("planningProblem").collect();
    let is_it = |it: &&&XmlNode| id.is_none_or(|id| it.raw("id") == Some(id));
    let found = all.iter().filter(is_it).copied().collect::<Vec<_>>();
    let ids: Vec<&str> = all.iter().filter_map(|it| it.raw("id")).take(20).collect();
    match (&found[..], id) {
        ([one], _) => Some((blockers.keep(problem(one))?, all.len() - 1)),
        ([], None) => {
            let help = "add a `planningProblem`: it is the start of your ego";
            blockers.add(root.refused("it has no planning problem", help));
            None
        }
        ([], Some(id)) => {
            let help = format!("name one of {}", ids.join(", "));
            blockers.add(root.refused(format!("it has no planning problem `{id}`"), &help));
            None
        }
        (several, _) => {
            let what = format!("it has {} planning problems", several.len());
            let help = format!("choose one of {} by --ego ID", ids.join(", "));
            blockers.add(root.refused(what, &help));
            None
        }
    }
}

fn problem(node: &XmlNode) -> Result<PlanningProblem, ImportError> {
    let state = node.inner("initialState")?;
    let speed_mps = needed(state, "velocity")?;
    if speed_mps < 0.0 {
        let what = format!("the ego starts with {speed_mps} m/s");
        return Err(state.refused(what, "write a speed from 0 on: worlds have no reverse gear"));
    }
    // Files state tiny rates for a straight start.
    let turns = |name: &str| Ok(exact(state, name)?.is_some_and(|it| it.abs() > TURNS_RAD));
    let step = whole_step(state)?;
    // Version 2018b has goals of both names.
    let is_goal = |it: &&XmlNode| matches!(it.name.as_str(), "goalState" | "goalRegion");
    let goals: Vec<GoalState> = node
        .children
        .iter()
        .filter(is_goal)
        .map(|it| goal(it.child("state").unwrap_or(it), step))
        .collect::<Result<_, ImportError>>()?;
    if goals.is_empty() {
        return Err(node.refused("it has no goal", "add a `goalState` with a `time`"));
    }
    Ok(PlanningProblem {
        id: identity(node)?,
        at: node.at(),
        line: node.line,
        position_m: position(state)?,
        heading_rad: needed(state, "orientation")?,
        is_turning: turns("yawRate")? || turns("slipAngle")?,
        speed_mps,
        step,
        goals,
    })
}

fn goal(node: &XmlNode, first_step: f64) -> Result<GoalState, ImportError> {
    let steps = interval(node, "time")?.ok_or_else(|| {
        let help = "add a `time` with `intervalStart` and `intervalEnd`";
        node.refused("it has no time", help)
    })?;
    // A goal that ends before the start could never be reached.
    if steps.most <= first_step || steps.least < 0.0 {
        let what = format!(
            "its time steps {} to {} do not follow the start at {first_step}",
            steps.least, steps.most
        );
        return Err(node.refused(what, "write time steps after the start"));
    }
    let position = node.child("position");
    let shapes = position.map_or(&[][..], |it| &it.children);
    let is_shape = |it: &&XmlNode| it.name != "lanelet";
    let shapes_m = shapes.iter().filter(is_shape).map(outline);
    Ok(GoalState {
        at: node.at(),
        line: node.line,
        steps,
        shapes_m: shapes_m.collect::<Result<_, ImportError>>()?,
        lanelets: position.map_or(Ok(Vec::new()), |it| references(it, "lanelet"))?,
        speed_mps: interval(node, "velocity")?,
        has_heading: node.child("orientation").is_some(),
    })
}
