//! Steps of a plan: their instants, and the laws that they begin.

use core::f64::consts::PI;

use super::super::motion_profile::{SAME_S, SpeedRamp, Swing};
use super::super::plan::MotionLaw;
use super::super::plan_way::TimedLegs;
use super::{PlanPhase, PlanRun, SampleSpan};
use crate::road::ChangeShape;

impl PlanRun {
    /// Returns the initial phase of a step that is next from an instant on.
    pub(super) fn turn_of(&self, step: usize, since_s: f64) -> PlanPhase {
        let Some(next) = self.steps.get(step) else {
            return PlanPhase::Over;
        };
        match self.carried.whens.get(step).and_then(Option::as_ref) {
            Some(monitor) => PlanPhase::Waits {
                since_s,
                before: None,
                watch: Box::new(monitor.online()),
            },
            None => PlanPhase::Due(since_s + next.after_s),
        }
    }

    /// Begins and ends the steps that are due.
    pub(super) fn settle(&mut self, time_s: f64, span: SampleSpan<'_>) {
        // A story may replace what would be due below.
        self.begin_laws(time_s, span);
        self.settle_way(time_s, span);
        self.begin_profile(time_s);
        self.settle_steps(time_s, span);
        // The speed may be another one from now on.
        if let Some(swing) = &mut self.swing {
            swing.time_by(&self.ramp, time_s);
        }
    }

    fn settle_steps(&mut self, time_s: f64, span: SampleSpan<'_>) {
        loop {
            match self.phase {
                PlanPhase::Due(at_s) if at_s <= time_s + SAME_S => {
                    self.phase = self.act(at_s, time_s, span);
                }
                PlanPhase::Acts { .. } if self.acts_until_s() <= time_s + SAME_S => {
                    let ends_s = self.acts_until_s();
                    // A walk ends in a stand, whatever its next step is.
                    if let Some(MotionLaw::Walk { .. }) = self.steps[self.step].does.first() {
                        self.ramp = SpeedRamp::steady(0.0);
                    }
                    // Only a step that overlaps ends before its lateral motion.
                    self.swing = self.swing.filter(|it| ends_s + SAME_S < it.ends_s());
                    self.step += 1;
                    self.phase = self.turn_of(self.step, ends_s);
                }
                _ => return,
            }
        }
    }

    /// Returns the end of the acting step, as far as it is known now.
    fn acts_until_s(&self) -> f64 {
        match (&self.phase, &self.swing) {
            (
                PlanPhase::Acts {
                    ends_s,
                    awaits_swing: true,
                },
                Some(swing),
            ) => ends_s.max(swing.ends_s()),
            (PlanPhase::Acts { ends_s, .. }, _) => *ends_s,
            _ => f64::INFINITY,
        }
    }

    pub(super) fn next_change_s(&self, time_s: f64) -> f64 {
        // The end of a motion that may lag is only known once it is there.
        let lags = self.swing.is_some_and(|it| self.may_lag(&it, time_s));
        let step_s = match self.phase {
            PlanPhase::Due(at_s) => at_s,
            PlanPhase::Acts { awaits_swing, .. } if !(awaits_swing && lags) => self.acts_until_s(),
            PlanPhase::Acts { .. } | PlanPhase::Waits { .. } | PlanPhase::Over => f64::INFINITY,
        };
        let swing = self.swing.filter(|_| !lags).map(|it| it.ends_s());
        let law = self.laws.front().map(|law| law.at_s);
        let leg = self.legs.as_ref().map(TimedLegs::next_s);
        let along = self.along.map(|it| it.next_s());
        let beside = self.beside.map(|it| it.next_s);
        let profile = self.profile.front().map(|it| it.begins_s);
        let ramp = Some(self.ramp.ends_s());
        let changes = [Some(step_s), ramp, profile, along, beside, swing, law, leg];
        // Only later instants: `settle` has dealt with the present one.
        let later = changes
            .into_iter()
            .flatten()
            .filter(|at_s| time_s + SAME_S < *at_s);
        later.fold(f64::INFINITY, f64::min)
    }

    /// Begins the laws of a step and returns the phase in which they act.
    ///
    /// The step was due at `at_s`, which may lie before the current time.
    fn act(&mut self, at_s: f64, now_s: f64, span: SampleSpan<'_>) -> PlanPhase {
        let from_mps = self.ramp.speed_mps(now_s);
        let (mut ends_s, mut awaits_swing) = (at_s, false);
        // A copy, because the laws change the run that owns them.
        let laws = self.steps[self.step].does.clone();
        for law in &laws {
            let mut to_speed = |to_mps: f64, rate_mps2: f64, shape: ChangeShape| {
                self.ramp = SpeedRamp {
                    begins_s: at_s,
                    from_mps,
                    // `relative_to` could make it negative, but plans never reverse.
                    to_mps: to_mps.max(0.0),
                    rate_mps2: rate_mps2.abs(),
                    shape,
                };
                self.ramp.ends_s()
            };
            let law_ends_s = match law {
                MotionLaw::Speed {
                    to_mps,
                    relative_to,
                    rate_mps2,
                    shape,
                } => {
                    let shape = shape.unwrap_or(ChangeShape::Linear);
                    let base_mps = relative_to
                        .as_deref()
                        .map_or(0.0, |name| span.speed_of(name));
                    to_speed(base_mps + to_mps, rate_mps2.unwrap_or(f64::INFINITY), shape)
                }
                MotionLaw::Brake { rate_mps2 } => to_speed(0.0, *rate_mps2, ChangeShape::Linear),
                MotionLaw::Walk { speed_mps, way_m } => {
                    to_speed(*speed_mps, f64::INFINITY, ChangeShape::Linear);
                    at_s + way_m / speed_mps
                }
                MotionLaw::LaneChange {
                    by_m,
                    rate_mps,
                    shape,
                } => {
                    let shape = shape.unwrap_or(ChangeShape::Cosine);
                    let lasts_s = match shape {
                        ChangeShape::Cosine => PI * by_m.abs() / (2.0 * rate_mps),
                        shape => shape.peak() * by_m.abs() / rate_mps,
                    };
                    self.changed_m += by_m;
                    self.sway(Swing {
                        begins_s: at_s,
                        lasts_s,
                        by_m: *by_m,
                        shape,
                        is_slanted: true,
                        over: None,
                    })
                }
                MotionLaw::LaneOffset {
                    to_m,
                    most_lateral_mps2,
                } => {
                    let lane = span.road.lane_at(self.start_m);
                    let middle_m = span.road.lane_middle_m(lane) + self.changed_m;
                    let by_m = middle_m + to_m - self.lateral_m;
                    let lasts_s = PI * (by_m.abs() / (2.0 * most_lateral_mps2)).sqrt();
                    self.sway(Swing {
                        begins_s: at_s,
                        lasts_s,
                        by_m,
                        shape: ChangeShape::Cosine,
                        is_slanted: false,
                        over: None,
                    })
                }
            };
            if !law.is_across() {
                ends_s = ends_s.max(law_ends_s);
            } else if !self.steps[self.step].overlaps {
                awaits_swing = true;
            }
        }
        // Laws that began before now have acted since, along and across.
        if at_s < now_s {
            let way_m = self.ramp.way_m(at_s, now_s);
            let missed_m = way_m - from_mps * (now_s - at_s);
            let (cos, sin) = self.carried.direction();
            self.s_m += cos * missed_m;
            let mut aside_m = 0.0;
            if let Some(begun) = &mut self.swing
                && laws.iter().any(MotionLaw::is_across)
            {
                aside_m = begun.driven_m(way_m, at_s, now_s);
            }
            self.lateral_m += sin * missed_m + aside_m;
        }
        PlanPhase::Acts {
            ends_s,
            awaits_swing,
        }
    }

    /// Begins a lateral motion and returns its end.
    fn sway(&mut self, swing: Swing) -> f64 {
        self.swing = Some(swing);
        swing.begins_s + swing.lasts_s
    }
}
