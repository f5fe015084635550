//! Way of the ego over lanelets: from its start to a goal, along successors and beside.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

use super::map::{MapLanelet, RoadMap, far_m};
use super::problem::PlanningProblem;
use crate::opendrive::ImportError;
use crate::road::wrapped;

/// Way that a change of lanes counts as, in metres.
const CHANGE_M: f64 = 30.0;
/// Distance from a lanelet within which a place is still taken as on it, in metres.
const BESIDE_M: f64 = 2.0;
/// Greatest number of lanelets of a way.
const MOST_LANELETS: usize = 500;

/// Lanelet of a way, and how the way comes to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct RouteStep<'a> {
    pub(super) id: &'a str,
    pub(super) lanelet: &'a MapLanelet,
    pub(super) by: RouteTurn,
}

/// Step from a lanelet to the next of a way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RouteTurn {
    /// To a successor, or the start.
    Ahead,
    ToLeft,
    ToRight,
}

/// Way of the ego.
#[derive(Clone, Debug)]
pub(super) struct EgoRoute<'a> {
    pub(super) steps: Vec<RouteStep<'a>>,
    /// Number of steps up to the goal, all of them without a place to reach.
    pub(super) to_goal: usize,
    /// Whether no way leads to the goal.
    pub(super) misses_goal: bool,
}

impl<'a> EgoRoute<'a> {
    /// Finds the way of an ego, and prolongs it to about `least_m`.
    pub(super) fn find(
        map: &'a RoadMap,
        problem: &PlanningProblem,
        least_m: f64,
    ) -> Result<EgoRoute<'a>, ImportError> {
        let start = start(map, problem)?;
        let goals = goal_lanelets(map, problem);
        let found = shortest(map, start, &goals);
        // A goal of a time or a speed needs no way.
        let misses_goal = found.is_none() && has_goal_place(problem);
        let ids = found.unwrap_or_else(|| vec![(start, RouteTurn::Ahead)]);
        let steps = ids.into_iter().filter_map(|(id, by)| {
            let lanelet = map.lanelets.get(id)?;
            Some(RouteStep { id, lanelet, by })
        });
        let mut route = EgoRoute {
            steps: steps.collect(),
            to_goal: 0,
            misses_goal,
        };
        // Before the prolongation, whose lanelets are behind the goal.
        route.to_goal = route.steps.len();
        route.prolong(map, least_m)?;
        if goals.is_empty() || misses_goal {
            route.to_goal = route.steps.len();
        }
        Ok(route)
    }

    /// Adds the straightest successors.
    fn prolong(&mut self, map: &'a RoadMap, least_m: f64) -> Result<(), ImportError> {
        let ahead = self.steps.iter().filter(|it| it.by == RouteTurn::Ahead);
        let mut way_m: f64 = ahead.map(|it| it.lanelet.length_m()).sum();
        // Both bounds: lanelets of no length would be added for ever.
        while way_m < least_m && self.steps.len() < MOST_LANELETS {
            let Some(last) = self.steps.last() else { break };
            let course_rad = end_rad(last.lanelet)?;
            let mut best: Option<(f64, &'a str, &'a MapLanelet)> = None;
            for successor in &last.lanelet.successors {
                let Some((id, lanelet)) = map.lanelets.get_key_value(successor) else {
                    continue;
                };
                let turn_rad = wrapped(end_rad(lanelet)? - course_rad).abs();
                // A road has no loops, so a roundabout is driven once at most.
                let is_new = self.steps.iter().all(|it| it.id != id.as_str());
                if is_new && lanelet.is_driven && best.is_none_or(|it| turn_rad < it.0) {
                    best = Some((turn_rad, id, lanelet));
                }
            }
            let Some((_, id, lanelet)) = best else { break };
            way_m += lanelet.length_m();
            self.steps.push(RouteStep {
                id,
                lanelet,
                by: RouteTurn::Ahead,
            });
        }
        Ok(())
    }
}

/// Returns the direction in which a lanelet ends.
fn end_rad(lanelet: &MapLanelet) -> Result<f64, ImportError> {
    let middle = lanelet.middle()?;
    let [x, y] = middle.direction(middle.pieces() - 1);
    Ok(libm::atan2(y, x))
}

/// Returns the lanelet on which the ego starts: of several the one along its heading.
fn start<'a>(map: &'a RoadMap, problem: &PlanningProblem) -> Result<&'a str, ImportError> {
    let at_m = problem.position_m;
    let driven = || map.lanelets.iter().filter(|(_, it)| it.is_driven);
    let inside: Vec<_> = driven().filter(|(_, it)| it.contains(at_m)).collect();
    let near = || driven().filter(|(_, it)| beside_m(it, at_m) <= BESIDE_M);
    // Starts may lie beside all lanelets by a rounding of the file.
    let candidates = if inside.is_empty() {
        near().collect()
    } else {
        inside
    };
    let mut best: Option<(f64, &'a str)> = None;
    for (id, lanelet) in candidates {
        let middle = lanelet.middle()?;
        let place = middle.place_anywhere(at_m);
        let [x, y] = middle.direction(place.piece);
        let off_rad = wrapped(problem.heading_rad - libm::atan2(y, x)).abs();
        // Lanes of a junction overlap, and the middle of the right one is near.
        let misfit = off_rad + 0.05 * place.lateral_m.abs();
        if best.is_none_or(|it| misfit < it.0) {
            best = Some((misfit, id));
        }
    }
    let Some((misfit, id)) = best else {
        let [x, y] = at_m;
        let what = format!("the ego starts at ({x}, {y}), on no lanelet for cars");
        let help = "move its `initialState` onto a lanelet";
        return Err(problem.at.error(what).helped(help));
    };
    // The best lanelet leads the other way, which is likelier a wrong angle
    // than a wrong lane.
    if misfit > core::f64::consts::FRAC_PI_2 {
        let what = format!("the ego starts against the direction of lanelet {id}");
        let help = "correct the `orientation` of its `initialState`, in radians";
        return Err(problem.at.error(what).helped(help));
    }
    Ok(id)
}

/// Returns the distance of a point from the bounds of a lanelet, at their points.
fn beside_m(lanelet: &MapLanelet, at_m: [f64; 2]) -> f64 {
    let points = lanelet.left_m.iter().chain(&lanelet.right_m);
    points
        .map(|it| far_m(*it, at_m))
        .fold(f64::INFINITY, f64::min)
}

fn has_goal_place(problem: &PlanningProblem) -> bool {
    let has_place =
        |it: &super::problem::GoalState| !it.lanelets.is_empty() || !it.shapes_m.is_empty();
    problem.goals.iter().any(has_place)
}

/// Returns the lanelets of goals, and those on which the middles of their shapes are.
fn goal_lanelets<'a>(map: &'a RoadMap, problem: &PlanningProblem) -> Vec<&'a str> {
    let mut found = Vec::new();
    for goal in &problem.goals {
        let named = goal
            .lanelets
            .iter()
            .filter_map(|id| map.lanelets.get_key_value(id));
        found.extend(named.map(|(id, _)| id.as_str()));
        for shape_m in &goal.shapes_m {
            let middle_m = middle_of(shape_m);
            let is_on = |it: &(&String, &MapLanelet)| it.1.is_driven && it.1.contains(middle_m);
            found.extend(map.lanelets.iter().filter(is_on).map(|(id, _)| id.as_str()));
        }
    }
    found
}

/// Returns the mean of the corners of a shape.
pub(super) fn middle_of(shape_m: &[[f64; 2]]) -> [f64; 2] {
    let count = shape_m.len().max(1) as f64;
    let mean = |axis: usize| shape_m.iter().map(|it| it[axis]).sum::<f64>() / count;
    [mean(0), mean(1)]
}

/// Lanelet with the length of the way to it, the shortest first.
#[derive(PartialEq)]
struct ReachedLanelet<'a> {
    way_m: f64,
    id: &'a str,
}

impl Eq for ReachedLanelet<'_> {}

impl Ord for ReachedLanelet<'_> {
    fn cmp(&self, other: &Self) -> Ordering {
        // A heap gives the greatest first.
        other
            .way_m
            .total_cmp(&self.way_m)
            // By identity after equal ways, so that the route does not depend
            // on the heap.
            .then_with(|| self.id.cmp(other.id))
    }
}

impl PartialOrd for ReachedLanelet<'_> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Returns the shortest way to one of the goals, `None` without one.
fn shortest<'a>(
    map: &'a RoadMap,
    start: &'a str,
    goals: &[&str],
) -> Option<Vec<(&'a str, RouteTurn)>> {
    let mut came: BTreeMap<&'a str, (f64, &'a str, RouteTurn)> = BTreeMap::new();
    came.insert(start, (0.0, start, RouteTurn::Ahead));
    let mut open = BinaryHeap::from([ReachedLanelet {
        way_m: 0.0,
        id: start,
    }]);
    while let Some(ReachedLanelet { way_m, id }) = open.pop() {
        if goals.contains(&id) {
            return Some(way_back(&came, start, id));
        }
        // An older entry of the heap, to which a shorter way has been found
        // since.
        if came.get(id).is_some_and(|it| it.0 < way_m) {
            continue;
        }
        let lanelet = map.lanelets.get(id)?;
        let ahead = lanelet.successors.iter().map(|id| (id, RouteTurn::Ahead));
        let left = lanelet.left.iter().map(|id| (id, RouteTurn::ToLeft));
        let right = lanelet.right.iter().map(|id| (id, RouteTurn::ToRight));
        for (next, by) in ahead.chain(left).chain(right) {
            // Files of a cut map name lanelets that they lack.
            let Some((next, to)) = map.lanelets.get_key_value(next) else {
                continue;
            };
            if !to.is_driven {
                continue;
            }
            let more_m = match by {
                RouteTurn::Ahead => to.length_m(),
                _ => CHANGE_M,
            };
            let total_m = way_m + more_m;
            if came.get(next.as_str()).is_none_or(|it| total_m < it.0) {
                came.insert(next, (total_m, id, by));
                open.push(ReachedLanelet {
                    way_m: total_m,
                    id: next,
                });
            }
        }
    }
    None
}

fn way_back<'a>(
    came: &BTreeMap<&'a str, (f64, &'a str, RouteTurn)>,
    start: &'a str,
    goal: &'a str,
) -> Vec<(&'a str, RouteTurn)> {
    let mut way = Vec::new();
    let mut id = goal;
    while let Some((_, from, by)) = came.get(id) {
        // The way comes back to where it began.
        let id_by = if id == start { RouteTurn::Ahead } else { *by };
        way.push((id, id_by));
        if id == start {
            break;
        }
        id = *from;
    }
    way.reverse();
    way
}
