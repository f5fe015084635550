//! Lateral places that a plan keeps to another agent, in steps that no sample time changes.

use super::super::beside_law::{BesideLaw, BesideTarget};
use super::super::motion_profile::{AT_ONCE_MPS, SAME_S, Swing, next_step_s};
use super::{PlanRun, SampleSpan};
use crate::road::ChangeShape;

/// Distance at which a place counts as reached.
const REACHED_M: f64 = 0.01;

impl PlanRun {
    fn target_of(&self, law: &BesideLaw, at_s: f64, span: SampleSpan<'_>) -> BesideTarget {
        let other = (span.motion_of)(law.of, at_s);
        let point = other.pose.ahead(-law.front_m);
        let course = self.course(span.course);
        let on = course.locate(&point);
        let lateral_m = if law.in_its_axes {
            // To the line beside the other, straight across the road.
            let own = course.pose(self.s_m, self.lateral_m);
            let left_m = point.frame().to_local(own.point_m())[1];
            self.lateral_m + (law.by_m - left_m) / libm::cos(on.heading_rad)
        } else {
            on.lateral_m + law.by_m
        };
        BesideTarget {
            lateral_m,
            lateral_mps: on.velocity_mps(other.speed_mps, 0.0).y,
        }
    }

    /// Plans the lateral motion to another agent, up to the next step.
    pub(super) fn aim(&mut self, time_s: f64, span: SampleSpan<'_>) {
        let Some(mut beside) = self.beside else {
            return;
        };
        // The end of a sample belongs to the next one.
        if time_s < beside.next_s - SAME_S || span.to_s - SAME_S <= time_s {
            return;
        }
        let law = beside.law;
        let now = self.target_of(&law, time_s, span);
        if !law.continuous && (now.lateral_m - self.lateral_m).abs() <= REACHED_M {
            (self.beside, self.swing) = (None, None);
            self.way_ended_s = time_s;
            return;
        }
        let next_s = next_step_s(time_s).min(span.to_s);
        let for_s = next_s - time_s;
        let target = self.target_of(&law, next_s, span);
        let speed_mps = self.ramp.speed_mps(time_s);
        let by_m = beside.step_m(self.lateral_m, &target, speed_mps, for_s);
        beside.next_s = next_s;
        // Only a place without limits may be reached faster than the body drives.
        let jumps = law.is_unlimited() && by_m.abs() > speed_mps * for_s;
        // The step has the first half of an even motion, which so goes on at its end.
        let halves = if jumps { 1.0 } else { 2.0 };
        self.swing = Some(Swing {
            begins_s: time_s,
            lasts_s: if jumps {
                by_m.abs() / AT_ONCE_MPS
            } else {
                halves * for_s
            },
            by_m: halves * by_m,
            shape: ChangeShape::Linear,
            is_slanted: true,
            over: None,
        });
        self.beside = Some(beside);
    }
}
