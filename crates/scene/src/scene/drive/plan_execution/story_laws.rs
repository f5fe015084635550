//! Laws that a story begins and stops, at instants within a sample.

use std::collections::VecDeque;

use super::super::along_law::SpeedLimits;
use super::super::beside_law::BesideRun;
use super::super::motion_profile::{AT_ONCE_MPS, SAME_S, SpeedRamp, Swing};
use super::super::plan_way::PlanWay;
use super::super::story_law::{DueLaw, LateralBase, LateralTiming, StoryLaw, greatest_rate};
use super::{Arrival, PlanRun, SampleSpan};
use crate::ego::Command;
use crate::road::{ChangeShape, Course, Road};
use crate::story::values::SpeedPoint;

impl PlanRun {
    /// Adds a law of a story. It begins when the plan passes its instant.
    pub(in super::super) fn add_law(&mut self, law: DueLaw) {
        self.laws.push_back(law);
    }

    /// Begins the laws of a story that are due.
    pub(super) fn begin_laws(&mut self, time_s: f64, span: SampleSpan<'_>) {
        while let Some(due) = self.laws.pop_front_if(|due| due.at_s <= time_s + SAME_S) {
            self.obey(due, span);
        }
    }

    fn obey(&mut self, DueLaw { at_s, law }: DueLaw, span: SampleSpan<'_>) {
        let is_place = matches!(law, StoryLaw::Place { .. } | StoryLaw::Vanish { .. });
        // An absent body obeys nothing until it is put somewhere.
        if self.is_absent && !is_place {
            return;
        }
        let now_mps = self.ramp.speed_mps(at_s);
        match law {
            StoryLaw::Speed {
                to_mps,
                shape,
                size,
                limits,
            } => {
                // Plans never reverse.
                let target_mps = to_mps.clamp(0.0, limits.most_mps);
                self.leave_speed(at_s, now_mps);
                // A step is at once, whatever the performance.
                let rate_mps2 = shape.map_or(f64::INFINITY, |shape| {
                    let wanted_mps2 = greatest_rate(shape, size, [now_mps, target_mps]);
                    wanted_mps2.min(limits.most_rate_mps2(now_mps, target_mps))
                });
                self.ramp = SpeedRamp {
                    begins_s: at_s,
                    from_mps: now_mps,
                    to_mps: target_mps,
                    rate_mps2,
                    shape: shape.unwrap_or(ChangeShape::Linear),
                };
            }
            StoryLaw::Profile {
                base_mps,
                points,
                limits,
            } => {
                self.leave_speed(at_s, now_mps);
                self.profile = profile_of(at_s, now_mps, base_mps, &points, limits);
                self.begin_profile(at_s);
            }
            StoryLaw::Along(law) => {
                self.leave_speed(at_s, now_mps);
                self.begin_along(law, at_s, span);
            }
            StoryLaw::Lateral {
                from,
                offset_m,
                shape,
                timing,
            } => {
                self.find_lanes(span);
                let from_m = self.base_m(from, span.road);
                let by_m = from_m + offset_m - self.lateral_m;
                self.beside = None;
                // A jump, too, has a duration, in which it is seen to happen.
                let at_once_s = by_m.abs() / AT_ONCE_MPS;
                let lasts_s = shape.map_or(at_once_s, |shape| timing.lasts_s(shape, by_m));
                self.swing = Some(Swing {
                    begins_s: at_s,
                    lasts_s,
                    by_m,
                    shape: shape.unwrap_or(ChangeShape::Linear),
                    is_slanted: matches!(timing, LateralTiming::Size(_)),
                    over: shape.and_then(|shape| timing.way(shape, by_m)),
                });
            }
            StoryLaw::KeepSpeed => self.leave_speed(at_s, now_mps),
            StoryLaw::KeepPlace => {
                (self.swing, self.beside) = (None, None);
                self.leave_curve(span);
            }
            StoryLaw::Beside(law) => {
                self.find_lanes(span);
                self.beside = Some(BesideRun::new(law, at_s));
            }
            StoryLaw::Follow(law) => self.follow(&law, at_s, span.course),
            StoryLaw::Route(number) => self.take_road(number, span),
            StoryLaw::Place { at, road } => self.jump_to(&at, road, span),
            StoryLaw::Vanish { to } => self.vanish(&to, at_s, span.course),
        }
    }

    /// Gives up all that moves it along the path. The body keeps its speed.
    pub(super) fn leave_speed(&mut self, at_s: f64, now_mps: f64) {
        (self.legs, self.along) = (None, None);
        self.profile.clear();
        self.ramp = SpeedRamp {
            begins_s: at_s,
            ..SpeedRamp::steady(now_mps)
        };
    }

    /// Begins the next speed of a profile when the present one is reached.
    pub(super) fn begin_profile(&mut self, time_s: f64) {
        while let Some(next) = self
            .profile
            .pop_front_if(|it| it.begins_s <= time_s + SAME_S)
        {
            self.ramp = next;
        }
    }

    /// Returns the lateral place from which a target is measured.
    fn base_m(&self, base: LateralBase, own: &Road) -> f64 {
        let road = match self.way.as_deref() {
            Some(PlanWay::Road(_, road)) => road,
            _ => own,
        };
        match base {
            // A relative target may lie beyond the lanes of this road.
            LateralBase::Lane(lane) => road.lane_middle_m(lane.min(road.lanes().saturating_sub(1))),
            LateralBase::PresentLane => road.lane_middle_m(road.lane_at(self.lateral_m)),
            LateralBase::Course => 0.0,
        }
    }

    /// Returns a copy at an instant within a sample, and its motion then.
    ///
    /// Its laws begin at their own instants on the way.
    pub(in super::super) fn at(
        &self,
        span: SampleSpan<'_>,
        deviation: Command,
    ) -> (PlanRun, Arrival) {
        let mut run = self.clone();
        if span.from_s < span.to_s {
            let arrival = run.advance(span, deviation);
            return (run, arrival);
        }
        // A sample of no length has no mean motion, only the laws that begin.
        run.settle(span.to_s, span);
        run.pursue(span.to_s, span);
        let arrival = Arrival {
            speed_mps: run.speed_at(span.to_s),
            ..run.last_at(span.course)
        };
        (run, arrival)
    }

    fn last_at(&self, course: &Course) -> Arrival {
        Arrival {
            pose: self.pose(course),
            ..self.last
        }
    }

    /// Returns the speed along the heading, with the deviation.
    fn speed_at(&self, time_s: f64) -> f64 {
        self.ramp.speed_mps(time_s) + self.stray.ahead_mps
    }

    /// Returns the planned acceleration from an instant on.
    pub(in super::super) fn accel_mps2(&self, time_s: f64) -> f64 {
        match &self.along {
            Some(along) => along.accel_mps2(),
            None => self.ramp.accel_mps2(time_s),
        }
    }

    /// Returns whether it depends on the motion of another agent, now or soon.
    pub(in super::super) fn depends(&self) -> bool {
        let mut laws = self.laws.iter();
        self.along.is_some()
            || self.beside.is_some()
            || laws.any(|due| matches!(due.law, StoryLaw::Along(_) | StoryLaw::Beside(_)))
    }

    /// Returns the end of the change of speed, infinite if it is not known yet.
    pub(in super::super) fn ramp_ends_s(&self) -> f64 {
        match (&self.along, &self.legs, self.profile.back()) {
            // Its end is known once it is there.
            (Some(_), ..) => f64::INFINITY,
            (None, Some(legs), _) => legs.ends_s,
            (None, None, Some(last)) => last.ends_s(),
            (None, None, None) => self.ramp.ends_s(),
        }
    }

    /// Returns the end of the lateral motion, infinite if it is not known yet.
    pub(in super::super) fn swing_ends_s(&self) -> f64 {
        let is_on_curve = || self.turned_rad().is_some();
        match (&self.beside, &self.legs, self.swing) {
            // Its end is known once it is there.
            (Some(_), ..) => f64::INFINITY,
            (None, Some(legs), _) => legs.ends_s,
            (None, None, Some(swing)) => swing.ends_s(),
            (None, None, None) if is_on_curve() => f64::INFINITY,
            (None, None, None) => self.way_ended_s,
        }
    }
}

/// Returns the changes of speed of a profile, one after the other, and its end.
fn profile_of(
    at_s: f64,
    now_mps: f64,
    base_mps: f64,
    points: &[SpeedPoint<f64>],
    limits: SpeedLimits,
) -> VecDeque<SpeedRamp> {
    let mut last = SpeedRamp {
        begins_s: at_s,
        ..SpeedRamp::steady(now_mps)
    };
    let mut ramps = VecDeque::new();
    for point in points {
        let from_mps = last.to_mps;
        let to_mps = (base_mps + point.speed_mps).clamp(0.0, limits.most_mps);
        let change_mps = (to_mps - from_mps).abs();
        let most_mps2 = limits.most_rate_mps2(from_mps, to_mps);
        let wanted_s = point.time_s.unwrap_or(0.0);
        ramps.push_back(SpeedRamp {
            begins_s: last.begins_s,
            from_mps,
            to_mps,
            // A speed in no time is a step, which nothing limits.
            rate_mps2: if point.time_s == Some(0.0) {
                f64::INFINITY
            } else {
                (change_mps / wanted_s).min(most_mps2)
            },
            shape: ChangeShape::Linear,
        });
        // Limits make a change last longer, and a speed that stays has a duration, too.
        last = SpeedRamp {
            begins_s: match point.time_s {
                Some(0.0) => last.begins_s,
                _ => last.begins_s + wanted_s.max(change_mps / most_mps2),
            },
            ..SpeedRamp::steady(to_mps)
        };
    }
    ramps.push_back(last);
    ramps
}
