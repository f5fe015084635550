//! Formulas of a scenario: no contact, speed limits, stops, lights and the goal.

use super::drops::Drops;
use super::lane_way::EgoRoad;
use super::map::{MapLanelet, RoadMap, far_m};
use super::problem::{GoalState, PlanningProblem};
use super::traffic_agents::ScenarioTime;
use crate::ego::Phase;
use crate::opendrive::error::At;
use crate::road::wrapped;
use crate::scene::drive::Schedule;
use crate::traffic::rounded;
use crate::world_file::{AgentFile, LightFile};

/// Deceleration in m/s² with which an ego can keep a limit ahead of it.
const BRAKE_MPS2: f64 = 4.0;
/// Speed in m/s and distance to the stop line in metres of an ego that has stopped.
const STOPPED: (f64, f64) = (0.1, 3.0);
/// Turn from which a way leads to the left or right, 30°.
const TURN_RAD: f64 = 0.52;
/// Share by which the box of a goal may be larger than its shape.
const ROUGH: f64 = 1.2;
/// Time between samples of a world in seconds.
pub(super) const SAMPLE_S: f64 = 0.05;
/// Greatest number of phases of a light.
const MOST_PHASES: usize = 900;

/// Formula with its name.
pub(super) struct NamedFormula {
    pub(super) name: &'static str,
    pub(super) stl: String,
}

/// Light on the ego's way.
pub(super) struct LightAgent {
    pub(super) name: String,
    pub(super) at: At,
    pub(super) agent: AgentFile,
}

/// Ego at its start, on its way.
#[derive(Clone, Copy)]
pub(super) struct EgoOnWay<'a> {
    pub(super) map: &'a RoadMap,
    pub(super) road: &'a EgoRoad,
    pub(super) problem: &'a PlanningProblem,
    pub(super) time: ScenarioTime,
    /// Station of its front.
    pub(super) front_m: f64,
    pub(super) length_m: f64,
}

/// Returns the rule of no contact, `None` without other agents.
pub(super) fn no_contact<'a>(names: impl Iterator<Item = &'a str>) -> Option<NamedFormula> {
    // 1 cm separates a contact from a near miss despite rounding.
    let clear: Vec<String> = names.map(|it| format!("ego.{it}.gap >= 0.01")).collect();
    (!clear.is_empty()).then(|| NamedFormula {
        name: "no_contact",
        stl: format!("always ({})", clear.join(" and ")),
    })
}

impl EgoOnWay<'_> {
    fn lanelets(&self) -> impl Iterator<Item = (usize, &MapLanelet)> {
        let parts = self.road.parts.iter().enumerate();
        parts.filter_map(|(i, part)| Some((i, self.map.lanelets.get(&part.id)?)))
    }

    /// Returns the least speed limit of the way in m/s.
    pub(super) fn least_limit_mps(&self) -> Option<f64> {
        let limits = self.lanelets().filter_map(|(_, it)| self.map.limit_mps(it));
        limits.reduce(f64::min)
    }

    /// Returns the speed limits along the way.
    pub(super) fn speed_limits(&self, drops: &mut Drops) -> Option<NamedFormula> {
        // Stations and limit of stretches with one limit.
        let mut stretches: Vec<([f64; 2], f64)> = Vec::new();
        for (i, lanelet) in self.lanelets() {
            let part = &self.road.parts[i];
            // A lanelet without a limit interrupts a stretch, which is checked
            // by its stations below.
            let Some(limit_mps) = self.map.limit_mps(lanelet) else {
                continue;
            };
            // A lanelet may end behind its beginning in the frame of the
            // fitted road.
            let to_m = part.to_m.max(part.from_m);
            // The ego has passed it, so it cannot violate it.
            if to_m < self.front_m {
                continue;
            }
            let from_m = part.from_m.max(self.front_m);
            // The limit counts from where the ego enters it.
            let way_m = from_m - self.front_m;
            let fast_mps = self.problem.speed_mps;
            let least_mps2 = fast_mps * fast_mps - 2.0 * BRAKE_MPS2 * way_m;
            // v² − 2·a·s is the least squared speed there. Such a limit is
            // violated whatever the ego does.
            if least_mps2 > limit_mps * limit_mps {
                let line = self.problem.line;
                drops.add("speed limits below the speed of the ego's start", line);
                continue;
            }
            match stretches.last_mut() {
                Some((range, known))
                    if *known == limit_mps && (range[1] - part.from_m).abs() < 1.0 =>
                {
                    range[1] = range[1].max(to_m);
                }
                _ => stretches.push(([part.from_m, to_m], limit_mps)),
            }
        }
        let is_whole =
            |it: &([f64; 2], f64)| it.0[0] <= self.front_m && it.0[1] >= self.road.length_m - 1.0;
        let stl = match &stretches[..] {
            [] => return None,
            // Without stations the formula is shorter, and its robustness is
            // in m/s alone.
            [one] if is_whole(one) => format!("always (ego.speed <= {:?})", rounded(one.1)),
            several => {
                let each = several.iter().map(|([from_m, to_m], limit_mps)| {
                    let (from_m, to_m) = (cm(*from_m), cm(*to_m));
                    let limit_mps = rounded(*limit_mps);
                    format!("(ego.s in [{from_m:?}, {to_m:?}] implies ego.speed <= {limit_mps:?})")
                });
                format!("always ({})", each.collect::<Vec<_>>().join(" and "))
            }
        };
        Some(NamedFormula {
            name: "speed_limit",
            stl,
        })
    }

    /// Returns the station of a lanelet's stop line, if it is ahead of the ego.
    fn stop_m(&self, part: usize, lanelet: &MapLanelet) -> Option<f64> {
        // A stop line without points is at the end of its lanelet.
        let line_m = match lanelet.stop_m.flatten() {
            Some(line_m) => self.road.place(line_m).s_m,
            None => self.road.parts[part].to_m,
        };
        // No rise past a line is ever seen behind it.
        (line_m > self.front_m).then(|| cm(line_m))
    }

    /// Returns the stops at signs.
    pub(super) fn stops(&self) -> Option<NamedFormula> {
        let (still_mps, before_m) = STOPPED;
        let mut lines: Vec<f64> = Vec::new();
        for (i, lanelet) in self.lanelets() {
            let signs = lanelet.signs.iter().filter_map(|id| self.map.signs.get(id));
            if signs.into_iter().any(|it| it.is_stop) {
                lines.extend(self.stop_m(i, lanelet));
            }
        }
        let stops = lines.iter().map(|line_m| {
            format!(
                "(rise(ego.s > {line_m:?}) implies once (ego.speed <= {still_mps:?} and ego.s in [{:?}, {line_m:?}]))",
                cm(line_m - before_m)
            )
        });
        let each: Vec<String> = stops.collect();
        (!each.is_empty()).then(|| NamedFormula {
            name: "stops",
            stl: format!("always ({})", each.join(" and ")),
        })
    }

    /// Returns the lights on the way.
    pub(super) fn lights(&self, drops: &mut Drops) -> Vec<LightAgent> {
        let mut found: Vec<LightAgent> = Vec::new();
        let mut used: Vec<&str> = Vec::new();
        for (i, lanelet) in self.lanelets() {
            let turn = self.turn_after(i);
            for id in &lanelet.lights {
                let Some(light) = self.map.lights.get(id) else {
                    continue;
                };
                // A light for another turn stays green or red without a
                // meaning for the ego.
                let is_for = light.direction == "all"
                    || light.direction.is_empty()
                    || light.direction.to_ascii_lowercase().contains(turn);
                let (Some(line_m), true, false) =
                    (self.stop_m(i, lanelet), is_for, used.contains(&id.as_str()))
                else {
                    continue;
                };
                // Before the schedule, so that a light that is off is not
                // listed a second time.
                used.push(id);
                let Some((first, schedule)) = self.schedule(&light.cycle, light.offset) else {
                    drops.add("traffic lights that are off", light.line);
                    continue;
                };
                let name = format!("light_{id}");
                found.push(LightAgent {
                    agent: AgentFile::Light {
                        name: name.clone(),
                        road: None,
                        signal: None,
                        line_m: Some(line_m),
                        phase: first,
                        drive: LightFile::Schedule(schedule),
                    },
                    at: light.at.clone(),
                    name,
                });
            }
        }
        let unused = self
            .map
            .lights
            .iter()
            .filter(|(id, _)| !used.contains(&id.as_str()));
        for (_, light) in unused {
            drops.add("traffic lights beside the ego's way", light.line);
        }
        found
    }

    /// Returns the word of directions for the turn behind a part.
    fn turn_after(&self, part: usize) -> &'static str {
        let parts = &self.road.parts;
        let course = &self.road.road.course;
        let from = course.pose(parts[part].to_m, 0.0).heading_rad;
        // The turn is that of the next lanelet, which lies in the junction.
        let to_m = parts.get(part + 1).map_or(parts[part].to_m, |it| it.to_m);
        let turn_rad = wrapped(course.pose(to_m, 0.0).heading_rad - from);
        if turn_rad > TURN_RAD {
            "left"
        } else if turn_rad < -TURN_RAD {
            "right"
        } else {
            "straight"
        }
    }

    /// Returns the first phase and the changes until the horizon, `None` for a light that is off.
    fn schedule(&self, cycle: &[(f64, Phase)], offset: f64) -> Option<(Phase, Schedule)> {
        let steps: f64 = cycle.iter().map(|it| it.0).sum();
        if cycle.is_empty() || steps <= 0.0 {
            return None;
        }
        let time = self.time;
        // `rem_euclid`, since an offset may be later than the start.
        let mut before = (time.first - offset).rem_euclid(steps);
        let mut at = 0;
        while cycle[at].0 <= before {
            before -= cycle[at].0;
            at = (at + 1) % cycle.len();
        }
        let first = cycle[at].1;
        let (mut phase, mut changes) = (first, Vec::new());
        let mut ends_s = (cycle[at].0 - before) * time.step_s;
        // Both bounds: a cycle of single steps over a long horizon would have
        // any number of changes.
        while ends_s < time.horizon_s && changes.len() < MOST_PHASES {
            at = (at + 1) % cycle.len();
            // Red and red-yellow are one phase here, and a change to itself is
            // no change.
            if cycle[at].1 != phase {
                phase = cycle[at].1;
                changes.push((rounded(ends_s), phase));
            }
            ends_s += cycle[at].0 * time.step_s;
        }
        Some((first, Schedule(changes)))
    }

    /// Returns the goals, of which one must be reached. `None` for goals of a time only.
    pub(super) fn goal(&self, drops: &mut Drops) -> Option<NamedFormula> {
        let goals = self.problem.goals.iter();
        // A goal without a place and a speed is reached by waiting.
        let reached: Option<Vec<String>> = goals.map(|it| self.one_goal(it, drops)).collect();
        Some(NamedFormula {
            name: "goal",
            stl: reached?.join(" or "),
        })
    }

    fn one_goal(&self, goal: &GoalState, drops: &mut Drops) -> Option<String> {
        let time = self.time;
        // An interval that has begun already counts from the start.
        let sample = |step: f64| (step - time.first).max(0.0) * time.step_s / SAMPLE_S;
        // Bounds are whole samples within the interval. The tolerance is that of products.
        let last = (sample(goal.steps.most) + 1e-6).floor();
        // An interval between two samples keeps the earlier one instead of
        // becoming empty.
        let first = (sample(goal.steps.least) - 1e-6).ceil().clamp(0.0, last);
        let (from_s, to_s) = (rounded(first * SAMPLE_S), rounded(last * SAMPLE_S));
        if goal.has_heading {
            drops.add("orientations of goals", goal.line);
        }
        let mut places: Vec<String> = Vec::new();
        for shape_m in &goal.shapes_m {
            let corners: Vec<[f64; 2]> = shape_m.iter().map(|it| self.on_road(*it)).collect();
            let bounds = bounds(&corners);
            if bounds.area_m2() > ROUGH * area_m2(shape_m) {
                drops.add(
                    "goal shapes, in place of which are boxes along the road",
                    goal.line,
                );
            }
            places.push(self.within(&bounds));
        }
        for id in &goal.lanelets {
            let Some(lanelet) = self.map.lanelets.get(id) else {
                drops.add("goals on lanelets that the file lacks", goal.line);
                continue;
            };
            let ends = |line: &[[f64; 2]]| [line[0], line[line.len() - 1]];
            // The ends suffice for the box, since stations run along the lane.
            let corners: Vec<[f64; 2]> = ends(&lanelet.left_m)
                .into_iter()
                .chain(ends(&lanelet.right_m))
                .map(|it| self.on_road(it))
                .collect();
            places.push(self.within(&bounds(&corners)));
        }
        let mut parts = Vec::new();
        if !places.is_empty() {
            parts.push(format!("({})", places.join(" or ")));
        }
        if let Some(speed) = goal.speed_mps {
            let (least, most) = (rounded(speed.least), rounded(speed.most));
            parts.push(format!("ego.speed in [{least:?}, {most:?}]"));
        }
        let stl = format!("eventually[{from_s:?}, {to_s:?}] ({})", parts.join(" and "));
        (!parts.is_empty()).then_some(stl)
    }

    /// Returns the station and the offset of a place of the file.
    fn on_road(&self, point_m: [f64; 2]) -> [f64; 2] {
        let place = self.road.place(point_m);
        [place.s_m, place.lateral_m]
    }

    /// Returns the formula of the ego's middle within a box along the road.
    fn within(&self, bounds: &RoadBox) -> String {
        // Signals are those of the front.
        let ahead_m = 0.5 * self.length_m;
        let [from_m, to_m] = bounds.along_m.map(|it| cm(it + ahead_m));
        let [right_m, left_m] = bounds.across_m.map(cm);
        format!("ego.s in [{from_m:?}, {to_m:?}] and ego.lateral in [{right_m:?}, {left_m:?}]")
    }
}

/// Box along a road.
struct RoadBox {
    along_m: [f64; 2],
    across_m: [f64; 2],
}

impl RoadBox {
    fn area_m2(&self) -> f64 {
        let extent = |[from, to]: [f64; 2]| to - from;
        extent(self.along_m) * extent(self.across_m)
    }
}

fn bounds(points: &[[f64; 2]]) -> RoadBox {
    let range = |axis: usize| {
        let values = || points.iter().map(|it| it[axis]);
        [
            values().fold(f64::INFINITY, f64::min),
            values().fold(f64::NEG_INFINITY, f64::max),
        ]
    };
    RoadBox {
        along_m: range(0),
        across_m: range(1),
    }
}

/// Returns the area of an outline.
fn area_m2(outline_m: &[[f64; 2]]) -> f64 {
    let next = outline_m.iter().cycle().skip(1);
    let twice = outline_m.iter().zip(next);
    let sum: f64 = twice.map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum();
    0.5 * sum.abs()
}

/// Rounds to centimetres.
fn cm(value: f64) -> f64 {
    (value * 100.0).round() / 100.0 + 0.0
}

/// Returns the way in metres from the ego to the farthest goal place, `None` without one.
pub(super) fn goal_m(map: &RoadMap, problem: &PlanningProblem) -> Option<f64> {
    let shapes = problem
        .goals
        .iter()
        .flat_map(|it| &it.shapes_m)
        .flatten()
        .copied();
    let lanelets = problem.goals.iter().flat_map(|it| &it.lanelets);
    let ends = lanelets.filter_map(|id| map.lanelets.get(id)?.left_m.last().copied());
    let ways = shapes.chain(ends).map(|it| far_m(it, problem.position_m));
    // The farthest, because the road must cover all places of the goals.
    ways.reduce(f64::max)
}
