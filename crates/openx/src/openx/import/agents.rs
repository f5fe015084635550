//! Agents of a world: vehicles, pedestrians and obstacles with their drives.

use super::concrete::Concrete;
use super::draft::tidy;
use super::places::Placed;
use super::plans::{number, plan};
use super::seen::{EntityInFrame, EntityPath};
use crate::ego::{Actuated, Coast, ControllerSpec, CurveSpeed};
use crate::opendrive::error::ImportError;
use crate::road::Direction;
use crate::scene::drive::{Actions, Deviation, LaneKeeping};
use crate::world_file::{
    AdoFile, AgentFile, DriveFile, Facing, NumberOrRange, PlanFile, RuleFile, StartFile,
    WrittenRule,
};

/// Least speed in m/s that a cruise control keeps.
const LEAST_CRUISE_MPS: f64 = 0.1;

/// Returns the name of the road along which an entity drives by itself.
pub(super) fn way_name(it: &EntityInFrame) -> String {
    format!("{}_way", it.name)
}

/// Returns an entity as an agent.
///
/// # Errors
///
/// Returns an error for a place that a world cannot state.
pub(super) fn agent(
    concrete: &Concrete,
    all: &[EntityInFrame],
    it: &EntityInFrame,
    ado: Option<&str>,
) -> Result<AgentFile, ImportError> {
    let body = &it.entity.body;
    // On a path of its own, the station counts from the start of the path.
    let front_m = match it.path {
        EntityPath::Own(_, on) => on.along_m + it.front_along_m(),
        _ => it.spot.x_m + it.front_along_m(),
    };
    let left_m = it.spot.y_m + it.front_left_m();
    // An entity that stands askew is an obstacle, which has no lane.
    if let EntityPath::Turned = it.path {
        return obstacle(concrete, all, it);
    }
    let road = match it.path {
        EntityPath::Own(..) => Some(way_name(it)),
        _ => None,
    };
    // Worlds place fronts, and files the reference points of bodies.
    let start = StartFile::At {
        x_m: number(front_m),
        // A meeting starts from rest.
        speed_mps: match it.entity.approach {
            Some(_) => NumberOrRange::from(0.0),
            None => number(it.entity.speed_mps),
        },
    };
    let drive = drive(concrete, all, it, ado)?;
    if body.on_foot {
        return Ok(AgentFile::Pedestrian {
            name: it.name.clone(),
            body: body.name.clone(),
            // A way of its own leads through its place.
            lateral_m: number(if road.is_some() { 0.0 } else { left_m }),
            road,
            facing: match it.path {
                EntityPath::Left => Facing::Left,
                EntityPath::Right => Facing::Right,
                EntityPath::Against => Facing::Back,
                _ => Facing::Ahead,
            },
            start,
            drive,
        });
    }
    // A way of its own has a single lane.
    let lane = if road.is_some() {
        0.0
    } else {
        concrete.lane_at(left_m)
    };
    Ok(AgentFile::Vehicle {
        name: it.name.clone(),
        body: body.name.clone(),
        // Lanes are small whole numbers.
        lane: lane as usize,
        direction: match it.path {
            EntityPath::Against => Direction::Against,
            _ => Direction::With,
        },
        // In bends, the rear axle of a protocol's vehicle keeps the line.
        lane_keeping: if it.entity.is_ego && concrete.bends() {
            LaneKeeping::RearAxle
        } else {
            LaneKeeping::default()
        },
        offset_m: number(if road.is_some() {
            0.0
        } else {
            left_m - lane * concrete.lane_width_m
        }),
        road,
        start,
        drive,
    })
}

fn drive(
    concrete: &Concrete,
    all: &[EntityInFrame],
    it: &EntityInFrame,
    ado: Option<&str>,
) -> Result<DriveFile, ImportError> {
    if it.entity.is_ego {
        return Ok(DriveFile::Ego(ego_drive(concrete, it.entity.speed_mps)));
    }
    // Agents that only a storyboard moves have a plan without steps.
    let plan = plan(concrete, all, it)?;
    // Users may write the name of the file or that of the world.
    let is_ado = ado == Some(it.entity.name.as_str()) || ado == Some(it.name.as_str());
    Ok(match plan {
        plan if is_ado => DriveFile::Ado(deviating(&it.name, plan)),
        PlanFile::Script(steps) => DriveFile::Script(steps),
        PlanFile::Meet(meet) => DriveFile::Meet(meet),
    })
}

/// Ado that may deviate from its plan.
///
/// The default tolerances of the rules are a start, to be replaced by those of the protocol.
fn deviating(name: &str, plan: PlanFile) -> AdoFile {
    let rule = |what: &str, quantity: &str, most: f64| {
        RuleFile::Rule(WrittenRule {
            name: what.to_owned(),
            stl: format!(
                "always ({name}.{quantity} - {name}.planned.{quantity} in [-{most}, {most}])"
            ),
            requirement: None,
            priority: None,
        })
    };
    AdoFile {
        base: Some(plan),
        actions: Actions::Deviate(Deviation {
            accelerations: vec![-1.0, 0.0, 1.0],
            lateral_mps: vec![-0.3, 0.0, 0.3],
        }),
        // The middle of the nine pairs above, which adds nothing.
        neutral: 4,
        observe: None,
        rulebook: vec![
            rule("keeps its speed", "speed", 0.5),
            rule("keeps its place", "s", 0.5),
            rule("keeps its line", "lateral", 0.3),
        ],
        learner: None,
        lag_s: 0.0,
    }
}

/// Drive of the ego, which keeps its speed.
fn ego_drive(concrete: &Concrete, speed_mps: f64) -> Actuated<ControllerSpec> {
    // On grades a coasting car gains and loses speed, which a cruise control makes up.
    let controller = if concrete.grades.is_empty() || speed_mps < LEAST_CRUISE_MPS {
        ControllerSpec::from(Coast { accel_mps2: 0.0 })
    } else {
        ControllerSpec::from(CurveSpeed {
            desired_speed_mps: tidy(speed_mps),
            // High, because the protocol assumes that the ego keeps its speed.
            cruise_gain_per_s: 20.0,
            max_accel_mps2: 5.0,
            max_brake_mps2: 5.0,
            // So large that no bend slows the ego down.
            side_accel_mps2: 1000.0,
            plan_brake_mps2: 0.0,
            preview_s: 0.0,
        })
    };
    Actuated {
        controller,
        lag_s: 0.0,
    }
}

/// Returns a standing entity as an obstacle.
///
/// It refers to the straight road whose middle is nearest.
fn obstacle(
    concrete: &Concrete,
    all: &[EntityInFrame],
    it: &EntityInFrame,
) -> Result<AgentFile, ImportError> {
    let body = &it.entity.body;
    let front = it.spot.moved(body.front_m, 0.0);
    let shares_road = concrete.is_on_road(&it.entity.placed);
    let front = match &it.entity.placed.way {
        Some(on) if on.is_lane && shares_road => {
            // The front is located anew, because a bend may lie between it and the
            // reference point.
            let spot = it.entity.placed.spot.moved(body.front_m, 0.0);
            let placed = Placed {
                spot,
                lane: None,
                way: None,
            };
            concrete.station(&placed, &it.entity.at)?
        }
        _ => front,
    };
    // Without a shared road it stands beside the way of somebody else.
    let mut nearest = shares_road.then_some((None, front));
    for other in all {
        match other.path {
            // Only on a straight way the axes of its beginning measure stations.
            EntityPath::Own(begins, on) if on.way.piece_count() == 0 => {
                let seen = begins.sees(&front);
                let best_m = nearest.as_ref().map_or(f64::INFINITY, |it| it.1.y_m.abs());
                if seen.y_m.abs() < best_m {
                    nearest = Some((Some(way_name(other)), seen));
                }
            }
            _ => {}
        }
    }
    let Some((road, at)) = nearest else {
        let what = "it stands beside no straight way";
        let help = "place it along the road of the ego, or leave it out";
        return Err(it.entity.at.error(what).helped(help));
    };
    Ok(AgentFile::Obstacle {
        name: it.name.clone(),
        body: body.name.clone(),
        road,
        s_m: number(at.x_m),
        lateral_m: number(at.y_m),
        heading_rad: at.heading_rad,
    })
}
