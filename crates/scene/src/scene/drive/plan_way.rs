//! Ways of plans beside their own roads, and the times of trajectories.

use std::sync::Arc;

use super::motion_profile::{SAME_S, SpeedRamp};
use crate::road::{ChangeShape, Course, Road};
use crate::sim::Pose;
use crate::trajectory::{AtStation, TrajectoryPath};

/// Greatest sine of the angle to a road at which a vehicle still drives along it.
const ALONG_SIN: f64 = 0.87;
/// Distance below which a part of a trajectory counts as a stop.
const SAME_M: f64 = 1e-6;

/// Way that a plan follows instead of its own road.
#[derive(Debug)]
pub(super) enum PlanWay {
    /// Another road of the world, with its course and its lanes.
    Road(Course, Road),
    /// Straight on, away from all lanes.
    Straight(Course),
    /// Curve of a trajectory.
    Curve(Arc<TrajectoryPath>),
}

/// Meaning of the times of a trajectory: their factor and their sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TrajectoryClock {
    pub is_relative: bool,
    pub scale: f64,
    pub offset_s: f64,
}

/// Trajectory that a plan is to follow.
#[derive(Clone, Debug)]
pub(super) struct TrajectoryLaw {
    pub path: Arc<TrajectoryPath>,
    /// `None`: the speed stays that of other laws.
    pub clock: Option<TrajectoryClock>,
    /// Whether speeds change evenly from the present one on, and not at once.
    pub is_smooth: bool,
    /// Station at which it begins.
    pub from_m: f64,
}

/// Part of a trajectory between two times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TimedLeg {
    pub begins_s: f64,
    pub s_m: f64,
    from_mps: f64,
    to_mps: f64,
    /// Duration of the change of speed. The rest of the part keeps its speed.
    lasts_s: f64,
}

/// Parts of a trajectory with times, of which some have begun.
#[derive(Clone, Debug)]
pub(super) struct TimedLegs {
    legs: Arc<[TimedLeg]>,
    next: usize,
    pub ends_s: f64,
    pub end_m: f64,
}

impl PlanWay {
    pub(super) fn course(&self) -> &Course {
        match self {
            PlanWay::Road(course, _) | PlanWay::Straight(course) => course,
            PlanWay::Curve(path) => &path.course,
        }
    }

    /// Returns the curve of a trajectory.
    pub(super) fn curve(&self) -> Option<&TrajectoryPath> {
        match self {
            PlanWay::Curve(path) => Some(path),
            PlanWay::Road(..) | PlanWay::Straight(_) => None,
        }
    }
}

/// Returns whether a place is on the lanes of a road, facing along it.
pub(super) fn is_on(course: &Course, road: &Road, at: &Pose, on_foot: bool) -> bool {
    let on = course.locate(at);
    let mut borders = road.borders_m();
    // Without borders nothing is inside, hence the infinity.
    let right_m = borders.next().unwrap_or(f64::INFINITY);
    let left_m = borders.last().unwrap_or(right_m);
    // A road with pieces ends with them.
    let is_within = course.piece_count() == 0 || (0.0..=course.end_s_m()).contains(&on.s_m);
    let is_along = on_foot || libm::sin(on.heading_rad).abs() < ALONG_SIN;
    is_within && is_along && (right_m..=left_m).contains(&on.lateral_m)
}

impl TimedLeg {
    pub(super) fn ramp(&self) -> SpeedRamp {
        SpeedRamp {
            begins_s: self.begins_s,
            from_mps: self.from_mps,
            to_mps: self.to_mps,
            rate_mps2: (self.to_mps - self.from_mps).abs() / self.lasts_s,
            shape: ChangeShape::Linear,
        }
    }
}

impl TimedLegs {
    /// Returns the parts that are left at an instant, and the place then.
    ///
    /// Times are scaled and then shifted. A distance at which a trajectory begins cuts
    /// off its first part and the time of that part.
    pub(super) fn of(
        law: &TrajectoryLaw,
        clock: TrajectoryClock,
        now_s: f64,
        now_mps: f64,
    ) -> (f64, TimedLegs) {
        let times = &law.path.times_s;
        let cut_s = time_at(times, law.from_m) - times.first().map_or(0.0, |it| it.value);
        let since_s = if clock.is_relative { now_s } else { 0.0 };
        let at_s = |time_s: f64| since_s + clock.scale * (time_s - cut_s) + clock.offset_s;
        let first = AtStation {
            s_m: law.from_m,
            value: at_s(time_at(times, law.from_m)),
        };
        let all = times.iter().map(|it| AtStation {
            s_m: it.s_m,
            value: at_s(it.value),
        });
        let places: Vec<AtStation> = core::iter::once(first)
            .chain(all.filter(|it| it.value > first.value))
            .collect();
        let begun_m = station_at(&places, now_s);
        let mut legs = Vec::new();
        let (mut from_s, mut from_m, mut mps) = (now_s, begun_m, now_mps);
        for place in places.iter().filter(|it| it.value > now_s + SAME_S) {
            let (for_s, way_m) = (place.value - from_s, place.s_m - from_m);
            // Exact places and times leave no freedom, so the speed jumps at
            // each place.
            let (start_mps, end_mps, lasts_s) = if !law.is_smooth {
                (way_m / for_s, way_m / for_s, for_s)
            } else if way_m <= SAME_M {
                (0.0, 0.0, for_s)
            } else {
                // An even change of speed drives the mean of both.
                match 2.0 * way_m / for_s - mps {
                    end_mps if end_mps >= 0.0 => (mps, end_mps, for_s),
                    // It stops there early and waits.
                    _ => (mps, 0.0, 2.0 * way_m / mps),
                }
            };
            legs.push(TimedLeg {
                begins_s: from_s,
                s_m: from_m,
                from_mps: start_mps,
                to_mps: end_mps,
                lasts_s,
            });
            (from_s, from_m, mps) = (place.value, place.s_m, end_mps);
        }
        let legs = TimedLegs {
            legs: legs.into(),
            next: 0,
            ends_s: from_s,
            end_m: from_m,
        };
        (begun_m, legs)
    }

    /// Begins the next part if it is due.
    pub(super) fn begin(&mut self, time_s: f64) -> Option<TimedLeg> {
        let leg = *self.legs.get(self.next)?;
        if leg.begins_s > time_s + SAME_S {
            return None;
        }
        self.next += 1;
        Some(leg)
    }

    /// Returns the next instant at which a part begins, or the last ends.
    pub(super) fn next_s(&self) -> f64 {
        let next = self.legs.get(self.next);
        next.map_or(self.ends_s, |leg| leg.begins_s)
    }
}

/// Returns the first time at a station, or that of the nearest end.
fn time_at(times: &[AtStation], s_m: f64) -> f64 {
    let after = times.partition_point(|it| it.s_m < s_m);
    match (after.checked_sub(1).map(|i| times[i]), times.get(after)) {
        (Some(a), Some(b)) => a.value + (b.value - a.value) * (s_m - a.s_m) / (b.s_m - a.s_m),
        (Some(end), None) => end.value,
        (None, end) => end.map_or(0.0, |it| it.value),
    }
}

/// Returns the station at a time, or that of the nearest end.
fn station_at(places: &[AtStation], time_s: f64) -> f64 {
    let after = places.partition_point(|it| it.value <= time_s);
    match (after.checked_sub(1).map(|i| places[i]), places.get(after)) {
        (Some(a), Some(b)) => a.s_m + (b.s_m - a.s_m) * (time_s - a.value) / (b.value - a.value),
        (Some(end), None) => end.s_m,
        (None, end) => end.map_or(0.0, |it| it.s_m),
    }
}
