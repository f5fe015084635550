//! Laws that a story begins and stops, at instants within a sample.

use super::super::motion_profile::{SAME_S, SpeedRamp, Swing};
use super::super::plan_way::PlanWay;
use super::super::story_law::{DueLaw, LateralBase, LateralTiming, StoryLaw, greatest_rate};
use super::beside::BesideRun;
use super::{Arrival, PlanRun, SampleSpan};
use crate::ego::Command;
use crate::road::{ChangeShape, Course, Road};

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
        if self.is_absent && !is_place {
            return;
        }
        let now_mps = self.ramp.speed_mps(at_s);
        match law {
            StoryLaw::Speed {
                to_mps,
                shape,
                size,
            } => {
                // Plans never reverse.
                let target_mps = to_mps.max(0.0);
                self.legs = None;
                self.ramp = SpeedRamp {
                    begins_s: at_s,
                    from_mps: now_mps,
                    to_mps: target_mps,
                    rate_mps2: shape.map_or(f64::INFINITY, |shape| {
                        greatest_rate(shape, size, [now_mps, target_mps])
                    }),
                    shape: shape.unwrap_or(ChangeShape::Linear),
                };
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
                let lasts_s = shape.map_or(0.0, |shape| timing.lasts_s(shape, by_m, now_mps));
                self.swing = Some(Swing {
                    begins_s: at_s,
                    lasts_s,
                    by_m,
                    shape: shape.unwrap_or(ChangeShape::Linear),
                    is_slanted: matches!(timing, LateralTiming::Size(_)),
                });
            }
            StoryLaw::KeepSpeed => {
                self.legs = None;
                self.ramp = SpeedRamp {
                    begins_s: at_s,
                    ..SpeedRamp::steady(now_mps)
                };
            }
            StoryLaw::KeepPlace => {
                (self.swing, self.beside) = (None, None);
                self.leave_curve(span);
            }
            StoryLaw::Beside(law) => {
                self.find_lanes(span);
                self.beside = Some(BesideRun::new(law, at_s));
                self.aim(at_s, span);
            }
            StoryLaw::Follow(law) => self.follow(&law, at_s, span.course),
            StoryLaw::Route(number) => self.take_road(number, span),
            StoryLaw::Place { at, road } => self.jump_to(&at, road, span),
            StoryLaw::Vanish { to } => self.vanish(&to, at_s, span.course),
        }
    }

    /// Returns the lateral place from which a target is measured.
    fn base_m(&self, base: LateralBase, own: &Road) -> f64 {
        let road = match self.way.as_deref() {
            Some(PlanWay::Road(_, road)) => road,
            _ => own,
        };
        match base {
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
        self.ramp.accel_mps2(time_s)
    }

    /// Returns the end of the change of speed.
    pub(in super::super) fn ramp_ends_s(&self) -> f64 {
        self.legs
            .as_ref()
            .map_or_else(|| self.ramp.ends_s(), |legs| legs.ends_s)
    }

    /// Returns the end of the lateral motion, infinite if it is not known yet.
    pub(in super::super) fn swing_ends_s(&self) -> f64 {
        let is_on_curve = || self.turned_rad().is_some();
        match (&self.beside, &self.legs, self.swing) {
            (Some(beside), ..) => beside.ends_s(),
            (None, Some(legs), _) => legs.ends_s,
            (None, None, Some(swing)) => swing.ends_s(),
            (None, None, None) if is_on_curve() => f64::INFINITY,
            (None, None, None) => self.way_ended_s,
        }
    }
}
