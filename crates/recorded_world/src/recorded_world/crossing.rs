//! World in which a recorded path crosses that of the ego.

use brakecheck_traffic::{CrossingRoads, SituationPlan, StockBody, rounded};

use super::planned_motion::{on_path, own_road, path_of, rule, steps_of};
use super::{clock_of, file_name, other_road_users, plain};
use crate::ego::{Actuated, ControllerSpec, Idm};
use crate::road::Direction;
use crate::rulebook::JudgeKind;
use crate::scene::drive::{Actions, Deviation, LaneKeeping, MotionPlan};
use crate::sim::PlantKind;
use crate::world_file::{
    AdoFile, AgentFile, CommentedWorld, DriveFile, NumberOrRange, RuleFile, ScenarioFile,
    StartFile, TextComment, WorldFile,
};

const QUESTION: &str = "Does the ego avoid a contact with recorded crossing traffic that may \
                        stray from its recording?";
/// Width of the ego's lane in metres.
const EGO_LANE_M: f64 = 3.5;
/// Name of the ado's road.
const PATH: &str = "path";

/// Driver who can stop for the ado.
struct CarefulDriver {
    react_s: f64,
    brake_mps2: f64,
}

const CAREFUL: CarefulDriver = CarefulDriver {
    react_s: 0.75,
    brake_mps2: 5.0,
};

/// Deviations of a kind of road user from its recording.
struct StrayLimit {
    /// Least and greatest acceleration in m/s².
    accel_mps2: f64,
    /// Distance along the path in metres.
    along_m: f64,
}

/// Returns the world of a crossing.
pub(super) fn world(name: &str, plan: &SituationPlan, roads: &CrossingRoads) -> CommentedWorld {
    let mut world = ScenarioFile::new(
        name,
        QUESTION,
        clock_of(plan),
        own_road(&roads.ego, 1, EGO_LANE_M, None),
        vec![ego(plan, roads), ado(plan, roads)],
        "always (ego.ado.gap >= 0.01)",
    );
    world.source = file_name(&plan.source);
    world.plant = PlantKind::Kinematic;
    world.judge = JudgeKind::UntilContact;
    world.counts = other_road_users::CAUSED;
    let origin = roads.ego.course.start();
    let path = path_of(plan.body.width_m, &roads.other, origin);
    world.roads.0.insert(PATH.to_owned(), path);
    let mut comments = vec![TextComment::heading(heading(plan, roads))];
    comments.extend(other_road_users::add(&plan.others, origin, &mut world));
    CommentedWorld {
        world: WorldFile::Scenario(Box::new(world)),
        comments,
    }
}

/// Returns the origin of the situation, and how exactly world and recording agree.
fn heading(plan: &SituationPlan, roads: &CrossingRoads) -> String {
    format!(
        "{source}, at {time_s:.2} s: {planned} crosses the path of the ego, which replaces {replaced}.\n\
         They passed {pet_s:.2} s after one another, at {angle_deg:.0}°. The plan is fitted to positions: it stays\n\
         within {worst_m:.3} m of the recording along its path and {across_m:.2} m across, and accelerates by at\n\
         most {hardest_mps2:.1} m/s². The ego's path is within {ego_m:.2} m of the recorded one.",
        source = file_name(&plan.source),
        time_s = plan.time_s,
        planned = plain(&plan.planned),
        replaced = plain(&plan.replaced),
        pet_s = roads.pet_s,
        angle_deg = roads.angle_rad.to_degrees(),
        worst_m = plan.speed.worst_m,
        across_m = roads.across_m,
        hardest_mps2 = plan.speed.hardest_mps2(),
        ego_m = roads.ego.worst_m,
    )
}

/// Returns the ego, which drives on at the speed of the road user that it replaces.
fn ego(plan: &SituationPlan, roads: &CrossingRoads) -> AgentFile {
    let controller = Idm {
        desired_speed_mps: rounded(roads.desired_mps),
        time_gap_s: 1.2,
        min_gap_m: 2.0,
        max_accel_mps2: 1.5,
        comfort_brake_mps2: 2.5,
        max_brake_mps2: 7.0,
    };
    AgentFile::Vehicle {
        name: "ego".to_owned(),
        body: "sedan".to_owned(),
        road: None,
        lane: 0,
        direction: Direction::default(),
        // Plans move the rear axle, along the path that was fitted to it.
        lane_keeping: LaneKeeping::RearAxle,
        offset_m: NumberOrRange::default(),
        start: StartFile::At {
            x_m: rounded(roads.ego_s_m).into(),
            speed_mps: plan.ego_mps.into(),
        },
        drive: DriveFile::Ego(Actuated {
            controller: ControllerSpec::from(controller),
            lag_s: 0.3,
        }),
    }
}

/// Returns how far a road user may stray: less on foot than in a car.
fn stray(plan: &SituationPlan) -> StrayLimit {
    match plan.body.name {
        "pedestrian" => StrayLimit {
            accel_mps2: 0.5,
            along_m: 3.0,
        },
        "bicyclist" => StrayLimit {
            accel_mps2: 0.5,
            along_m: 6.0,
        },
        _ => StrayLimit {
            accel_mps2: 1.0,
            along_m: 10.0,
        },
    }
}

fn ado(plan: &SituationPlan, roads: &CrossingRoads) -> AgentFile {
    let accel_mps2 = stray(plan).accel_mps2;
    let observed = [
        "ego.ado.conflict",
        "ado.ego.conflict",
        "ego.speed",
        "ado.speed",
        "ego.accel",
        "time_left",
    ];
    let start = StartFile::At {
        x_m: rounded(roads.other_s_m).into(),
        speed_mps: plan.speed.start_mps.into(),
    };
    let drive = DriveFile::Ado(AdoFile {
        base: Some(MotionPlan::Script(steps_of(&plan.speed))),
        actions: Actions::Deviate(Deviation {
            accelerations: vec![-accel_mps2, 0.0, accel_mps2],
            lateral_mps: vec![0.0],
        }),
        neutral: 1,
        observe: Some(observed.map(str::to_owned).to_vec()),
        rulebook: rulebook(plan, roads),
        learner: None,
        lag_s: 0.0,
    });
    on_path("ado", plan.body.into(), PATH, start, drive)
}

fn rulebook(plan: &SituationPlan, roads: &CrossingRoads) -> Vec<RuleFile> {
    // Distances at which each reaches the strip of the other, rounded to centimetres.
    let cm = |value: f64| (100.0 * value).ceil() / 100.0;
    let edge_m = cm(roads.reach_m(plan.body, StockBody::EGO));
    let ego_edge_m = cm(roads.reach_m(StockBody::EGO, plan.body));
    let ego_past_m = cm(ego_edge_m + StockBody::EGO.length_m);
    let past_m = cm(edge_m + plan.body.length_m);
    let CarefulDriver {
        react_s,
        brake_mps2,
    } = CAREFUL;
    // Half of the recorded speed on the crossing.
    let least_mps = (50.0 * roads.least_mps).floor() / 100.0;
    let mut rules = vec![
        rule(
            "stays near its recording",
            format!(
                "always (ado.s - ado.planned.s in [-{0:?}, {0:?}])",
                stray(plan).along_m
            ),
        ),
        rule(
            "enters where a careful driver could stop",
            format!(
                "always (rise(ado.ego.conflict <= {edge_m:?}) and ego.ado.conflict >= -{ego_past_m:?} implies \
                 ego.ado.conflict - {ego_edge_m:?} > {react_s:?} * ego.speed + ego.speed * ego.speed / (2 * {brake_mps2:?}))"
            ),
        ),
    ];
    // A recording that stands on the crossing would break the rule by itself.
    if least_mps > 0.0 {
        rules.push(rule(
            "does not stop on the crossing",
            format!("always (ado.ego.conflict in [-{past_m:?}, {edge_m:?}] implies ado.speed >= {least_mps:?})"),
        ));
    }
    rules.push(rule(
        "never reverses",
        "always (ado.speed >= -0.1)".to_owned(),
    ));
    rules
}
