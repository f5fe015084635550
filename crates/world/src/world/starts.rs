//! Checks of starts: within bounds, and without overlap of agents.

use crate::road::Direction;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::{Agent, Drive, DriveSpec, Range, Script, StartPlace};

/// Greatest start speed, in m/s.
const MAX_SPEED_MPS: f64 = 100.0;
/// Greatest distance of a start from the origin, in metres.
const MAX_DISTANCE_M: f64 = 5_000.0;

/// Greatest distance of a start from the road, in metres.
const MAX_ASIDE_M: f64 = 20.0;

/// Positions of the agents and the lights in the file's list.
#[derive(Clone, Copy)]
pub(super) struct EntryPositions<'a> {
    pub(super) agents: &'a [usize],
    pub(super) lights: &'a [usize],
}

/// Checks starts for speed, distance and overlap.
///
/// `entries` are the agents' positions in the file's list.
pub(super) fn check(
    problems: &mut Problems,
    path: &ValuePath,
    spec: &DriveSpec,
    entries: &[usize],
) {
    for (i, agent) in spec.agents.iter().enumerate() {
        let start = path.at(entries[i]).to("start");
        let speed = agent.place.speed_mps();
        if speed.lo < 0.0 || speed.hi > MAX_SPEED_MPS {
            let what = format!("start speeds are 0 to {MAX_SPEED_MPS} m/s");
            problems.add(&start.to("speed_mps"), what, "out of range", None);
        }
        let along = front(spec, i);
        if along.lo < -MAX_DISTANCE_M || along.hi > MAX_DISTANCE_M {
            let what = format!("starts lie within {MAX_DISTANCE_M} m of the origin");
            problems.add(&start, what, "too far", None);
        }
        for j in 0..i {
            let other = &spec.agents[j];
            // Agents on different roads, or at an angle, are compared as boxes
            // in the trial runs.
            if agent.road != other.road || is_turned(agent) || is_turned(other) {
                continue;
            }
            // Agents side by side cannot overlap, wherever they are along the
            // road.
            let apart_m = (agent.lateral_m.lo - other.lateral_m.hi)
                .max(other.lateral_m.lo - agent.lateral_m.hi);
            if (width_m(agent) + width_m(other)) / 2.0 <= apart_m {
                continue;
            }
            let ahead = headway(spec, j, i);
            let clear_m = rear_m(agent) + front_m(other);
            // Fronts may differ by any value of the range, so the ranges must
            // not meet.
            if ahead.lo <= clear_m && -(rear_m(other) + front_m(agent)) <= ahead.hi {
                let what = format!(
                    "`{}` and `{}` may start inside each other",
                    other.name, agent.name
                );
                let help = Some(format!(
                    "the headway ranges over {} to {} m; ahead it must exceed {clear_m} m, the length of `{}`",
                    ahead.lo, ahead.hi, agent.name
                ));
                problems.add(&start, what, "overlapping starts", help);
            }
        }
    }
}

/// Checks that pedestrians start near the road, and stop lines are on it.
pub(super) fn on_the_road(
    problems: &mut Problems,
    path: &ValuePath,
    spec: &DriveSpec,
    entries: EntryPositions<'_>,
) {
    for ((number, agent), entry) in spec.agents.iter().enumerate().zip(entries.agents) {
        let borders: Vec<f64> = spec.road_of(number).borders_m().collect();
        let (Some(right_m), Some(left_m)) = (borders.first(), borders.last()) else {
            continue;
        };
        let Range { lo, hi } = agent.lateral_m;
        if lo < right_m - MAX_ASIDE_M || left_m + MAX_ASIDE_M < hi {
            let what = format!(
                "`{}` starts more than {MAX_ASIDE_M} m off the road",
                agent.name
            );
            let help = format!(
                "the road reaches from {right_m} to {left_m} m: \
                 `lateral_m` counts from the middle of lane 0 to the left"
            );
            let place = path.at(*entry).to("lateral_m");
            problems.add(&place, what, "off the road", Some(help));
        }
    }
    for (light, entry) in spec.lights.iter().zip(entries.lights) {
        if light.line_m.abs() > MAX_DISTANCE_M {
            let what = format!("stop lines lie within {MAX_DISTANCE_M} m of the origin");
            problems.add(&path.at(*entry).to("line_m"), what, "too far", None);
        }
    }
}

/// Returns true for an obstacle at an angle to the road.
fn is_turned(agent: &Agent) -> bool {
    matches!(agent.drive, Drive::Scripted(Script::Stand)) && agent.facing_rad != 0.0
}

/// Extent behind the front bumper along the road.
fn rear_m(agent: &Agent) -> f64 {
    match agent.direction {
        Direction::With => agent.body.room_m().0,
        Direction::Against => 0.0,
    }
}

/// Extent ahead of the front bumper along the road, for oncoming agents.
fn front_m(agent: &Agent) -> f64 {
    agent.body.room_m().0 - rear_m(agent)
}

/// Extent across the road.
fn width_m(agent: &Agent) -> f64 {
    agent.body.room_m().1
}

/// Agents that an agent's position depends on, itself first.
fn chain(spec: &DriveSpec, agent: usize) -> Vec<usize> {
    let mut chain = vec![agent];
    let mut at = agent;
    // Ends, because an agent only refers to agents before it in the file.
    while let StartPlace::Ahead { of, .. } = spec.agents[at].place {
        chain.push(of);
        at = of;
    }
    chain
}

fn own_offset(agent: &Agent) -> Range {
    match agent.place {
        StartPlace::At { x_m, .. } => x_m,
        StartPlace::Ahead { headway_m, .. } => headway_m,
    }
}

/// Range of the start of an agent's front bumper.
pub(super) fn front(spec: &DriveSpec, agent: usize) -> Range {
    sum(spec, chain(spec, agent).into_iter())
}

/// Range of the start of `b` ahead of `a`. Common parts cancel.
fn headway(spec: &DriveSpec, a: usize, b: usize) -> Range {
    let (of_a, of_b) = (chain(spec, a), chain(spec, b));
    let plus = sum(spec, of_b.iter().copied().filter(|i| !of_a.contains(i)));
    let minus = sum(spec, of_a.iter().copied().filter(|i| !of_b.contains(i)));
    Range {
        lo: plus.lo - minus.hi,
        hi: plus.hi - minus.lo,
    }
}

fn sum(spec: &DriveSpec, agents: impl Iterator<Item = usize>) -> Range {
    agents
        // Offsets vary independently, so the ends of their ranges add up.
        .map(|i| own_offset(&spec.agents[i]))
        .fold(Range { lo: 0.0, hi: 0.0 }, |sum, range| Range {
            lo: sum.lo + range.lo,
            hi: sum.hi + range.hi,
        })
}
