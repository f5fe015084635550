//! Warnings about places in which an agent can do nothing sensible.

use super::dry_run::entry_of;
use super::scenario_kind::DriveScenario;
use super::warnings::Oddity;
use crate::road::Direction;
use crate::ron_file::{Problem, ValuePath};
use crate::scene::drive::{Actions, Agent, Drive, DriveSpec, Script, StartPlace};
use crate::sim::GRAVITY_MPS2;

/// Returns the warnings about lateral moves that leave the road, and about obstacles.
pub(super) fn warnings(scenario: DriveScenario<'_>) -> Vec<(Oddity, Problem)> {
    let spec = scenario.spec();
    let agents = || spec.agents.iter();
    let off_road = agents().filter_map(|agent| {
        let what = off_road(spec, agent)?;
        Some((
            Oddity::OffRoadMove,
            agent,
            what,
            "leaves the road",
            OFF_ROAD_HELP,
        ))
    });
    let too_near = agents().filter_map(|agent| {
        let what = too_near(spec, agent)?;
        Some((
            Oddity::ObstacleTooNear,
            agent,
            what,
            "too near",
            TOO_NEAR_HELP,
        ))
    });
    let all = off_road.chain(too_near);
    all.map(|(oddity, agent, what, label, help)| {
        let list = ValuePath::top().to("agents");
        let problem = Problem {
            what,
            span: entry_of(&list, &scenario.text, &agent.name).find(&scenario.text),
            label: label.to_owned(),
            help: Some(help.to_owned()),
        };
        (oddity, problem)
    })
    .collect()
}

const OFF_ROAD_HELP: &str = "give it a move to the other side, or start it in another lane";
const TOO_NEAR_HELP: &str = "place it farther ahead, or start the ego slower";

/// Describes an ado that has no lateral move with room for it on the road.
fn off_road(spec: &DriveSpec, agent: &Agent) -> Option<String> {
    let Drive::Ado {
        actions: Actions::Grid(grid),
        ..
    } = &agent.drive
    else {
        return None;
    };
    // Beside another road there may be more room than on its own.
    let is_plain = spec.roads.is_empty()
        && agent.road == 0
        && agent.direction == Direction::With
        && agent.facing_rad == 0.0;
    let sides: Vec<f64> = grid
        .lateral
        .iter()
        .map(|lateral| lateral.towards())
        .filter(|side| *side != 0.0)
        .collect();
    if !is_plain || sides.is_empty() {
        return None;
    }
    let (right_m, left_m) = (spec.road.borders_m().next()?, spec.road.borders_m().last()?);
    // Room beside the body on a side, at the start that leaves most of it.
    let room_m = |side: f64| {
        let free_m = if side > 0.0 {
            left_m - agent.lateral_m.lo
        } else {
            agent.lateral_m.hi - right_m
        };
        free_m - 0.5 * agent.body.width_m
    };
    // A move by its own width is the least that changes its place in traffic.
    let leaves = |side: &f64| room_m(*side) < agent.body.width_m;
    sides.iter().all(leaves).then(|| {
        let most_m = sides.iter().map(|side| room_m(*side)).fold(0.0, f64::max);
        format!(
            "`{}` has {most_m:.2} m of road beside it where it can move, less than its own width of {} m",
            agent.name, agent.body.width_m
        )
    })
}

/// Describes an obstacle before which no braking can stop the ego.
fn too_near(spec: &DriveSpec, obstacle: &Agent) -> Option<String> {
    let ego = &spec.agents[spec.egos().next()?];
    let stands = matches!(obstacle.drive, Drive::Scripted(Script::Stand));
    let on_one_road = |agent: &Agent| agent.road == 0 && agent.direction == Direction::With;
    let (
        StartPlace::At { x_m, speed_mps },
        StartPlace::At {
            x_m: obstacle_x_m, ..
        },
    ) = (&ego.place, &obstacle.place)
    else {
        return None;
    };
    if !stands || !on_one_road(ego) || !on_one_road(obstacle) || ego.facing_rad != 0.0 {
        return None;
    }
    // The obstacle may stand across the road, so it is at least as long as it is wide.
    let (long_m, wide_m) = (obstacle.body.length_m, obstacle.body.width_m);
    let (sin, cos) = (
        libm::sin(obstacle.facing_rad).abs(),
        libm::cos(obstacle.facing_rad),
    );
    // Its nearest point lies behind its front bumper, unless it faces the ego.
    let behind_m = long_m * cos.max(0.0) + 0.5 * wide_m * sin;
    let gap_m = obstacle_x_m.lo - behind_m - x_m.hi;
    let aside_m = f64::max(
        (obstacle.lateral_m.hi - ego.lateral_m.lo).abs(),
        (obstacle.lateral_m.lo - ego.lateral_m.hi).abs(),
    );
    let is_in_the_way = aside_m < 0.5 * (wide_m + ego.body.width_m);
    let grip_mps2 = spec.road.friction() * GRAVITY_MPS2;
    let fastest_mps = speed_mps.hi;
    // Way of full braking: v² / (2 μ g).
    let stop_m = fastest_mps * fastest_mps / (2.0 * grip_mps2);
    // Starts that overlap are an error of their own.
    (is_in_the_way && gap_m >= 0.0 && gap_m < stop_m).then(|| {
        format!(
            "`{}` may stand {gap_m:.1} m ahead of the ego, which needs {stop_m:.1} m to stop from {fastest_mps} m/s at the limit of the road",
            obstacle.name
        )
    })
}
