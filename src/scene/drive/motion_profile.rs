//! Profiles of planned motion over time: ramps of speed and lateral swings.

use core::f64::consts::PI;

/// Largest difference at which two instants count as equal.
pub(super) const SAME_S: f64 = 1e-9;

/// A speed that changes linearly.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedRamp {
    pub begins_s: f64,
    pub from_mps: f64,
    pub to_mps: f64,
    /// At least 0. Infinity changes the speed at once.
    pub rate_mps2: f64,
}

/// A lateral motion along a cosine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Swing {
    pub begins_s: f64,
    pub lasts_s: f64,
    pub by_m: f64,
    /// True if lateral motion reduces progress along the road.
    pub is_slanted: bool,
}

impl SpeedRamp {
    pub(super) fn steady(speed_mps: f64) -> SpeedRamp {
        SpeedRamp {
            begins_s: 0.0,
            from_mps: speed_mps,
            to_mps: speed_mps,
            rate_mps2: f64::INFINITY,
        }
    }

    pub(super) fn lasts_s(&self) -> f64 {
        if self.from_mps == self.to_mps {
            0.0
        } else {
            (self.to_mps - self.from_mps).abs() / self.rate_mps2
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
        self.from_mps + (self.to_mps - self.from_mps) * for_s / self.lasts_s()
    }

    /// Returns the distance between two instants, without an end of the ramp between.
    pub(super) fn way_m(&self, from_s: f64, to_s: f64) -> f64 {
        0.5 * (self.speed_mps(from_s) + self.speed_mps(to_s)) * (to_s - from_s)
    }
}

impl Swing {
    pub(super) fn ends_s(&self) -> f64 {
        self.begins_s + self.lasts_s
    }

    pub(super) fn way_m(&self, time_s: f64) -> f64 {
        if self.lasts_s <= 0.0 {
            return self.by_m;
        }
        let share = ((time_s - self.begins_s) / self.lasts_s).clamp(0.0, 1.0);
        0.5 * self.by_m * (1.0 - libm::cos(PI * share))
    }

    pub(super) fn speed_mps(&self, time_s: f64) -> f64 {
        let share = (time_s - self.begins_s) / self.lasts_s;
        if 0.0 < self.lasts_s && (0.0..1.0).contains(&share) {
            0.5 * self.by_m * PI / self.lasts_s * libm::sin(PI * share)
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
