//! All roads of a world, and where the ways of its agents cross.

use super::course::{Course, CourseError, OnRoad, wrapped};
use super::placed::{Direction, Priority};
use super::spec::{Agent, DriveSpec};
use crate::sim::Pose;

/// How far beyond the pieces of a road crossings are looked for.
const BEYOND_M: f64 = 1000.0;
/// Ways are followed in steps of this length: two crossings that are nearer to
/// each other are none.
const STEP_M: f64 = 0.5;
/// A way is on another where it is as near as this.
const ON_M: f64 = 1e-6;

/// The roads of a world, laid.
#[derive(Clone, Debug)]
pub(super) struct RoadNetwork {
    /// The world's own road, then the named ones in file order.
    courses: Vec<Course>,
    /// Which of them each agent is on.
    road_of: Vec<usize>,
    /// By agent and agent: where the way of the first is crossed by that of the
    /// second, in the order in which it gets there. Ways on one road never are.
    crossings: Vec<Vec<Vec<Crossing>>>,
}

/// A place where two ways cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// Along the road of who asks.
    pub s_m: f64,
    /// From its driving direction there to the other's, counter-clockwise.
    pub turned_rad: f64,
}

impl RoadNetwork {
    /// Lays the roads of a world.
    pub fn new(spec: &DriveSpec) -> Result<RoadNetwork, CourseError> {
        let own = std::iter::once(spec.road.course());
        let placed = spec.roads.values().map(|placed| placed.course());
        let courses = own.chain(placed).collect::<Result<Vec<_>, _>>()?;
        let way = |agent: &Agent| Way {
            course: courses[agent.road].clone(),
            lateral_m: 0.5 * (agent.lateral_m.lo + agent.lateral_m.hi),
            direction: agent.direction,
        };
        let crossings = |a: &Agent| {
            let others = spec.agents.iter().map(|b| match a.road == b.road {
                true => Vec::new(),
                false => way(a).crossed_by(&way(b)),
            });
            others.collect()
        };
        Ok(RoadNetwork {
            crossings: match spec.roads.is_empty() {
                true => Vec::new(),
                false => spec.agents.iter().map(crossings).collect(),
            },
            road_of: spec.agents.iter().map(|agent| agent.road).collect(),
            courses,
        })
    }

    /// The course of the world's own road.
    pub fn main(&self) -> &Course {
        &self.courses[0]
    }

    /// All courses, the world's own first.
    pub fn courses(&self) -> &[Course] {
        &self.courses
    }

    /// The course of the road on which an agent is.
    pub fn course_of(&self, agent: usize) -> &Course {
        &self.courses[self.road_of[agent]]
    }

    /// Whether two agents are on one road.
    pub fn share_road(&self, a: usize, b: usize) -> bool {
        self.road_of[a] == self.road_of[b]
    }

    /// Where on its road an agent in a pose is.
    pub fn locate(&self, agent: usize, pose: &Pose) -> OnRoad {
        self.course_of(agent).locate(pose)
    }

    /// Where the way of `a` is crossed by that of `b`, in the order in which `a`
    /// gets there.
    pub fn crossings(&self, a: usize, b: usize) -> &[Crossing] {
        let of_a = self.crossings.get(a).and_then(|all| all.get(b));
        of_a.map_or(&[], Vec::as_slice)
    }
}

/// A line beside a course, driven one way.
struct Way {
    course: Course,
    lateral_m: f64,
    direction: Direction,
}

impl Way {
    /// By how much a place of the other way, at its s, is to the left of this one.
    fn offset_m(&self, other: &Way, s_m: f64) -> f64 {
        let at = other.course.pose(s_m, other.lateral_m);
        self.course.locate(&at).lateral_m - self.lateral_m
    }

    /// Crossings with another way, in the order of this one's driving.
    ///
    /// Follows the other way and looks where it changes sides.
    fn crossed_by(&self, other: &Way) -> Vec<Crossing> {
        let steps = (other.course.end_s_m() + 2.0 * BEYOND_M) / STEP_M;
        let s_m = |step: usize| step as f64 * STEP_M - BEYOND_M;
        let mut found = Vec::new();
        let mut before_m = self.offset_m(other, s_m(0));
        for step in 1..=steps.ceil() as usize {
            let here_m = self.offset_m(other, s_m(step));
            if (before_m < 0.0) != (here_m < 0.0) {
                found.extend(self.crossing(other, (s_m(step - 1), s_m(step)), before_m < 0.0));
            }
            before_m = here_m;
        }
        found.sort_by(|a: &Crossing, b| a.s_m.total_cmp(&b.s_m));
        if self.direction == Direction::Against {
            found.reverse();
        }
        found
    }

    /// The crossing between two places of the other way, by halving; `None` where
    /// it changes sides at a bend of the road, far away from it.
    fn crossing(
        &self,
        other: &Way,
        (mut from_m, mut to_m): (f64, f64),
        from_right: bool,
    ) -> Option<Crossing> {
        for _ in 0..60 {
            let middle_m = 0.5 * (from_m + to_m);
            match (self.offset_m(other, middle_m) < 0.0) == from_right {
                true => from_m = middle_m,
                false => to_m = middle_m,
            }
        }
        let there = other.course.pose(from_m, other.lateral_m);
        let at = self.course.locate(&there);
        let turn_rad = |direction| match direction {
            Direction::With => 0.0,
            Direction::Against => core::f64::consts::PI,
        };
        let crossing = Crossing {
            s_m: at.s_m,
            turned_rad: wrapped(
                at.heading_rad + turn_rad(other.direction) - turn_rad(self.direction),
            ),
        };
        ((at.lateral_m - self.lateral_m).abs() < ON_M).then_some(crossing)
    }
}

/// Whether `a` goes before `b` where their ways cross: whose road has priority,
/// and on equal roads who does not have the other on the right. So who turns left
/// across oncoming traffic lets it pass. Ways that never cross have no order.
pub(super) fn goes_first(spec: &DriveSpec, crossings: &[Crossing], [a, b]: [usize; 2]) -> bool {
    let rank = |agent: usize| match spec.agents[agent].road {
        0 => Priority::Equal,
        road => spec.roads[road - 1].priority,
    };
    match (crossings.first(), rank(a).cmp(&rank(b))) {
        (None, _) => false,
        (Some(_), core::cmp::Ordering::Greater) => true,
        (Some(_), core::cmp::Ordering::Less) => false,
        // Who comes from the right drives on to the left.
        (Some(crossing), core::cmp::Ordering::Equal) => libm::sin(crossing.turned_rad) < 0.0,
    }
}
