//! All roads of a world, and the crossings between the paths of its agents.

use core::ops::Range;
use std::sync::OnceLock;

use super::course::Course;
use super::on_road::{OnRoad, wrapped};
use super::placement::{Direction, Priority};
use crate::pose::Pose;

/// Length beyond the pieces of a road that is searched for crossings.
const BEYOND_M: f64 = 1000.0;
/// Step of the search along a path. Two crossings closer than this are missed.
const STEP_M: f64 = 0.5;
/// Largest distance at which a point counts as lying on a path.
const ON_M: f64 = 1e-6;

/// The roads of a world with their courses.
#[derive(Clone, Debug)]
pub struct RoadNetwork {
    /// The world's own road, then the named ones in file order.
    courses: Vec<Course>,
    /// Place of each agent across its road.
    travellers: Vec<Traveller>,
    /// Crossings by pair of agents, in the order in which the first reaches them.
    ///
    /// They are searched when they are first read: the search of all pairs takes
    /// longer than an episode, and few worlds read any.
    crossings: Vec<OnceLock<Vec<Crossing>>>,
}

/// Place of an agent across its road, for the crossings of paths.
#[derive(Clone, Copy, Debug)]
pub struct Traveller {
    /// Index of its road.
    pub road: usize,
    /// Distance of its path to the left of the road's course.
    pub lateral_m: f64,
    /// Its driving direction.
    pub direction: Direction,
}

/// A crossing of two paths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Station along the road of the first agent.
    pub s_m: f64,
    /// Angle from its driving direction to the other's, counter-clockwise.
    pub turned_rad: f64,
}

impl RoadNetwork {
    /// Builds the network of the courses on which these agents travel.
    pub fn new(courses: Vec<Course>, travellers: &[Traveller]) -> RoadNetwork {
        // Paths on the same road never cross.
        let pairs = if courses.len() == 1 {
            0
        } else {
            travellers.len() * travellers.len()
        };
        RoadNetwork {
            crossings: vec![OnceLock::new(); pairs],
            travellers: travellers.to_vec(),
            courses,
        }
    }

    /// Returns the course of the world's own road.
    pub fn main(&self) -> &Course {
        &self.courses[0]
    }

    /// Returns all courses, the world's own first.
    pub fn courses(&self) -> &[Course] {
        &self.courses
    }

    /// Returns the course of an agent's road.
    #[inline]
    pub fn course_of(&self, agent: usize) -> &Course {
        &self.courses[self.travellers[agent].road]
    }

    /// Returns whether two agents are on the same road.
    #[inline]
    pub fn share_road(&self, a: usize, b: usize) -> bool {
        self.travellers[a].road == self.travellers[b].road
    }

    /// Returns the road coordinates of an agent in a pose.
    #[inline]
    pub fn locate(&self, agent: usize, pose: &Pose) -> OnRoad {
        self.course_of(agent).locate(pose)
    }

    /// Returns the crossings of `a` with `b`, in the order in which `a` arrives.
    ///
    /// Empty for an unknown agent, and for agents on the same road.
    pub fn crossings(&self, a: usize, b: usize) -> &[Crossing] {
        let agents = self.travellers.len();
        // An unknown agent has no crossing, where an index would panic.
        let known = a < agents && b < agents;
        let found = known.then(|| self.crossings.get(a * agents + b)).flatten();
        let Some(found) = found.filter(|_| !self.share_road(a, b)) else {
            return &[];
        };
        // On first use, because most pairs of a world are never asked for.
        found.get_or_init(|| self.line(a).crossed_by(&self.line(b)))
    }

    /// Returns the path of an agent.
    fn line(&self, agent: usize) -> TravelLine<'_> {
        let Traveller {
            road,
            lateral_m,
            direction,
        } = self.travellers[agent];
        TravelLine {
            course: &self.courses[road],
            lateral_m,
            direction,
        }
    }
}

/// A line beside a course, driven in a direction.
struct TravelLine<'a> {
    course: &'a Course,
    lateral_m: f64,
    direction: Direction,
}

impl TravelLine<'_> {
    /// Returns the offset of a point of the other path to the left of this path.
    fn offset_m(&self, other: &TravelLine<'_>, s_m: f64) -> f64 {
        let at = other.course.pose(s_m, other.lateral_m);
        self.course.locate(&at).lateral_m - self.lateral_m
    }

    /// Returns the least distance of a point of the other path, and its offset to the
    /// left of this path.
    fn seen_m(&self, other: &TravelLine<'_>, s_m: f64) -> (f64, f64) {
        let at = other.course.pose(s_m, other.lateral_m);
        let (away_m, on) = self.course.nearest(&at);
        (away_m - self.lateral_m.abs(), on.lateral_m - self.lateral_m)
    }

    /// Returns the crossings with another path, in driving order.
    ///
    /// Follows the other path and detects where it changes sides.
    fn crossed_by(&self, other: &TravelLine<'_>) -> Vec<Crossing> {
        let steps = ((other.course.end_s_m() + 2.0 * BEYOND_M) / STEP_M).ceil() as usize;
        let s_m = |step: usize| step as f64 * STEP_M - BEYOND_M;
        // On the outside of a bend, a step covers more than its length.
        // It must hold for every step, so it is that of the sharpest bend.
        let outside = other.course.most_curvature_per_m() * other.lateral_m.abs();
        let step_m = STEP_M * (1.0 + outside);
        let mut found = Vec::new();
        let mut step = 0;
        let (mut away_m, mut before_m) = self.seen_m(other, s_m(0));
        while step < steps {
            // As far as the other path is away from this one, it cannot cross it.
            let far = (away_m / step_m) as usize;
            let next = (if far > 1 { step + far - 1 } else { step + 1 }).min(steps);
            let (next_away_m, here_m) = self.seen_m(other, s_m(next));
            // After a longer step both are on one side, because the other path was too far away.
            if next == step + 1 && (before_m < 0.0) != (here_m < 0.0) {
                found.extend(self.crossing(other, s_m(step)..s_m(next), before_m < 0.0));
            }
            (step, away_m, before_m) = (next, next_away_m, here_m);
        }
        // In the order in which the agent itself meets them, not the other one.
        found.sort_by(|a: &Crossing, b| a.s_m.total_cmp(&b.s_m));
        if self.direction == Direction::Against {
            found.reverse();
        }
        found
    }

    /// Locates a crossing between two stations of the other path by bisection.
    ///
    /// Returns `None` if the sign changes at a bend far from this road.
    fn crossing(
        &self,
        other: &TravelLine<'_>,
        between_m: Range<f64>,
        from_right: bool,
    ) -> Option<Crossing> {
        let (mut from_m, mut to_m) = (between_m.start, between_m.end);
        // 60 halvings of a 0.5 m step exceed the precision of f64, so the loop
        // needs no tolerance.
        for _ in 0..60 {
            let middle_m = 0.5 * (from_m + to_m);
            if (self.offset_m(other, middle_m) < 0.0) == from_right {
                from_m = middle_m
            } else {
                to_m = middle_m
            }
        }
        // The side from which the path comes, so that the point lies before
        // the change.
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
        // Distances to a bent road jump where its nearest piece changes. Only a
        // point on the path itself is a crossing.
        ((at.lateral_m - self.lateral_m).abs() < ON_M).then_some(crossing)
    }
}

/// Returns whether `a` has right of way over `b` where their paths cross.
///
/// The road of higher priority goes first. On equal roads, an agent yields to
/// traffic from its right. A left turn therefore yields to oncoming traffic.
/// Paths that never cross have no order.
pub fn goes_first(crossings: &[Crossing], [a, b]: [Priority; 2]) -> bool {
    match (crossings.first(), a.cmp(&b)) {
        (None, _) => false,
        (Some(_), core::cmp::Ordering::Greater) => true,
        (Some(_), core::cmp::Ordering::Less) => false,
        // Traffic from the right continues to the left.
        (Some(crossing), core::cmp::Ordering::Equal) => libm::sin(crossing.turned_rad) < 0.0,
    }
}
