//! Profiles of planned motion over time: ramps of speed and lateral swings.

use core::f64::consts::PI;

use crate::road::ChangeShape;

/// Largest difference at which two instants count as equal.
pub(super) const SAME_S: f64 = 1e-9;

/// Step in which motion is planned that depends on other agents.
const STEP_S: f64 = 0.01;

/// Lateral speed from which a change is a jump, as no body drives it.
const JUMP_MPS: f64 = 1000.0;
/// Lateral speed of a change at once: it takes about a millisecond.
pub(super) const AT_ONCE_MPS: f64 = 5.0 * JUMP_MPS;

/// Halvings of an interval, after which it is shorter than any time that matters.
const HALVINGS: u32 = 60;

/// A speed that changes.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedRamp {
    pub begins_s: f64,
    pub from_mps: f64,
    pub to_mps: f64,
    /// Greatest rate, at least 0. Infinity changes the speed at once.
    pub rate_mps2: f64,
    pub shape: ChangeShape,
}

/// A lateral motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Swing {
    pub begins_s: f64,
    pub lasts_s: f64,
    pub by_m: f64,
    pub shape: ChangeShape,
    /// True if lateral motion reduces progress along the road.
    pub is_slanted: bool,
    /// Way over which it goes on, instead of a time. `lasts_s` then follows the speed.
    pub over: Option<SwingWay>,
}

/// Way of a lateral motion that goes on as its body drives.
#[derive(Clone, Copy, Debug)]
pub(super) struct SwingWay {
    pub whole_m: f64,
    pub done_m: f64,
}

impl SpeedRamp {
    pub(super) fn steady(speed_mps: f64) -> SpeedRamp {
        SpeedRamp {
            begins_s: 0.0,
            from_mps: speed_mps,
            to_mps: speed_mps,
            rate_mps2: f64::INFINITY,
            shape: ChangeShape::Linear,
        }
    }

    pub(super) fn lasts_s(&self) -> f64 {
        // A rate of 0 would give 0/0 here.
        if self.from_mps == self.to_mps {
            0.0
        } else {
            self.shape.peak() * (self.to_mps - self.from_mps).abs() / self.rate_mps2
        }
    }

    pub(super) fn ends_s(&self) -> f64 {
        self.begins_s + self.lasts_s()
    }

    pub(super) fn speed_mps(&self, time_s: f64) -> f64 {
        // Exact at the end: interpolation would miss the target by a rounding
        // error.
        if self.ends_s() - SAME_S <= time_s {
            return self.to_mps;
        }
        let for_s = (time_s - self.begins_s).max(0.0);
        let change_mps = self.to_mps - self.from_mps;
        match self.shape {
            // Without a quotient of its own, which would round once more.
            ChangeShape::Linear => self.from_mps + change_mps * for_s / self.lasts_s(),
            shape => self.from_mps + change_mps * shape.changed(for_s / self.lasts_s()),
        }
    }

    /// Returns the acceleration from an instant on.
    pub(super) fn accel_mps2(&self, time_s: f64) -> f64 {
        if self.ends_s() - SAME_S <= time_s {
            return 0.0;
        }
        let share = ((time_s - self.begins_s) / self.lasts_s()).clamp(0.0, 1.0);
        (self.to_mps - self.from_mps) / self.lasts_s() * self.shape.rate(share)
    }

    /// Returns the distance between two instants, without an end of the ramp between.
    pub(super) fn way_m(&self, from_s: f64, to_s: f64) -> f64 {
        let lasts_s = self.lasts_s();
        let changes = self.shape != ChangeShape::Linear && lasts_s > 0.0;
        if changes && to_s <= self.ends_s() + SAME_S {
            let share = |time_s: f64| ((time_s - self.begins_s) / lasts_s).clamp(0.0, 1.0);
            let part = self.shape.accumulated(share(to_s)) - self.shape.accumulated(share(from_s));
            return self.from_mps * (to_s - from_s)
                + (self.to_mps - self.from_mps) * lasts_s * part;
        }
        0.5 * (self.speed_mps(from_s) + self.speed_mps(to_s)) * (to_s - from_s)
    }
}

impl SpeedRamp {
    /// Returns the time at which a way is driven from a time on, infinite for never.
    pub(super) fn driven_s(&self, from_s: f64, way_m: f64) -> f64 {
        let changes_m = self.way_m(from_s, self.ends_s().max(from_s));
        if way_m >= changes_m {
            let left_m = way_m - changes_m;
            // A ramp to standstill ends exactly at its way: 0/0 would be no instant.
            let after_s = if left_m > 0.0 {
                left_m / self.to_mps
            } else {
                0.0
            };
            return self.ends_s().max(from_s) + after_s;
        }
        // The way grows with time, and each half of the interval holds its end or not.
        let (mut early_s, mut late_s) = (from_s, self.ends_s());
        for _ in 0..HALVINGS {
            let middle_s = 0.5 * (early_s + late_s);
            if self.way_m(from_s, middle_s) < way_m {
                early_s = middle_s;
            } else {
                late_s = middle_s;
            }
        }
        late_s
    }
}

impl Swing {
    /// Lets it end when its way is driven, as the speed now says.
    pub(super) fn time_by(&mut self, ramp: &SpeedRamp, now_s: f64) {
        // Its end stays once it is there.
        if let Some(over) = self.over.filter(|it| it.done_m < it.whole_m) {
            let ends_s = ramp.driven_s(now_s, over.whole_m - over.done_m);
            self.lasts_s = ends_s - self.begins_s;
        }
    }

    /// Returns its way while its body drives `way_m` of the way over which it goes on.
    fn over_m(&mut self, over: SwingWay, way_m: f64) -> f64 {
        let done_m = (over.done_m + way_m.max(0.0)).min(over.whole_m);
        let share = |at_m: f64| at_m / over.whole_m;
        let changed = self.shape.changed(share(done_m)) - self.shape.changed(share(over.done_m));
        self.over = Some(SwingWay { done_m, ..over });
        // A body moves sideways no farther than it drives.
        (self.by_m * changed).clamp(-way_m.max(0.0), way_m.max(0.0))
    }

    pub(super) fn ends_s(&self) -> f64 {
        self.begins_s + self.lasts_s
    }

    pub(super) fn way_m(&self, time_s: f64) -> f64 {
        // A motion in no time would give 0/0.
        if self.lasts_s <= 0.0 {
            return self.by_m;
        }
        let share = ((time_s - self.begins_s) / self.lasts_s).clamp(0.0, 1.0);
        match self.shape {
            // In this order of factors, whose bits recorded episodes contain.
            ChangeShape::Cosine => 0.5 * self.by_m * (1.0 - libm::cos(PI * share)),
            shape => self.by_m * shape.changed(share),
        }
    }

    /// Returns the greatest lateral speed. It is infinite for a change in no time.
    pub(super) fn most_mps(&self) -> f64 {
        // By nothing in no time would be 0/0.
        if self.by_m == 0.0 {
            return 0.0;
        }
        self.shape.peak() * self.by_m.abs() / self.lasts_s
    }

    /// Returns whether it displaces its body at once, without a motion.
    pub(super) fn is_jump(&self) -> bool {
        self.over.is_none() && self.most_mps() >= JUMP_MPS
    }

    /// Returns its way within an interval in which the body drives `way_m`.
    ///
    /// A body moves sideways no farther than it drives. The rest of the motion is
    /// delayed by what it lags behind.
    pub(super) fn driven_m(&mut self, way_m: f64, from_s: f64, to_s: f64) -> f64 {
        if let Some(over) = self.over {
            return self.over_m(over, way_m);
        }
        if self.ends_s() <= from_s {
            return 0.0;
        }
        let done_m = self.way_m(from_s);
        if way_m <= 0.0 {
            // A standing body keeps its place, whatever its plan demands.
            self.begins_s += (to_s - from_s.max(self.begins_s)).max(0.0);
            return 0.0;
        }
        if self.is_jump() {
            // The change is over now, so its end moves to this instant.
            self.begins_s = from_s - self.lasts_s;
            return self.by_m - done_m;
        }
        let wanted_m = self.way_m(to_s) - done_m;
        if wanted_m.abs() <= way_m {
            return wanted_m;
        }
        let aside_m = way_m.copysign(self.by_m);
        let share = self.shape.share_of((done_m + aside_m) / self.by_m);
        // The beginning moves, so that the curve goes on from the place that
        // is reached.
        self.begins_s = to_s - share * self.lasts_s;
        aside_m
    }

    /// Returns its speed at a time, of a body with a speed along its path.
    pub(super) fn speed_mps(&self, time_s: f64, along_mps: f64) -> f64 {
        if self.is_jump() {
            return 0.0;
        }
        if let Some(over) = self.over {
            let share = over.done_m / over.whole_m;
            let is_going = (0.0..1.0).contains(&share);
            let per_m = self.by_m / over.whole_m * self.shape.rate(share);
            return if is_going { per_m * along_mps } else { 0.0 };
        }
        let share = (time_s - self.begins_s) / self.lasts_s;
        if self.lasts_s > 0.0 && (0.0..1.0).contains(&share) {
            match self.shape {
                ChangeShape::Cosine => 0.5 * self.by_m * PI / self.lasts_s * libm::sin(PI * share),
                shape => self.by_m / self.lasts_s * shape.rate(share),
            }
        } else {
            0.0
        }
    }
}

/// Returns the part along the road of a way or speed with a lateral part.
pub(super) fn forward_part(total: f64, lateral: f64) -> f64 {
    // The guard covers rounding where the motion is purely lateral.
    (total * total - lateral * lateral).max(0.0).sqrt()
}

/// Returns the next instant at which motion is planned that depends on other agents.
///
/// They count from the episode's start, so that they are the same for all sample times.
pub(super) fn next_step_s(time_s: f64) -> f64 {
    // The tolerance keeps rounding from returning the same instant again.
    ((time_s / STEP_S + 1e-6).floor() + 1.0) * STEP_S
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_to_standstill_ends_at_exactly_its_way() {
        let ramp = SpeedRamp {
            from_mps: 10.0,
            to_mps: 0.0,
            rate_mps2: 2.0,
            begins_s: 1.0,
            shape: ChangeShape::Linear,
        };
        let way_m = ramp.way_m(1.0, ramp.ends_s());
        assert_eq!(ramp.driven_s(1.0, way_m), ramp.ends_s());
        assert_eq!(ramp.driven_s(1.0, way_m + 1.0), f64::INFINITY);
        assert!(ramp.driven_s(1.0, way_m - 1.0) < ramp.ends_s());
    }
}
