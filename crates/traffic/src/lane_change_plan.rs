//! Recorded lane changes as a plan: half a cosine in time.

use std::f64::consts::PI;

/// Least and greatest duration of a lane change in seconds.
const DURATION_S: (f64, f64) = (1.0, 14.0);

/// Steps of the first search, and of the second one around its result, in seconds.
const SEARCH_S: [f64; 2] = [0.2, 0.02];

/// Lateral motion of a lane change, y = from + (to − from)/2 · (1 − cos πt/T).
///
/// It is the curve of `LaneOffset` in a world file. Before it and after it the lateral
/// position is constant.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LaneChangePlan {
    /// Sample at which the change begins.
    pub first_sample: usize,
    /// Duration T in seconds.
    pub duration_s: f64,
    /// Offset before the change in metres, to the left.
    pub from_m: f64,
    /// Offset after the change in metres, to the left.
    pub to_m: f64,
}

impl LaneChangePlan {
    /// Fits a change to offsets, sampled every `dt_s`, that is under way at sample `line`.
    ///
    /// Begin, duration and both offsets have the least squares. Returns `None` if the
    /// offsets are too short for a change.
    pub fn fit(lateral_m: &[f64], line: usize, dt_s: f64) -> Option<LaneChangePlan> {
        let mut best: Option<(f64, LaneChangePlan)> = None;
        let mut around = None;
        for step_s in SEARCH_S {
            let step = ((0.5 * step_s / dt_s).round() as usize).max(1);
            for first_sample in begins(line, dt_s, around).step_by(step) {
                for duration_s in durations(step_s, around) {
                    let end = first_sample as f64 + duration_s / dt_s;
                    // The change must be under way at the line and end within
                    // the offsets.
                    if end <= line as f64 || lateral_m.len() as f64 <= end {
                        continue;
                    }
                    let found = offsets(lateral_m, first_sample, duration_s, dt_s);
                    // Strictly less, so that the first of equal fits is kept.
                    if best.is_none_or(|(least, _)| found.0 < least) {
                        best = Some(found);
                    }
                }
            }
            around = Some(best?.1);
        }
        around
    }

    /// Returns the offset at a time after the first sample of the fit.
    pub fn lateral_m(&self, time_s: f64, dt_s: f64) -> f64 {
        let share = self.share(time_s, dt_s);
        self.from_m + (self.to_m - self.from_m) * 0.5 * (1.0 - libm::cos(PI * share))
    }

    /// Returns the lateral speed at a time after the first sample, to the left.
    pub fn lateral_mps(&self, time_s: f64, dt_s: f64) -> f64 {
        let speed_mps = 0.5 * PI * (self.to_m - self.from_m) / self.duration_s;
        speed_mps * libm::sin(PI * self.share(time_s, dt_s))
    }

    /// Returns the greatest lateral speed in m/s, always positive.
    pub fn most_lateral_mps(&self) -> f64 {
        0.5 * PI * (self.to_m - self.from_m).abs() / self.duration_s
    }

    /// Returns the greatest lateral acceleration in m/s², which sets the duration.
    pub fn most_lateral_mps2(&self) -> f64 {
        let per_s = PI / self.duration_s;
        0.5 * (self.to_m - self.from_m).abs() * per_s * per_s
    }

    fn share(&self, time_s: f64, dt_s: f64) -> f64 {
        let since_s = time_s - self.first_sample as f64 * dt_s;
        (since_s / self.duration_s).clamp(0.0, 1.0)
    }
}

/// Returns the samples at which a change may begin.
fn begins(
    line: usize,
    dt_s: f64,
    around: Option<LaneChangePlan>,
) -> std::ops::RangeInclusive<usize> {
    let samples = |seconds: f64| (seconds / dt_s).round() as usize;
    match around {
        None => line.saturating_sub(samples(DURATION_S.1))..=line.saturating_sub(1),
        Some(it) => {
            let near = samples(0.5 * SEARCH_S[0]).max(1);
            it.first_sample.saturating_sub(near)..=it.first_sample + near
        }
    }
}

/// Returns the durations to try, in seconds.
fn durations(step_s: f64, around: Option<LaneChangePlan>) -> impl Iterator<Item = f64> {
    let (from_s, to_s) = match around {
        None => DURATION_S,
        Some(it) => (it.duration_s - SEARCH_S[0], it.duration_s + SEARCH_S[0]),
    };
    // The second search must not leave the allowed durations.
    let from_s = from_s.max(DURATION_S.0);
    let steps = ((to_s - from_s) / step_s).round() as usize;
    (0..=steps).map(move |i| from_s + i as f64 * step_s)
}

/// Returns the sum of squares and the change with the best offsets.
fn offsets(
    lateral_m: &[f64],
    first_sample: usize,
    duration_s: f64,
    dt_s: f64,
) -> (f64, LaneChangePlan) {
    // Offsets 0 and 1 make the curve the regressor of a straight line.
    let unit = LaneChangePlan {
        first_sample,
        duration_s,
        from_m: 0.0,
        to_m: 1.0,
    };
    let n = lateral_m.len() as f64;
    let [mut x, mut xx, mut y, mut yy, mut xy] = [0.0; 5];
    for (i, lateral_m) in lateral_m.iter().enumerate() {
        let curve = unit.lateral_m(i as f64 * dt_s, dt_s);
        x += curve;
        xx += curve * curve;
        y += lateral_m;
        yy += lateral_m * lateral_m;
        xy += curve * lateral_m;
    }
    let spread = xx - x * x / n;
    // A constant curve cannot show a change.
    let by_m = if spread > 1e-9 {
        (xy - x * y / n) / spread
    } else {
        0.0
    };
    let from_m = (y - by_m * x) / n;
    let plan = LaneChangePlan {
        from_m,
        to_m: from_m + by_m,
        ..unit
    };
    (yy - y * y / n - by_m * (xy - x * y / n), plan)
}
