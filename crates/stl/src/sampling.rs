//! Period of instants that were rounded: stamps in milliseconds, float32, epochs.
//!
//! Stamps such as 0.000, 0.017, 0.033 are those of 60 Hz in milliseconds. The period is
//! fitted to all of them, and is the simplest fraction that the fit cannot tell from it.

pub use crate::time_name::{TimeName, UnknownTimeUnit, name_words, time_name, time_rank};

/// Largest share of a period by which stamps may be off the grid.
///
/// Beyond it a lost sample could not be told from rounding.
pub const MOST_OFF: f64 = 0.15;

/// Usual sampling rates in Hz that are no whole numbers: those of television.
const TELEVISION_HZ: [(f64, f64); 4] = [
    (24_000.0, 1001.0),
    (30_000.0, 1001.0),
    (60_000.0, 1001.0),
    (120_000.0, 1001.0),
];

/// Even sampling that instants have.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct EvenSampling {
    /// Period in seconds, the simplest fraction within the accuracy of the instants.
    pub dt_s: f64,
    /// Largest distance of an instant from the fitted grid, in seconds.
    pub off_s: f64,
    /// Number of periods from the first instant to the last.
    pub periods: u64,
}

impl EvenSampling {
    /// Fits a grid to rising instants, between which samples may be missing.
    ///
    /// Returns `None` if an instant is off every grid by more than [`MOST_OFF`] of a
    /// period, or if there are fewer than two.
    pub fn fit(times_s: &[f64]) -> Option<EvenSampling> {
        let usual_s = usual_step(times_s)?;
        // Relative to the first, since an epoch leaves no digits for squares.
        let start_s = *times_s.first()?;
        let mut slot = 0.0;
        let (mut n, mut sums) = (0.0, [0.0_f64; 4]);
        let mut slots = Vec::with_capacity(times_s.len());
        for (i, time_s) in times_s.iter().enumerate() {
            if let Some(before_s) = i.checked_sub(1).map(|before| times_s[before]) {
                // Stamps rise strictly, so even a short step leads to the next slot.
                slot += ((time_s - before_s) / usual_s).round().max(1.0);
            }
            let at_s = time_s - start_s;
            n += 1.0;
            sums[0] += slot;
            sums[1] += at_s;
            sums[2] += slot * slot;
            sums[3] += slot * at_s;
            slots.push(slot);
        }
        let spread = sums[2] - sums[0] * sums[0] / n;
        let slope_s = (sums[3] - sums[0] * sums[1] / n) / spread;
        // Beyond 2⁵³, about 9e15, an `f64` does not count every slot.
        if !(slope_s > 0.0 && slope_s.is_finite()) || slot > 1e15 {
            return None;
        }
        let off_s = half_range(times_s, &slots, slope_s);
        if off_s > MOST_OFF * slope_s {
            return None;
        }
        // Stamps have 53 bits, so that of an epoch is a quarter of a microsecond.
        let last_s = times_s[times_s.len() - 1];
        let digits_s = 4.0 * f64::EPSILON * start_s.abs().max(last_s.abs());
        let unsure_s = 2.0 * (off_s + digits_s) / slot + 4.0 * f64::EPSILON * slope_s;
        let dt_s = simplest_period(slope_s, unsure_s);
        Some(EvenSampling {
            dt_s,
            off_s: half_range(times_s, &slots, dt_s).max(off_s),
            periods: slot as u64,
        })
    }

    /// Returns the rate as a person would state it.
    pub fn rate(&self) -> String {
        rate_of(self.dt_s)
    }
}

/// Returns the rate of a period as a person would state it, such as `29.97 Hz`.
pub fn rate_of(dt_s: f64) -> String {
    let rate_hz = 1.0 / dt_s;
    let rounded = (rate_hz * 1000.0).round() / 1000.0;
    format!("{rounded} Hz")
}

/// Returns the mean of the steps that are single ones, `None` without a usual step.
fn usual_step(times_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    // Stamps that stand still or go back have no usual step.
    if steps.iter().any(|step_s| step_s.is_nan() || *step_s <= 0.0) {
        return None;
    }
    let middle = steps.len() / 2;
    if steps.is_empty() {
        return None;
    }
    let median_s = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    // The mean of single steps averages out their rounding, which the median keeps.
    let single = |step_s: &&f64| **step_s > 0.5 * median_s && **step_s < 1.5 * median_s;
    let (mut n, mut sum_s) = (0.0, 0.0);
    for step_s in steps.iter().filter(single) {
        n += 1.0;
        sum_s += step_s;
    }
    // The median itself is a single step, so n is at least 1.
    Some(sum_s / n)
}

/// Returns half the range of the distances from a grid that is placed best.
fn half_range(times_s: &[f64], slots: &[f64], dt_s: f64) -> f64 {
    let (mut least_s, mut most_s) = (f64::INFINITY, f64::NEG_INFINITY);
    for (time_s, slot) in times_s.iter().zip(slots) {
        let off_s = (time_s - times_s[0]) - slot * dt_s;
        least_s = least_s.min(off_s);
        most_s = most_s.max(off_s);
    }
    0.5 * (most_s - least_s)
}

/// Returns the period that a person would state, within `unsure_s` of `period_s`.
fn simplest_period(period_s: f64, unsure_s: f64) -> f64 {
    let (low_s, high_s) = (period_s - unsure_s, period_s + unsure_s);
    let fits = |it: f64| low_s <= it && it <= high_s;
    let whole_hz = (1.0 / period_s).round();
    if whole_hz >= 1.0 && fits(1.0 / whole_hz) {
        return 1.0 / whole_hz;
    }
    let television = TELEVISION_HZ.iter().map(|(over, under)| under / over);
    if let Some(known_s) = television.into_iter().find(|it| fits(*it)) {
        return known_s;
    }
    // A short decimal of a second or of a hertz before any other fraction.
    for digits in 0..=6 {
        let power = f64::from(10_u32.pow(digits));
        let decimal_s = (period_s * power).round() / power;
        if decimal_s > 0.0 && fits(decimal_s) {
            return decimal_s;
        }
        let decimal_hz = (power / period_s).round() / power;
        if digits <= 3 && decimal_hz > 0.0 && fits(1.0 / decimal_hz) {
            return 1.0 / decimal_hz;
        }
    }
    simplest_fraction(low_s, high_s).unwrap_or(period_s)
}

/// Returns the fraction with the least denominator between two positive numbers.
fn simplest_fraction(low: f64, high: f64) -> Option<f64> {
    // Continued fractions of both ends agree as far as the simplest fraction between goes.
    let (mut low, mut high) = (low.max(f64::MIN_POSITIVE), high);
    let mut terms: Vec<f64> = Vec::new();
    for _ in 0..30 {
        let whole = low.floor();
        if whole < high.floor() || low == whole {
            terms.push(low.ceil());
            let fraction = terms.iter().rev().fold(None, |rest: Option<f64>, term| {
                Some(rest.map_or(*term, |rest| term + 1.0 / rest))
            });
            return fraction.filter(|it| it.is_finite());
        }
        terms.push(whole);
        (low, high) = (1.0 / (high - whole), 1.0 / (low - whole));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rounded(rate_hz: f64, digits: i32, start_s: f64, n: usize) -> Vec<f64> {
        let power = 10.0_f64.powi(digits);
        let stamp = |i: usize| ((start_s + i as f64 / rate_hz) * power).round() / power;
        (0..n).map(stamp).collect()
    }

    #[test]
    fn rounded_stamps_have_the_rate_that_made_them() {
        for rate_hz in [
            7.0, 10.0, 12.5, 15.0, 20.0, 24.0, 25.0, 30.0, 50.0, 60.0, 90.0, 100.0, 120.0, 144.0,
        ] {
            for (digits, start_s) in [(3, 0.0), (6, 0.0), (12, 0.0), (3, 1.7e9), (6, 1.7e9)] {
                for n in [40, 91, 2000] {
                    let times = rounded(rate_hz, digits, start_s, n);
                    let fit = EvenSampling::fit(&times).unwrap_or_else(|| panic!("{rate_hz}"));
                    assert_eq!(fit.dt_s, 1.0 / rate_hz, "{rate_hz} Hz, {digits}, {n}");
                    assert_eq!(fit.periods, n as u64 - 1);
                }
            }
        }
        let ntsc = EvenSampling::fit(&rounded(30_000.0 / 1001.0, 3, 0.0, 900)).expect("even");
        assert_eq!((ntsc.dt_s, &*ntsc.rate()), (1001.0 / 30_000.0, "29.97 Hz"));
    }

    #[test]
    fn missing_samples_do_not_change_the_period() {
        let mut times = rounded(30.0, 3, 100.0, 3000);
        times.drain(500..900);
        times.remove(20);
        let fit = EvenSampling::fit(&times).expect("a grid");
        assert_eq!((fit.dt_s, fit.periods), (1.0 / 30.0, 2999));
    }

    #[test]
    fn instants_on_no_grid_have_no_period() {
        assert_eq!(EvenSampling::fit(&[0.0, 1.0]).map(|it| it.dt_s), Some(1.0));
        for times in [
            &[0.0, 0.1, 0.17, 0.3, 0.4, 0.5][..],
            &[0.0, 0.1, 0.1, 0.2],
            &[0.3, 0.2, 0.1],
            &[1.0],
            &[],
        ] {
            assert_eq!(EvenSampling::fit(times), None, "{times:?}");
        }
    }

    #[test]
    fn other_periods_stay_decimals() {
        for dt_s in [0.07, 0.013, 0.37, 1.5, 3.0, 0.0125] {
            let times: Vec<f64> = (0..200).map(|i| f64::from(i) * dt_s).collect();
            assert_eq!(
                EvenSampling::fit(&times).map(|it| it.dt_s),
                Some(dt_s),
                "{dt_s}"
            );
        }
    }
}
