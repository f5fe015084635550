//! Plans away from their own road: trajectories, other roads, jumps.
//!
//! A plan that leaves a trajectory goes on along the road on whose lanes it is: its own
//! one if possible. Beside all lanes it goes straight on.

use std::sync::Arc;

use super::super::motion_profile::SAME_S;
use super::super::plan_way::{PlanWay, TimedLegs, TrajectoryLaw, is_on};
use super::{PlanRun, SAME_M, SampleSpan, Stray};
use crate::road::{Course, Road, wrapped};
use crate::sim::Pose;

/// Displacement from which a body jumps, as it cannot drive there.
const JUMP_M: f64 = 0.01;
/// Halvings that find an instant within a sample.
const HALVINGS: u32 = 60;

impl PlanRun {
    /// Returns the course that the plan follows, which is `own` for its own road.
    pub(super) fn course<'a>(&'a self, own: &'a Course) -> &'a Course {
        self.way.as_deref().map_or(own, PlanWay::course)
    }

    /// Returns another road of the world, if the plan follows one.
    pub(in super::super) fn routed(&self) -> Option<(&Course, &Road)> {
        match self.way.as_deref() {
            Some(PlanWay::Road(course, road)) => Some((course, road)),
            _ => None,
        }
    }

    /// Returns the pose of the point that stories move, without deviations.
    fn reference(&self, own: &Course) -> Pose {
        let front = self.front(self.course(own), Stray::default(), self.planned_rad);
        front.ahead(-self.carried.front_m)
    }

    /// Goes on along a way from a pose of the reference point. `None` is the own road.
    fn take_way(&mut self, way: Option<Arc<PlanWay>>, own: &Course, at: &Pose) {
        self.way = way;
        let on = self.course(own).locate(at);
        let bent_rad = wrapped(self.heading_rad - self.planned_rad);
        // From now on the laws move the reference point, as stories do.
        self.carried.lever_m = self.carried.front_m;
        self.carried.facing_rad = on.heading_rad;
        (self.s_m, self.lateral_m) = (on.s_m, on.lateral_m);
        self.planned_rad = on.heading_rad;
        self.heading_rad = wrapped(on.heading_rad + bent_rad);
        // Motions of the old way have no meaning on the new one.
        (self.swing, self.beside, self.legs) = (None, None, None);
    }

    /// Goes on along the road on whose lanes a pose is, or straight on.
    fn land_at(&mut self, span: SampleSpan<'_>, at: &Pose) {
        let on_foot = self.carried.on_foot;
        let way = if is_on(span.course, span.road, at, on_foot) {
            None
        } else {
            let courses = span.network.courses().iter().enumerate();
            let mut roads = courses.map(|(i, course)| (course, span.spec.road_at(i)));
            let found = roads.find(|(course, road)| is_on(course, road, at, on_foot));
            Some(Arc::new(match found {
                Some((course, road)) => PlanWay::Road(course.clone(), road.clone()),
                None => PlanWay::Straight(Course::straight_from(*at)),
            }))
        };
        self.take_way(way, span.course, at);
    }

    /// Leaves a trajectory, if the plan is on one.
    pub(super) fn leave_curve(&mut self, span: SampleSpan<'_>) {
        if self.way.as_deref().is_some_and(|way| way.curve().is_some()) {
            self.land_at(span, &self.reference(span.course));
        }
    }

    /// Goes on along a road with lanes, even from beside them.
    pub(super) fn find_lanes(&mut self, span: SampleSpan<'_>) {
        self.leave_curve(span);
        if let Some(PlanWay::Straight(_)) = self.way.as_deref() {
            let at = self.reference(span.course);
            self.take_way(None, span.course, &at);
        }
    }

    /// Goes on along another road of the world.
    pub(super) fn take_road(&mut self, number: usize, span: SampleSpan<'_>) {
        let course = span.network.courses()[number].clone();
        let road = span.spec.road_at(number).clone();
        let at = self.reference(span.course);
        self.take_way(
            Some(Arc::new(PlanWay::Road(course, road))),
            span.course,
            &at,
        );
    }

    /// Is at a pose of the reference point at once.
    pub(super) fn jump_to(&mut self, at: &Pose, road: Option<usize>, span: SampleSpan<'_>) {
        // The displacement ends with the jump, and the added speed goes on.
        self.stray = Stray {
            ahead_mps: self.stray.ahead_mps,
            left_mps: self.stray.left_mps,
            ..Stray::default()
        };
        self.is_absent = false;
        self.land_at(span, at);
        // The landing chose a road by the place, and a named road replaces it.
        if let Some(number) = road {
            self.take_road(number, span);
        }
        self.jumped(span.course);
    }

    /// Stands at a pose out of reach until it jumps again.
    pub(super) fn vanish(&mut self, to: &Pose, at_s: f64, own: &Course) {
        let way = PlanWay::Straight(Course::straight_from(*to));
        self.take_way(Some(Arc::new(way)), own, to);
        self.leave_speed(at_s, 0.0);
        self.stray = Stray::default();
        self.is_absent = true;
        self.jumped(own);
    }

    pub(super) fn jumped(&mut self, own: &Course) {
        self.has_jumped = true;
        // A jump is no turn.
        self.last.pose = self.pose(own);
    }

    /// Returns whether it has been put somewhere else, and forgets it.
    pub(in super::super) fn take_jump(&mut self) -> bool {
        core::mem::take(&mut self.has_jumped)
    }

    /// Follows a trajectory from an instant on.
    pub(super) fn follow(&mut self, law: &TrajectoryLaw, at_s: f64, own: &Course) {
        let before = self.reference(own);
        let now_mps = self.ramp.speed_mps(at_s);
        (self.swing, self.beside, self.legs) = (None, None, None);
        (self.s_m, self.lateral_m) = (law.from_m, 0.0);
        if let Some(clock) = law.clock {
            self.leave_speed(at_s, now_mps);
            let (begun_m, legs) = TimedLegs::of(law, clock, at_s, now_mps);
            self.s_m = begun_m;
            self.legs = Some(legs);
        }
        self.carried.lever_m = self.carried.front_m;
        self.carried.facing_rad = 0.0;
        self.planned_rad = law.path.turned_rad(self.s_m);
        self.heading_rad = self.planned_rad;
        self.way = Some(Arc::new(PlanWay::Curve(Arc::clone(&law.path))));
        // A trajectory may begin where the body cannot drive to.
        let there = before.frame().to_local(self.reference(own).point_m());
        if libm::hypot(there[0], there[1]) > JUMP_M {
            self.jumped(own);
        }
    }

    /// Begins the parts of a trajectory that are due, and leaves it at its end.
    pub(super) fn settle_way(&mut self, time_s: f64, span: SampleSpan<'_>) {
        while let Some(leg) = self.legs.as_mut().and_then(|legs| legs.begin(time_s)) {
            self.ramp = leg.ramp();
            self.s_m = leg.s_m;
        }
        let Some(curve) = self.way.as_deref().and_then(PlanWay::curve) else {
            return;
        };
        match &self.legs {
            Some(legs) if legs.ends_s <= time_s + SAME_S => {
                self.s_m = legs.end_m;
                self.leave_speed(time_s, self.ramp.speed_mps(time_s));
            }
            None if curve.length_m - SAME_M <= self.s_m => {}
            _ => return,
        }
        self.leave_curve(span);
        self.way_ended_s = time_s;
    }

    /// Returns the instant at which a trajectory without times ends, if it does so before
    /// `to_s`.
    ///
    /// No change of speed begins or ends in between.
    pub(super) fn way_end_s(&self, from_s: f64, to_s: f64) -> f64 {
        let curve = self.way.as_deref().and_then(PlanWay::curve);
        let Some(curve) = curve.filter(|_| self.legs.is_none()) else {
            return to_s;
        };
        let left_m = curve.length_m - self.s_m;
        if self.ramp.way_m(from_s, to_s) <= left_m {
            return to_s;
        }
        let (mut before_s, mut after_s) = (from_s, to_s);
        for _ in 0..HALVINGS {
            let middle_s = 0.5 * (before_s + after_s);
            if self.ramp.way_m(from_s, middle_s) < left_m {
                before_s = middle_s;
            } else {
                after_s = middle_s;
            }
        }
        // The later end, at which the way is certainly driven.
        after_s
    }

    /// Returns the heading relative to a trajectory, if the plan is on one.
    pub(super) fn turned_rad(&self) -> Option<f64> {
        let curve = self.way.as_deref().and_then(PlanWay::curve)?;
        Some(curve.turned_rad(self.s_m))
    }
}
