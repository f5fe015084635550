//! Laws that a story begins and stops, at instants within a sample.

use super::super::motion_profile::{SAME_S, SpeedRamp, Swing};
use super::super::story_law::{DueLaw, LateralTiming, StoryLaw, greatest_rate};
use super::{Arrival, PlanRun, SampleSpan};
use crate::ego::Command;
use crate::road::{ChangeShape, Course, Road};

impl PlanRun {
    /// Adds a law of a story. It begins when the plan passes its instant.
    pub(in super::super) fn add_law(&mut self, law: DueLaw) {
        self.laws.push_back(law);
    }

    /// Begins the laws of a story that are due.
    pub(super) fn begin_laws(&mut self, time_s: f64, road: &Road) {
        while let Some(due) = self.laws.front().copied()
            && due.at_s <= time_s + SAME_S
        {
            self.laws.pop_front();
            self.obey(due, road);
        }
    }

    fn obey(&mut self, DueLaw { at_s, law }: DueLaw, road: &Road) {
        let now_mps = self.ramp.speed_mps(at_s);
        match law {
            StoryLaw::Speed {
                to_mps,
                shape,
                size,
            } => {
                // Plans never reverse.
                let target_mps = to_mps.max(0.0);
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
                lane,
                offset_m,
                shape,
                timing,
            } => {
                let target = lane.unwrap_or_else(|| road.lane_at(self.lateral_m));
                let by_m = road.lane_middle_m(target) + offset_m - self.lateral_m;
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
                self.ramp = SpeedRamp {
                    begins_s: at_s,
                    ..SpeedRamp::steady(now_mps)
                };
            }
            StoryLaw::KeepPlace => self.swing = None,
        }
    }

    /// Returns a copy at an instant within a sample, and its motion then.
    ///
    /// Its laws begin at their own instants on the way.
    pub(in super::super) fn at(
        &self,
        span: SampleSpan<'_>,
        deviation: Command,
        speed_of: impl Fn(&str) -> f64,
    ) -> (PlanRun, Arrival) {
        let mut run = self.clone();
        if span.from_s < span.to_s {
            let arrival = run.advance(span, deviation, speed_of);
            return (run, arrival);
        }
        // A sample of no length has no mean motion, only the laws that begin.
        run.settle(span.to_s, span.road, &speed_of);
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
        self.ramp.ends_s()
    }

    /// Returns the end of the lateral motion, as far as it is known now.
    pub(in super::super) fn swing_ends_s(&self) -> f64 {
        self.swing.map_or(f64::NEG_INFINITY, |it| it.ends_s())
    }
}
