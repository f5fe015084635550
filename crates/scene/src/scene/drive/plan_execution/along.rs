//! Speeds that follow another agent, in steps that no sample time changes.

use core::f64::consts::SQRT_2;

use super::super::along_law::{AlongAim, AlongLaw, AlongRun};
use super::super::motion_profile::{SAME_S, SpeedRamp, next_step_s};
use super::super::story_law::greatest_rate;
use super::{PlanRun, SampleSpan, Stray};
use crate::road::{ChangeShape, Course};
use crate::sim::Pose;
use crate::story::axis::AxisSpan;
use crate::story::values::{Dimension, DistanceOrTime, FinalSpeed};
use crate::story::view::{AgentMotion, AgentSize};

/// Distance from the aim that counts as reached.
const REACHED_M: f64 = 0.1;
/// Stiffness of the approach to a distance, for each m/s² of its limit.
const STIFFNESS_PER_M: f64 = 0.4;
/// Displacement from which a body jumps, as it cannot drive there.
const JUMP_M: f64 = 0.01;
/// Distance below which two places are the same.
const SAME_M: f64 = 1e-5;
/// Speed below which an agent never arrives.
const STANDS_MPS: f64 = 1e-3;

/// Time and way that are left to a meeting.
struct ArrivalAhead {
    own_m: f64,
    its_m: f64,
    its_mps: f64,
}

fn size_of(agent: usize, span: SampleSpan<'_>) -> AgentSize {
    let body = &span.spec.agents[agent].body;
    AgentSize {
        length_m: body.length_m,
        width_m: body.width_m,
        front_m: body.front_m(),
    }
}

impl PlanRun {
    /// Begins a motion that depends on another agent.
    pub(super) fn begin_along(&mut self, law: AlongLaw, at_s: f64, span: SampleSpan<'_>) {
        let now_mps = self.ramp.speed_mps(at_s);
        let mut along = AlongRun::new(law, at_s);
        if let AlongAim::Speed {
            factor,
            by_mps,
            shape,
            size,
        } = law.aim
        {
            let aim_mps = factor * (span.motion_of)(law.of, at_s).speed_mps + by_mps;
            let Some(shape) = shape else {
                // A step is at once, whatever the performance, which limits what follows.
                let first_mps = aim_mps.clamp(0.0, law.limits.most_mps);
                self.end_along(at_s, first_mps);
                self.along = Some(along);
                return;
            };
            let off_mps = now_mps - aim_mps;
            let lasting = match size {
                Dimension::Distance(way_m) => {
                    // A mean speed of 0 drives no way and must not divide.
                    let mean_mps = (0.5 * (now_mps + aim_mps)).max(STANDS_MPS);
                    Dimension::Time(way_m / mean_mps)
                }
                size => size,
            };
            let lasts_s = match lasting {
                // Without a difference the rate is 0 as well, and 0 / 0 is no duration.
                Dimension::Time(time_s) if off_mps == 0.0 => time_s,
                size => shape.peak() * off_mps.abs() / greatest_rate(shape, size, [off_mps, 0.0]),
            };
            along.from_mps = now_mps;
            // The share of the old speed that is left, which falls from 1 to 0 like a
            // speed.
            along.left = SpeedRamp {
                begins_s: at_s,
                from_mps: 1.0,
                to_mps: 0.0,
                rate_mps2: shape.peak() / lasts_s,
                shape,
            };
        }
        self.along = Some(along);
    }

    /// Plans the speed up to the next step, if it depends on another agent.
    pub(super) fn pursue(&mut self, time_s: f64, span: SampleSpan<'_>) {
        let Some(along) = self.along else {
            return;
        };
        // No step passes an arrival, a common instant or the end of the sample.
        let next_s = self
            .arrival_s(&along.law, time_s, span)
            .min(next_step_s(time_s))
            .min(span.to_s);
        let [from_mps, to_mps] = match along.law.aim {
            AlongAim::Speed { factor, by_mps, .. } => {
                let aim_mps = |at_s: f64| {
                    let other_mps = (span.motion_of)(along.law.of, at_s).speed_mps;
                    let left = along.left.speed_mps(at_s);
                    (factor * other_mps + by_mps) * (1.0 - left) + along.from_mps * left
                };
                self.limited(
                    &along.law,
                    [aim_mps(time_s), aim_mps(next_s)],
                    time_s,
                    next_s,
                )
            }
            AlongAim::Distance { .. } => {
                let Some(speeds_mps) = self.keep_distance(along.law, time_s, next_s, span) else {
                    return;
                };
                speeds_mps
            }
            AlongAim::Synchronize { .. } => {
                let Some(wanted_mps) = self.synchronize(along.law, time_s, next_s, span) else {
                    return;
                };
                self.limited(&along.law, wanted_mps, time_s, next_s)
            }
        };
        // The end of a sample belongs to the next one.
        if span.to_s - SAME_S <= time_s {
            // A motion that has just begun has its first speed, others that of their step.
            if !along.is_begun {
                self.ramp = SpeedRamp {
                    begins_s: time_s,
                    ..SpeedRamp::steady(from_mps)
                };
            }
            return;
        }
        let rate_mps2 = (to_mps - from_mps).abs() / (next_s - time_s);
        self.ramp = SpeedRamp {
            begins_s: time_s,
            from_mps,
            to_mps,
            rate_mps2,
            shape: ChangeShape::Linear,
        };
        self.along = Some(AlongRun {
            accel_mps2: (to_mps - from_mps) / (next_s - time_s),
            next_s,
            is_begun: true,
            ..along
        });
    }

    /// Returns speeds at both ends of a step as near to wanted ones as limits allow.
    fn limited(&self, law: &AlongLaw, wanted_mps: [f64; 2], time_s: f64, next_s: f64) -> [f64; 2] {
        let now_mps = self.ramp.speed_mps(time_s);
        // In no time a speed changes only where nothing limits it.
        let from_mps = law.limits.nearest_mps(now_mps, wanted_mps[0], 0.0);
        let to_mps = law
            .limits
            .nearest_mps(from_mps, wanted_mps[1], next_s - time_s);
        [from_mps, to_mps]
    }

    /// Ends the motion. The body keeps a speed.
    fn end_along(&mut self, at_s: f64, speed_mps: f64) {
        self.along = None;
        self.ramp = SpeedRamp {
            begins_s: at_s,
            ..SpeedRamp::steady(speed_mps)
        };
    }

    fn planned_front(&self, course: &Course) -> Pose {
        self.front(course, Stray::default(), self.planned_rad)
    }

    /// Returns the way that the actor is behind its place at a distance to the other.
    fn behind_m(&self, law: &AlongLaw, other: &AgentMotion, span: SampleSpan<'_>) -> f64 {
        let AlongAim::Distance {
            distance,
            leads,
            freespace,
            on_road,
            ..
        } = law.aim
        else {
            return 0.0;
        };
        let course = self.course(span.course);
        let own = self.planned_front(course);
        let towards = self.carried.direction().0.signum();
        let on_axis = |pose: &Pose| {
            if on_road {
                towards * course.locate(pose).s_m
            } else {
                own.frame().to_local(pose.point_m()).x
            }
        };
        let own_size = AgentSize {
            length_m: self.carried.length_m,
            width_m: self.carried.width_m,
            front_m: self.carried.front_m,
        };
        let mine = AxisSpan::of(own_size, &own, freespace, on_axis);
        let its = AxisSpan::of(size_of(law.of, span), &other.pose, freespace, on_axis);
        let away_m = match distance {
            DistanceOrTime::Metres(away_m) => away_m,
            DistanceOrTime::Seconds(time_s) => time_s * other.speed_mps.abs(),
        };
        if leads {
            its.most_m + away_m - mine.least_m
        } else {
            its.least_m - away_m - mine.most_m
        }
    }

    /// Returns the speed that keeps the present distance to another along its axis.
    fn pace_mps(&self, law: &AlongLaw, other: &AgentMotion, span: SampleSpan<'_>) -> f64 {
        let course = self.course(span.course);
        if let AlongAim::Distance { on_road: false, .. } = law.aim {
            let own = self.planned_front(course);
            let (sin, cos) = libm::sincos(own.heading_rad);
            let [x_mps, y_mps] = other.velocity_mps();
            // The axis turns with the own road.
            let left_m = own.frame().to_local(other.pose.point_m()).y;
            let towards = self.carried.direction().0.signum();
            let bend_per_m = towards * course.curvature_per_m(self.s_m);
            let turn_per_m = bend_per_m / (1.0 - towards * bend_per_m * self.lateral_m);
            return (x_mps * cos + y_mps * sin) / (1.0 - turn_per_m * left_m);
        }
        let on = course.locate(&other.pose);
        let along_mps = on.velocity_mps(other.speed_mps, other.lateral_mps).x;
        // Beside a bend a body passes more or fewer stations than it drives
        // metres.
        let stations_mps = along_mps / (1.0 - on.curvature_per_m * on.lateral_m);
        let towards = self.carried.direction().0.signum();
        let shorter = 1.0 - course.curvature_per_m(self.s_m) * self.lateral_m;
        towards * stations_mps * shorter
    }

    /// Returns the speeds of a step, or `None` at the end of the motion.
    fn keep_distance(
        &mut self,
        law: AlongLaw,
        time_s: f64,
        next_s: f64,
        span: SampleSpan<'_>,
    ) -> Option<[f64; 2]> {
        let AlongAim::Distance {
            distance,
            leads,
            continuous,
            ..
        } = law.aim
        else {
            return None;
        };
        let [now, next] = [time_s, next_s].map(|at_s| (span.motion_of)(law.of, at_s));
        // Plans never reverse.
        let paces_mps = [&now, &next].map(|other| self.pace_mps(&law, other, span).max(0.0));
        let now_mps = self.ramp.speed_mps(time_s);
        let step_s = next_s - time_s;
        let behind_m = self.behind_m(&law, &now, span);
        // Without limits the distance holds at once, so the body is moved and not
        // driven.
        if law.limits.changes_at_once() {
            self.shift(behind_m, span);
            if !continuous {
                self.end_along(time_s, paces_mps[0]);
                return None;
            }
            // A headway in time is a way that grows with the speed.
            let grows_mps = match distance {
                DistanceOrTime::Seconds(time_s) if step_s > 0.0 => {
                    let way_m = time_s * (paces_mps[1] - paces_mps[0]);
                    // A headway that grows makes the leader faster and the
                    // follower slower.
                    if leads {
                        way_m / step_s
                    } else {
                        -way_m / step_s
                    }
                }
                _ => 0.0,
            };
            return Some(paces_mps.map(|pace_mps| (pace_mps + grows_mps).max(0.0)));
        }
        if !continuous && behind_m.abs() <= REACHED_M {
            self.end_along(time_s, now_mps);
            return None;
        }
        // A spring with critical damping, as stiff as the limits are wide.
        // An approach ends with the opposite change, whose limit sets the stiffness.
        let (most_mps2, other_most_mps2) = if behind_m > 0.0 {
            (law.limits.most_decel_mps2, law.limits.most_accel_mps2)
        } else {
            (law.limits.most_accel_mps2, law.limits.most_decel_mps2)
        };
        let width_mps2 = if most_mps2.is_finite() {
            most_mps2
        } else {
            other_most_mps2
        };
        let stiffness = STIFFNESS_PER_M * width_mps2;
        let rate_mps2 = behind_m * stiffness - (now_mps - paces_mps[0]) * 2.0 * stiffness.sqrt();
        let wanted_mps = now_mps + rate_mps2 * step_s;
        Some(self.limited(&law, [now_mps, wanted_mps], time_s, next_s))
    }

    /// Displaces the body along its axis.
    fn shift(&mut self, by_m: f64, span: SampleSpan<'_>) {
        self.s_m += self.carried.direction().0 * by_m;
        if by_m.abs() > JUMP_M {
            self.jumped(span.course);
        }
    }

    /// Returns wanted speeds of a step to a meeting, or `None` at its end.
    fn synchronize(
        &mut self,
        law: AlongLaw,
        time_s: f64,
        next_s: f64,
        span: SampleSpan<'_>,
    ) -> Option<[f64; 2]> {
        let AlongAim::Synchronize {
            tolerance_m,
            its_tolerance_m,
            final_speed,
            steady,
            ..
        } = law.aim
        else {
            return None;
        };
        let now_mps = self.ramp.speed_mps(time_s);
        let ArrivalAhead {
            own_m,
            its_m,
            its_mps,
        } = self.arrival_ahead(&law, time_s, span);
        if its_m <= its_tolerance_m.max(SAME_M) || own_m <= tolerance_m.max(SAME_M) {
            self.end_along(time_s, now_mps);
            return None;
        }
        if its_mps <= STANDS_MPS {
            // It never arrives, so neither does the actor.
            return Some([0.0, 0.0]);
        }
        let left_s = its_m / its_mps;
        let Some(final_speed) = final_speed else {
            // Any speed may be the last one, so an even one arrives in time.
            let even_mps = own_m / left_s;
            return Some([even_mps, even_mps]);
        };
        let end_mps = match final_speed {
            FinalSpeed::Absolute(end_mps) => end_mps,
            FinalSpeed::RelativeToMaster(by_mps) => (its_mps + by_mps).max(0.0),
        };
        let steady_m = match steady {
            Some(DistanceOrTime::Metres(steady_m)) => steady_m,
            Some(DistanceOrTime::Seconds(steady_s)) => steady_s * end_mps,
            None => 0.0,
        };
        // A last speed of 0 has no steady part.
        let steady_s = if end_mps > 0.0 {
            steady_m / end_mps
        } else {
            0.0
        };
        let (way_m, for_s) = (own_m - steady_m, left_s - steady_s);
        let step_s = next_s - time_s;
        // With less than a step left there is no room for a change.
        if for_s <= step_s || way_m <= 0.0 {
            return Some([end_mps, end_mps]);
        }
        let approach = SynchronizeRamps {
            way_m,
            for_s,
            now_mps,
            end_mps,
        };
        Some([now_mps, approach.after_mps(step_s)])
    }

    /// Returns the instant at which the other arrives, as far as it is known now.
    fn arrival_s(&self, law: &AlongLaw, time_s: f64, span: SampleSpan<'_>) -> f64 {
        let AlongAim::Synchronize {
            its_tolerance_m, ..
        } = law.aim
        else {
            return f64::INFINITY;
        };
        let ArrivalAhead { its_m, its_mps, .. } = self.arrival_ahead(law, time_s, span);
        let left_m = its_m - its_tolerance_m;
        if its_mps <= STANDS_MPS || left_m <= SAME_M {
            return f64::INFINITY;
        }
        time_s + left_m / its_mps
    }

    fn arrival_ahead(&self, law: &AlongLaw, time_s: f64, span: SampleSpan<'_>) -> ArrivalAhead {
        let AlongAim::Synchronize { to, its, .. } = law.aim else {
            return ArrivalAhead {
                own_m: 0.0,
                its_m: 0.0,
                its_mps: 0.0,
            };
        };
        let course = self.course(span.course);
        let reference = self.planned_front(course).ahead(-self.carried.front_m);
        let towards = self.carried.direction().0.signum();
        let own_m = towards * (course.locate(&to).s_m - course.locate(&reference).s_m);
        let other = (span.motion_of)(law.of, time_s);
        let point = other.pose.ahead(-size_of(law.of, span).front_m);
        let on = span.network.locate(law.of, &point);
        // Its direction may be against its road, whose stations then fall.
        let facing = libm::cos(on.heading_rad).signum();
        ArrivalAhead {
            own_m,
            its_m: facing * (span.network.locate(law.of, &its).s_m - on.s_m),
            its_mps: other.speed_mps,
        }
    }
}

/// Way and time that are left before the steady part of a meeting.
#[derive(Clone, Copy, Debug)]
struct SynchronizeRamps {
    way_m: f64,
    for_s: f64,
    now_mps: f64,
    end_mps: f64,
}

impl SynchronizeRamps {
    /// Returns the speed after a step.
    ///
    /// It changes evenly up to an apex, and then back at the same rate. With too much
    /// time the body stops and waits. OpenSCENARIO leaves this open, so it is as in
    /// esmini.
    fn after_mps(self, step_s: f64) -> f64 {
        let SynchronizeRamps {
            way_m,
            for_s,
            now_mps,
            end_mps,
        } = self;
        let mean_mps = way_m / for_s;
        let away_mps = libm::hypot(mean_mps - now_mps, mean_mps - end_mps) / SQRT_2;
        let apex_mps = if mean_mps > 0.5 * (now_mps + end_mps) {
            mean_mps + away_mps
        } else {
            mean_mps - away_mps
        };
        if apex_mps < 0.0 {
            if now_mps <= 0.0 {
                return 0.0;
            }
            // The ways to and from rest are as the squares of the speeds.
            let squares = now_mps * now_mps + end_mps * end_mps;
            let stops_s = 2.0 * now_mps * way_m / squares;
            return (now_mps * (1.0 - step_s / stops_s)).max(0.0);
        }
        let (first_mps, second_mps) = ((apex_mps - now_mps).abs(), (apex_mps - end_mps).abs());
        if first_mps + second_mps == 0.0 {
            return now_mps;
        }
        let apex_s = for_s * first_mps / (first_mps + second_mps);
        if step_s <= apex_s {
            now_mps + (apex_mps - now_mps) * step_s / apex_s
        } else {
            apex_mps + (end_mps - apex_mps) * (step_s - apex_s) / (for_s - apex_s)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Speed after some time, and the way that is left then.
    fn played(mut approach: SynchronizeRamps, until_s: f64) -> (f64, f64) {
        const STEP_S: f64 = 0.001;
        for _ in 0..(until_s / STEP_S).round() as usize {
            let after_mps = approach.after_mps(STEP_S);
            approach.way_m -= 0.5 * (approach.now_mps + after_mps) * STEP_S;
            approach.for_s -= STEP_S;
            approach.now_mps = after_mps;
        }
        (approach.now_mps, approach.way_m)
    }

    #[test]
    fn an_approach_has_two_even_rates_or_waits_at_rest() {
        let approach = |way_m: f64, now_mps: f64| SynchronizeRamps {
            way_m,
            for_s: 8.0,
            now_mps,
            end_mps: 10.0,
        };
        // Way, first speed, time, speed and the way left: faster, slower and at rest.
        for (way_m, now_mps, until_s, mps, left_m) in [
            (100.0, 10.0, 4.0, 15.0, 50.0),
            (100.0, 10.0, 7.99, 10.0, 0.1),
            (60.0, 10.0, 4.0, 5.0, 30.0),
            (40.0, 0.0, 4.0, 5.0, 30.0),
            (20.0, 10.0, 2.5, 0.0, 10.0),
            (20.0, 10.0, 5.9, 0.0, 10.0),
            (20.0, 10.0, 7.0, 5.0, 7.5),
        ] {
            let found = played(approach(way_m, now_mps), until_s);
            let off = (found.0 - mps).abs().max((found.1 - left_m).abs());
            assert!(off < 0.05, "{way_m} m from {now_mps} m/s: {found:?}");
        }
    }
}
