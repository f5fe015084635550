//! Lateral places that a plan keeps to another agent.

use super::super::motion_profile::{SAME_S, Swing};
use super::super::story_law::BesideLaw;
use super::{PlanRun, SampleSpan};
use crate::road::ChangeShape;

/// Step in which a limited lateral motion is computed, whatever the sample time.
const STEP_S: f64 = 0.01;
/// Distance at which a place counts as reached.
const REACHED_M: f64 = 0.01;

/// Lateral place to another agent, in motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct BesideRun {
    law: BesideLaw,
    lateral_mps: f64,
    /// Instant up to which the motion is planned.
    planned_s: f64,
    is_reached: bool,
}

/// Place of the other agent, which is taken to keep its velocity within a sample.
struct BesideTarget {
    since_s: f64,
    lateral_m: f64,
    lateral_mps: f64,
}

impl BesideTarget {
    fn at(&self, time_s: f64) -> f64 {
        self.lateral_m + self.lateral_mps * (time_s - self.since_s)
    }
}

impl BesideRun {
    pub(super) fn new(law: BesideLaw, at_s: f64) -> BesideRun {
        BesideRun {
            law,
            lateral_mps: 0.0,
            planned_s: at_s,
            is_reached: false,
        }
    }

    /// Returns the end of the motion, as far as it is known now.
    pub(super) fn ends_s(&self) -> f64 {
        if self.is_reached {
            self.planned_s
        } else {
            f64::INFINITY
        }
    }

    /// Moves from a lateral place up to an instant, and returns the place then.
    fn move_to(&mut self, from_m: f64, to_s: f64, target: &BesideTarget, speed_mps: f64) -> f64 {
        let BesideLaw {
            most_mps,
            most_accel_mps2,
            most_decel_mps2,
            ..
        } = self.law;
        let mut at_m = from_m;
        while self.planned_s < to_s - SAME_S {
            let next_s = (((self.planned_s / STEP_S + 1e-6).floor() + 1.0) * STEP_S).min(to_s);
            let for_s = next_s - self.planned_s;
            let left_m = target.at(next_s) - at_m;
            // As fast as it can still stop beside the target.
            let stopping_mps = (2.0 * most_decel_mps2 * left_m.abs()).sqrt();
            let closing_mps = stopping_mps.min(left_m.abs() / for_s);
            let sideways_mps = target.lateral_mps + closing_mps.copysign(left_m);
            let limit_mps = most_mps.min(speed_mps);
            let wanted_mps = sideways_mps.clamp(-limit_mps, limit_mps);
            let slows = wanted_mps.abs() < self.lateral_mps.abs();
            let rate = if slows {
                most_decel_mps2
            } else {
                most_accel_mps2
            };
            let change_mps = wanted_mps - self.lateral_mps;
            self.lateral_mps += change_mps.clamp(-rate * for_s, rate * for_s);
            at_m += self.lateral_mps * for_s;
            self.planned_s = next_s;
        }
        at_m
    }
}

impl PlanRun {
    fn target_of(&self, law: &BesideLaw, span: SampleSpan<'_>) -> BesideTarget {
        let other = (span.motion_of)(law.of, span.from_s);
        let point = other.pose.ahead(-law.front_m);
        let course = self.course(span.course);
        let on = course.locate(&point);
        let away_m = if law.in_its_axes {
            // To the line beside the other, straight across the road.
            let own = course.pose(self.s_m, self.lateral_m);
            let left_m = point.frame().to_local(own.point_m())[1];
            self.lateral_m + (law.by_m - left_m) / libm::cos(on.heading_rad)
        } else {
            on.lateral_m + law.by_m
        };
        BesideTarget {
            since_s: span.from_s,
            lateral_m: away_m,
            lateral_mps: on.velocity_mps(other.speed_mps, 0.0).y,
        }
    }

    /// Plans the lateral motion to another agent, up to the end of a sample.
    pub(super) fn aim(&mut self, now_s: f64, span: SampleSpan<'_>) {
        let Some(mut beside) = self.beside else {
            return;
        };
        if beside.is_reached {
            (self.beside, self.swing) = (None, None);
            self.way_ended_s = beside.planned_s;
            return;
        }
        let law = beside.law;
        let target = self.target_of(&law, span);
        let (to_s, speed_mps) = (span.to_s, self.ramp.speed_mps(now_s));
        let for_s = to_s - now_s;
        beside.planned_s = now_s;
        let (to_m, jumps) = if law.is_unlimited() {
            let to_m = target.at(to_s);
            beside.planned_s = to_s;
            (to_m, (to_m - self.lateral_m).abs() > speed_mps * for_s)
        } else {
            let to_m = beside.move_to(self.lateral_m, to_s, &target, speed_mps);
            (to_m, false)
        };
        beside.is_reached = !law.continuous && (target.at(to_s) - to_m).abs() <= REACHED_M;
        let by_m = to_m - self.lateral_m;
        // The sample has the first half of an even motion, so that it goes on at its end.
        let halves = if jumps { 1.0 } else { 2.0 };
        self.swing = Some(Swing {
            begins_s: now_s,
            lasts_s: if jumps { 0.0 } else { halves * for_s },
            by_m: halves * by_m,
            shape: ChangeShape::Linear,
            is_slanted: true,
        });
        self.beside = Some(beside);
    }
}
