//! Road of the ego's way: the middle of its right lane as lines and arcs.

use super::map::RoadMap;
use super::problem::PlanningProblem;
use super::route::{EgoRoute, RouteTurn};
use crate::opendrive::ImportError;
use crate::pose::Pose;
use crate::road::OnRoad;
use crate::traffic::{FittedRoad, Path};

/// Road kept behind the ego's start in metres.
const BEHIND_M: f64 = 20.0;
/// Greatest distance of the road from the lanelets in metres.
const MOST_OFF_M: f64 = 1.0;
/// Least radius of lane 0, as a share beyond that of the outer lanes' edges.
const ROOM: f64 = 1.1;
/// Least distance of the road's points in metres.
const STEP_M: f64 = 0.3;
/// Greatest number of lanes on either side.
const MOST_BESIDE: usize = 20;

/// Road of the ego, whose positions are relative to its start.
#[derive(Clone, Debug)]
pub(super) struct EgoRoad {
    pub(super) road: FittedRoad,
    /// Where the positions of the file have their origin.
    pub(super) origin_m: [f64; 2],
    pub(super) lanes: usize,
    pub(super) lane_width_m: f64,
    /// Lane of the ego's start.
    pub(super) ego_lane: usize,
    /// Stations at which its lanelets begin and end.
    pub(super) parts: Vec<RoadPart>,
    /// Way covered by lanelets.
    pub(super) length_m: f64,
}

/// Part of a road along a lanelet.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RoadPart {
    pub(super) id: String,
    pub(super) from_m: f64,
    pub(super) to_m: f64,
}

/// Lanes beside the lane of the start.
#[derive(Clone, Copy)]
struct LanesBeside {
    right: usize,
    left: usize,
}

impl EgoRoad {
    /// Fits the road of a way.
    pub(super) fn along(
        map: &RoadMap,
        route: &EgoRoute<'_>,
        problem: &PlanningProblem,
    ) -> Result<EgoRoad, ImportError> {
        let origin_m = problem.position_m;
        let no_road = |what: &str| {
            let help = "choose a planning problem whose way has wider bends by --ego ID";
            problem.at.error(what).helped(help)
        };
        let line = reference(route, origin_m)?;
        // The origin is the ego's start, so its place on the line is that of
        // [0, 0].
        let from_m = line.place_anywhere([0.0, 0.0]).s_m - BEHIND_M;
        let kept = line.points().filter(|it| it.1 >= from_m).map(|it| it.0);
        let line = Path::through(kept, STEP_M).ok_or_else(|| no_road("its way has no length"))?;
        let mut widths: Vec<f64> = route.steps.iter().map(|it| it.lanelet.width_m()).collect();
        widths.sort_by(f64::total_cmp);
        // The median, which single lanelets of another width do not move.
        let lane_width_m = (100.0 * widths[widths.len() / 2]).round() / 100.0;
        let driven = visited(route);
        // Sharp bends leave no room for lanes that the ego does not need.
        for beside in [beside(map, route, driven), driven] {
            let right_m = beside.right as f64 * lane_width_m;
            let lanes = beside.right + beside.left + 1;
            // The leftmost edge would have no radius in a sharper bend of lane
            // 0.
            let radius_m = ROOM * lane_width_m * (lanes as f64 - 0.5);
            // Lane 0 of a world is the rightmost one.
            let lane_0 = line.moved(|_| -right_m, STEP_M);
            let points: Vec<[f64; 2]> = lane_0
                .iter()
                .flat_map(Path::points)
                .map(|it| it.0)
                .collect();
            let fitted = FittedRoad::of_lane(&points, radius_m);
            let Some(road) = fitted.filter(|it| it.worst_m <= MOST_OFF_M) else {
                continue;
            };
            let mut made = EgoRoad {
                road,
                origin_m,
                lanes,
                lane_width_m,
                ego_lane: beside.right,
                parts: Vec::new(),
                length_m: 0.0,
            };
            // Last, because stations are those of the fitted road.
            made.parts = parts(route, &made)?;
            made.length_m = made.parts.iter().map(|it| it.to_m).fold(0.0, f64::max);
            return Ok(made);
        }
        Err(no_road(
            "the lanelets of its way are within 1 m of no road of lines and arcs",
        ))
    }

    /// Returns a place of the file relative to the origin.
    pub(super) fn local(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x - self.origin_m[0], y - self.origin_m[1]]
    }

    /// Returns where a point of the file is along the road.
    pub(super) fn place(&self, point_m: [f64; 2]) -> OnRoad {
        let [x_m, y_m] = self.local(point_m);
        self.road.course.locate(&Pose {
            x_m,
            y_m,
            heading_rad: 0.0,
        })
    }
}

/// Returns the middle of the lane on which the ego starts, changes of lanes left out.
fn reference(route: &EgoRoute<'_>, origin_m: [f64; 2]) -> Result<Path, ImportError> {
    let mut points: Vec<[f64; 2]> = Vec::new();
    // The lane of the way is this far to the left of that of the start.
    let mut left_m = 0.0;
    let mut before: Option<Path> = None;
    for step in &route.steps {
        let middle = step.lanelet.middle()?;
        let end_m = middle.points().last().map_or([0.0; 2], |it| it.0);
        if step.by == RouteTurn::Ahead {
            // After a change of lanes the line goes on beside the lane of the
            // start.
            let moved = middle.moved(|_| -left_m, STEP_M);
            points.extend(moved.iter().flat_map(Path::points).map(|it| it.0));
        } else if let Some(before) = &before {
            left_m += before.place_anywhere(end_m).lateral_m;
        }
        before = Some(middle);
    }
    let local = points
        .into_iter()
        .map(|[x, y]| [x - origin_m[0], y - origin_m[1]]);
    Path::through(local, STEP_M).ok_or_else(|| {
        let first = &route.steps[0].lanelet.at;
        first
            .error("its bounds have no length")
            .helped("write bounds along the lane")
    })
}

/// Returns the lanes beside that of the start which the way visits.
fn visited(route: &EgoRoute<'_>) -> LanesBeside {
    let (mut at, mut least, mut most) = (0_i32, 0_i32, 0_i32);
    for step in &route.steps {
        at += change(step.by);
        least = least.min(at);
        most = most.max(at);
    }
    LanesBeside {
        right: least.unsigned_abs() as usize,
        left: most.unsigned_abs() as usize,
    }
}

fn change(by: RouteTurn) -> i32 {
    match by {
        RouteTurn::Ahead => 0,
        RouteTurn::ToLeft => 1,
        RouteTurn::ToRight => -1,
    }
}

/// Returns the lanes beside that of the start which there are all along the way to the goal.
fn beside(map: &RoadMap, route: &EgoRoute<'_>, least: LanesBeside) -> LanesBeside {
    let count = |from: &str, is_left: bool| {
        let mut lanes = 0;
        let mut id = from;
        // The limit ends lanelets that are beside each other in a circle.
        while let Some(lanelet) = map.lanelets.get(id).filter(|_| lanes < MOST_BESIDE) {
            let next = if is_left {
                &lanelet.left
            } else {
                &lanelet.right
            };
            match next
                .as_deref()
                .and_then(|it| map.lanelets.get_key_value(it))
            {
                Some((next, it)) if it.is_driven => id = next,
                _ => break,
            }
            lanes += 1;
        }
        lanes as i32
    };
    let mut at = 0;
    let (mut right, mut left) = (i32::MAX, i32::MAX);
    // Up to the goal only: lanes that end behind it are of use on the way.
    for step in &route.steps[..route.to_goal] {
        at += change(step.by);
        right = right.min(count(step.id, false) - at);
        left = left.min(count(step.id, true) + at);
    }
    let kept = |lanes: i32, least: usize| (lanes.max(0) as usize).min(MOST_BESIDE).max(least);
    LanesBeside {
        right: kept(right, least.right),
        left: kept(left, least.left),
    }
}

/// Returns the stations of the lanelets of a way.
fn parts(route: &EgoRoute<'_>, road: &EgoRoad) -> Result<Vec<RoadPart>, ImportError> {
    let part = |step: &super::route::RouteStep<'_>| {
        let middle = step.lanelet.middle()?;
        let station = |it: Option<([f64; 2], f64)>| it.map_or(0.0, |it| road.place(it.0).s_m);
        Ok(RoadPart {
            id: step.id.to_owned(),
            from_m: station(middle.points().next()),
            to_m: station(middle.points().last()),
        })
    };
    route.steps.iter().map(part).collect()
}
