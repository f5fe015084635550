//! Kinds that a sample has not shown yet, as species in ecology.
//!
//! A sample consists of units, such as test starts, each of which shows some kinds, such
//! as cells of failures. A kind is described by the number of units that show it.
//!
//! - The number of all kinds is estimated from below by Chao2 (Chao, "Estimating the
//!   population size for capture-recapture data with unequal catchability", Biometrics 43
//!   (1987) 783–791), with its log-normal interval. With one kind per unit it is Chao1.
//! - The coverage, the probability that a kind which is shown next is known, is Good and
//!   Turing's in the form of Chao and Jost (Ecology 93 (2012) 2533–2547).
//! - The number of new kinds in further units is extrapolated by Shen, Chao and Lin
//!   (Ecology 84 (2003) 798–804), for units by Chao et al. (Ecological Monographs 84
//!   (2014) 45–67). Its interval is that of a prediction: samples of an assemblage like
//!   the observed one are drawn, extrapolated, and compared with their own continuation.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::seed;

/// 97.5th percentile of the standard normal distribution.
const Z: f64 = 1.959_963_984_540_054;
/// Samples behind the interval of a prediction.
const SAMPLES: usize = 400;

/// Numbers of units in which the kinds of a sample occur.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Incidence {
    units: u64,
    /// Number of units that show each kind, all above 0.
    counts: Vec<u64>,
}

/// Estimate of the number of kinds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct KindsEstimate {
    /// Kinds in the sample.
    pub observed: usize,
    /// Estimated number of all kinds (Chao2), a lower bound in the mean.
    pub all: f64,
    /// Its 95 % log-normal interval.
    pub ci95: [f64; 2],
    /// Estimated probability that a kind which is shown next is in the sample. `None`
    /// without any kind.
    pub coverage: Option<f64>,
}

/// Prediction of the number of new kinds in further units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NewKinds {
    /// Number of further units.
    pub units: u64,
    /// Expected number of kinds that the sample does not show.
    pub expected: f64,
    /// 95 % interval of the number that will be counted.
    pub interval95: [f64; 2],
}

impl Incidence {
    /// Describes a sample. Kinds that occur in no unit are left out.
    pub fn new(units: u64, counts: impl IntoIterator<Item = u64>) -> Incidence {
        Incidence {
            units,
            counts: counts.into_iter().filter(|count| *count > 0).collect(),
        }
    }

    /// Returns the number of kinds that occur in exactly `units` units.
    fn kinds_in(&self, units: u64) -> f64 {
        self.counts.iter().filter(|count| **count == units).count() as f64
    }

    /// Returns (T − 1) / T for T units.
    fn finite(&self) -> f64 {
        self.units.saturating_sub(1) as f64 / self.units.max(1) as f64
    }

    /// Returns Chao2's estimate of the number of kinds that do not occur.
    fn unseen(&self) -> f64 {
        let (q1, q2) = (self.kinds_in(1), self.kinds_in(2));
        // Without doubletons, the bias-corrected form is finite.
        if q2 > 0.0 {
            self.finite() * q1 * q1 / (2.0 * q2)
        } else {
            self.finite() * q1 * (q1 - 1.0) / 2.0
        }
    }

    /// Estimates the number of kinds.
    pub fn kinds(&self) -> KindsEstimate {
        let observed = self.counts.len();
        let unseen = self.unseen();
        let all = observed as f64 + unseen;
        KindsEstimate {
            observed,
            all,
            ci95: self.log_normal(unseen, all),
            coverage: (observed > 0).then(|| 1.0 - self.deficit()),
        }
    }

    /// Returns the log-normal interval of the number of kinds.
    fn log_normal(&self, unseen: f64, all: f64) -> [f64; 2] {
        let observed = self.counts.len() as f64;
        // Without unseen kinds, the logarithmic scale does not exist.
        if unseen <= 0.0 {
            return [observed, observed];
        }
        let (a, q1, q2) = (self.finite(), self.kinds_in(1), self.kinds_in(2));
        let variance = if q2 > 0.0 {
            let r = q1 / q2;
            q2 * (a / 2.0 * r * r + a * a * r * r * r + a * a / 4.0 * r * r * r * r)
        } else {
            let twice = 2.0 * q1 - 1.0;
            a * q1 * (q1 - 1.0) / 2.0 + a * a * q1 * twice * twice / 4.0
                - a * a * q1 * q1 * q1 * q1 / (4.0 * all)
        };
        let spread = libm::log(1.0 + variance.max(0.0) / (unseen * unseen));
        let factor = libm::exp(Z * spread.sqrt());
        [observed + unseen / factor, observed + unseen * factor]
    }

    /// Returns the probability that a kind which is shown next does not occur (Good–Turing).
    fn deficit(&self) -> f64 {
        let shown: u64 = self.counts.iter().sum();
        let (q1, q2) = (self.kinds_in(1), self.kinds_in(2));
        if q1 == 0.0 || shown == 0 {
            return 0.0;
        }
        let before = self.units.saturating_sub(1) as f64;
        // Without doubletons, the bias-corrected form counts one more of both.
        let doubled = if q2 > 0.0 {
            2.0 * q2 / (before * q1 + 2.0 * q2)
        } else {
            2.0 / (before * (q1 - 1.0) + 2.0)
        };
        q1 / shown as f64 * (1.0 - doubled)
    }

    /// Returns the expected number of new kinds in `units` further units.
    fn expected_new(&self, units: u64) -> f64 {
        let (unseen, q1) = (self.unseen(), self.kinds_in(1));
        if unseen <= 0.0 {
            // A single kind seen once has no estimate of unseen ones, but a rate.
            return if q1 == 1.0 {
                units as f64 / self.units.max(1) as f64
            } else {
                0.0
            };
        }
        let share = q1 / (self.units as f64 * unseen + q1);
        unseen * (1.0 - libm::pow(1.0 - share, units as f64))
    }

    /// Predicts the number of new kinds in `units` further units.
    ///
    /// Equal samples and seeds have equal predictions.
    pub fn predict(&self, units: u64, seed: u64) -> NewKinds {
        let expected = self.expected_new(units);
        let mut dice = seed::generator("species", &[seed, self.units, units]);
        let rates = self.assemblage();
        let mut errors: Vec<f64> = (0..SAMPLES)
            .map(|_| self.sampled_error(&rates, units, &mut dice))
            .collect();
        errors.sort_by(f64::total_cmp);
        let at = |share: f64| errors[(share * (SAMPLES - 1) as f64).round() as usize];
        // The error is what is counted minus what is expected.
        let bound = |error: f64| (expected + error).max(0.0);
        NewKinds {
            units,
            expected,
            interval95: [
                // Quantiles of skewed errors may lie on one side of the estimate.
                bound(at(0.025)).min(expected),
                bound(at(0.975)).max(expected),
            ],
        }
    }

    /// Samples the assemblage, extrapolates, and compares with the continuation.
    fn sampled_error(&self, rates: &[f64], units: u64, dice: &mut ChaCha8Rng) -> f64 {
        let (mut counts, mut new) = (Vec::with_capacity(rates.len()), 0.0);
        for &rate in rates {
            let count = binomial(self.units, rate, dice);
            counts.push(count);
            // A kind that is in the sample cannot be new.
            if count == 0 && binomial(units, rate, dice) > 0 {
                new += 1.0;
            }
        }
        new - Incidence::new(self.units, counts).expected_new(units)
    }

    /// Returns the estimated rates of all kinds, those that do not occur included.
    ///
    /// The rates of seen kinds are lowered by the share of the unseen ones, which have
    /// equal rates (Chao et al. 2014, appendix G).
    fn assemblage(&self) -> Vec<f64> {
        let all = self.units.max(1) as f64;
        let shown: u64 = self.counts.iter().sum();
        let missing = shown as f64 / all * self.deficit();
        let unseen_kinds = self.unseen().ceil();
        let absent = |rate: f64| rate * libm::pow(1.0 - rate, all);
        let sum: f64 = self.counts.iter().map(|n| absent(*n as f64 / all)).sum();
        let scale = if sum > 0.0 && unseen_kinds > 0.0 {
            missing / sum
        } else {
            0.0
        };
        let seen = self.counts.iter().map(|n| {
            let rate = *n as f64 / all;
            (rate - scale * absent(rate)).clamp(0.0, 1.0)
        });
        // A rate is at most 1, even if few kinds share a large deficit.
        let each = (missing / unseen_kinds.max(1.0)).min(1.0);
        let unseen = std::iter::repeat_n(each, unseen_kinds as usize);
        seen.chain(unseen).collect()
    }
}

/// Draws the number of successes of `n` trials, by the gaps between successes.
fn binomial(n: u64, rate: f64, dice: &mut ChaCha8Rng) -> u64 {
    // A rate of 0 would make the scale infinite, and the loop would never end.
    if rate <= 0.0 {
        return 0;
    }
    if rate >= 1.0 {
        return n;
    }
    let log = libm::log(1.0 - rate);
    // A rate below the rounding of 1 would never advance the loop.
    if log == 0.0 {
        return 0;
    }
    let scale = 1.0 / log;
    let (mut at, mut count) = (0.0, 0);
    loop {
        // 1 − u is above 0, so the logarithm is finite.
        at += 1.0 + (libm::log(1.0 - dice.random::<f64>()) * scale).floor();
        if at > n as f64 {
            return count;
        }
        count += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts with so many kinds in one unit and in two, of `observed` in all.
    fn sample(units: u64, observed: usize, q1: usize, q2: usize) -> Incidence {
        let counts = |n: usize, count| std::iter::repeat_n(count, n);
        let others = observed - q1 - q2;
        Incidence::new(
            units,
            counts(q1, 1).chain(counts(q2, 2)).chain(counts(others, 9)),
        )
    }

    /// Sackett's spiders, as in the manual of iNEXT (Chao et al. 2014, table 1).
    #[test]
    fn the_estimates_are_those_that_are_published() {
        let near = |a: f64, b: f64, by: f64| assert!((a - b).abs() < by, "{a} is not {b}");
        let girdled = sample(168, 26, 12, 4).kinds();
        near(girdled.all, 43.893, 1e-3);
        near(girdled.ci95[0], 30.511, 1e-3);
        near(girdled.ci95[1], 96.971, 1e-3);
        let logged = sample(252, 37, 14, 4).kinds();
        near(logged.all, 61.403, 1e-3);
        near(logged.ci95[0], 43.502, 1e-3);
        near(logged.ci95[1], 128.583, 1e-3);
        // Its coverage is 0.929, of 168 individuals of which each shows one species.
        let mut counts = vec![1; 12];
        counts.extend([2; 4]);
        counts.extend([4, 6, 6, 8, 9, 15, 15, 17, 22, 46]);
        let girdled = Incidence::new(168, counts);
        assert_eq!(girdled.counts.iter().sum::<u64>(), 168);
        near(girdled.kinds().coverage.expect("kinds"), 0.9289, 1e-4);
    }

    #[test]
    fn a_sample_without_rare_kinds_is_complete() {
        let complete = sample(300, 12, 0, 3);
        assert_eq!(complete.kinds().all, 12.0);
        assert_eq!(complete.kinds().coverage, Some(1.0));
        assert_eq!(complete.predict(1000, 1).expected, 0.0);
        let nothing = Incidence::new(300, []);
        assert_eq!(nothing.kinds().coverage, None);
        assert_eq!(nothing.predict(1000, 1).interval95, [0.0, 0.0]);
    }

    /// Counts of a sample of an assemblage, and the new kinds of its continuation.
    fn truth(rates: &[f64], (units, more): (u64, u64), dice: &mut ChaCha8Rng) -> (Incidence, f64) {
        let drawn: Vec<(u64, bool)> = rates
            .iter()
            .map(|rate| {
                let before = (0..units).filter(|_| dice.random_bool(*rate)).count() as u64;
                (before, (0..more).any(|_| dice.random_bool(*rate)))
            })
            .collect();
        let new = drawn
            .iter()
            .filter(|(before, after)| *before == 0 && *after)
            .count() as f64;
        (Incidence::new(units, drawn.iter().map(|it| it.0)), new)
    }

    /// Brute force: geometric and equal rates, predicted and then drawn.
    #[test]
    fn predictions_are_right_in_the_mean_and_their_intervals_cover_what_is_drawn() {
        let geometric: Vec<f64> = (0..60).map(|n| 0.4 * 0.9_f64.powi(n)).collect();
        let equal = vec![0.004; 80];
        for (name, rates) in [("geometric", geometric), ("equal", equal)] {
            let mut dice = seed::generator("truth", &[1]);
            let (mut predicted, mut counted, mut covered, rounds) = (0.0, 0.0, 0, 120);
            let mut all = 0;
            for round in 0..rounds {
                let (sample, new) = truth(&rates, (250, 250), &mut dice);
                let prediction = sample.predict(250, round);
                predicted += prediction.expected;
                counted += new;
                let [lo, hi] = prediction.interval95;
                covered += i32::from(lo <= new && new <= hi);
                let [lo, hi] = sample.kinds().ci95;
                let kinds = rates.len() as f64;
                all += i32::from(lo <= kinds && kinds <= hi);
            }
            let ratio = predicted / counted;
            assert!((0.85..1.15).contains(&ratio), "{name}: {ratio}");
            assert!(covered >= 108, "{name}: {covered} of {rounds} are covered");
            // Chao's estimate is a lower bound, which is tight for equal rates.
            assert!(name == "geometric" || all >= 105, "{name}: {all}");
        }
    }
}
