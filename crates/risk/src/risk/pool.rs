//! Estimates from rounds of weighted runs, with their intervals.

use serde::{Deserialize, Serialize};

use super::record::DriverAnswer;
use crate::stats::{clopper_pearson_upper, pareto_shape, student_quantile, wilson};

/// Probability that an interval does not hold.
const ERROR: f64 = 0.05;

/// Failure with its weight.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WeightedFailure {
    /// Position in the round, equal for all egos on the same draws.
    pub(super) index: usize,
    pub(super) component: usize,
    /// Weight p / q.
    pub(super) weight: f64,
    pub(super) mode: String,
    pub(super) lawful: bool,
    pub(super) preventable: Option<DriverAnswer>,
}

/// Run that ended in a fault, with its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WeightedFault {
    /// As in [`WeightedFailure`].
    pub(super) index: usize,
    pub(super) component: usize,
    pub(super) weight: f64,
}

/// Round of independent draws from one mixture, in fixed numbers per component.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Round {
    /// Draws per component.
    pub(super) draws: Vec<usize>,
    pub(super) failures: Vec<WeightedFailure>,
    pub(super) faults: Vec<WeightedFault>,
}

/// Estimate of a probability per run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RiskEstimate {
    /// Probability per run.
    pub probability: f64,
    /// 95 % interval.
    pub interval: [f64; 2],
    /// Effective number of failures behind it.
    pub ess: f64,
    /// Number of failures behind it.
    pub hits: usize,
}

impl RiskEstimate {
    /// Returns the greater distance of an end from the estimate, as a share of it.
    pub fn half_width(&self) -> f64 {
        // In intervals of small rates the upper end is the farther one.
        self.interval[1] / self.probability - 1.0
    }

    /// Returns the estimate of a rate of natural runs.
    pub(super) fn counted(hits: usize, n: usize) -> RiskEstimate {
        RiskEstimate {
            probability: hits as f64 / n.max(1) as f64,
            interval: wilson(hits, n),
            ess: hits as f64,
            hits,
        }
    }

    /// Returns the estimate times a rate that is measured independently.
    ///
    /// The widths are added as squares on the logarithmic scale.
    pub(super) fn times(&self, other: &RiskEstimate) -> RiskEstimate {
        let probability = self.probability * other.probability;
        let spread = |side: usize| {
            let of = |it: &RiskEstimate| libm::log(it.interval[side] / it.probability);
            libm::hypot(of(self), of(other))
        };
        RiskEstimate {
            probability,
            interval: [
                probability * libm::exp(-spread(0)),
                probability * libm::exp(spread(1)),
            ],
            ..*self
        }
    }

    /// Returns the estimate divided by an exact or independently measured rate.
    pub(super) fn over(&self, other: &RiskEstimate) -> RiskEstimate {
        // An exact rate adds no width.
        if other.interval == [other.probability; 2] {
            return self.scaled(1.0 / other.probability);
        }
        // Nothing was observed, and 0 has no logarithm.
        if self.probability <= 0.0 {
            return RiskEstimate {
                interval: [0.0, self.interval[1] / other.interval[0]],
                ..*self
            };
        }
        // A reciprocal exchanges the ends.
        let [lo, hi] = other.interval.map(|end| 1.0 / end);
        self.times(&RiskEstimate {
            probability: 1.0 / other.probability,
            interval: [hi, lo],
            ..*other
        })
    }

    /// Returns the estimate with an interval of probabilities.
    pub(super) fn at_most_one(&self) -> RiskEstimate {
        RiskEstimate {
            interval: self.interval.map(|end| end.min(1.0)),
            ..*self
        }
    }

    /// Returns the estimate times a number.
    pub(super) fn scaled(&self, by: f64) -> RiskEstimate {
        RiskEstimate {
            probability: by * self.probability,
            interval: self.interval.map(|end| by * end),
            ..*self
        }
    }
}

impl Round {
    /// Returns the number of draws.
    pub(super) fn len(&self) -> usize {
        self.draws.iter().sum()
    }

    /// Returns the round in which every fault is a failure, lawful and preventable.
    pub(super) fn with_failing_faults(&self) -> Round {
        let faults = self.faults.iter().map(|fault| WeightedFailure {
            index: fault.index,
            component: fault.component,
            weight: fault.weight,
            mode: "fault".to_owned(),
            // The worst reading of a fault, so that every bound allows for it.
            lawful: true,
            preventable: Some(DriverAnswer::Avoids),
        });
        Round {
            draws: self.draws.clone(),
            failures: self.failures.iter().cloned().chain(faults).collect(),
            faults: Vec::new(),
        }
    }

    /// Returns the mean of values per draw, and its variance, stratified by component.
    ///
    /// `values` has component and value of all draws that are not 0.
    pub(super) fn mean(&self, values: impl Iterator<Item = (usize, f64)>) -> (f64, f64) {
        let mut sums = vec![[0.0; 2]; self.draws.len()];
        for (component, value) in values {
            sums[component][0] += value;
            sums[component][1] += value * value;
        }
        let n = self.len() as f64;
        let mean = sums.iter().map(|[sum, _]| sum).sum::<f64>() / n;
        let variance = sums.iter().zip(&self.draws).map(|([sum, squares], draws)| {
            let draws = *draws as f64;
            // Cancellation may leave a small negative number.
            let spread = (squares - sum * sum / draws.max(1.0)).max(0.0);
            draws * spread / (draws - 1.0).max(1.0)
        });
        (mean, variance.sum::<f64>() / (n * n))
    }
}

/// Returns the share of each round in a pooled estimate.
///
/// It is the square-root rule of Owen and Zhou: round k has n √k. Later rounds have better
/// proposals, and shares that knew the results would bias the estimate.
fn round_shares(rounds: &[Round]) -> Vec<f64> {
    let raw: Vec<f64> = rounds
        .iter()
        .zip(1..)
        .map(|(round, k)| {
            let k: u32 = k;
            round.len() as f64 * libm::sqrt(f64::from(k))
        })
        .collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|it| it / sum).collect()
}

/// Returns the pooled share of runs that ended in a fault.
pub(super) fn fault_share(rounds: &[Round]) -> f64 {
    let shares = round_shares(rounds);
    let all = rounds.iter().zip(shares).map(|(round, share)| {
        let sum: f64 = round.faults.iter().map(|it| it.weight).sum();
        share * sum / round.len() as f64
    });
    all.sum()
}

/// Returns the contributions of the counted failures to the pooled estimate.
fn contributions(rounds: &[Round], counts: impl Fn(&WeightedFailure) -> bool) -> Vec<f64> {
    let shares = round_shares(rounds);
    let all = rounds.iter().zip(&shares).flat_map(|(round, share)| {
        let each = share / round.len() as f64;
        let counted = round.failures.iter().filter(|it| counts(it));
        counted.map(move |it| each * it.weight)
    });
    all.collect()
}

/// Returns the pooled estimate of the counted failures. `None` without one.
pub(super) fn pooled(
    rounds: &[Round],
    counts: impl Fn(&WeightedFailure) -> bool,
) -> Option<RiskEstimate> {
    let parts = contributions(rounds, &counts);
    let squares: f64 = parts.iter().map(|it| it * it).sum();
    let (mut probability, mut variance) = (0.0, 0.0);
    for (round, share) in rounds.iter().zip(round_shares(rounds)) {
        let counted = round.failures.iter().filter(|it| counts(it));
        let (mean, spread) = round.mean(counted.map(|it| (it.component, it.weight)));
        probability += share * mean;
        variance += share * share * spread;
    }
    // Without a failure, there is no spread for an interval.
    if probability <= 0.0 {
        return None;
    }
    let ess = probability * probability / squares;
    // On the logarithmic scale, and with Student's t, because few heavy weights skew the
    // estimate.
    let t = student_quantile(1.0 - 0.5 * ERROR, freedom(&parts, ess));
    let factor = libm::exp(t * libm::sqrt(variance) / probability);
    Some(RiskEstimate {
        probability,
        interval: [probability / factor, (probability * factor).min(1.0)],
        ess,
        hits: parts.len(),
    })
}

/// Estimate of a round beside that of the others.
pub(super) struct RoundDistance {
    /// Their difference in joint standard errors.
    pub(super) apart: f64,
    /// Degrees of freedom of the standard errors.
    pub(super) freedom: f64,
}

/// Returns how far the estimate of a round is from that of the others. `None` without one.
pub(super) fn distance(rounds: &[Round], of: usize) -> Option<RoundDistance> {
    let others: Vec<Round> = rounds
        .iter()
        .enumerate()
        .filter(|(at, _)| *at != of)
        .map(|(_, round)| round.clone())
        .collect();
    let [one, many] = [&rounds[of..=of], &others[..]].map(spread);
    let (own, rest) = (one?, many?);
    Some(RoundDistance {
        apart: (own.mean - rest.mean).abs() / libm::sqrt(own.variance + rest.variance),
        // The spread that is known least limits the comparison.
        freedom: own.freedom.min(rest.freedom),
    })
}

/// Mean of rounds with its spread.
struct RoundMean {
    mean: f64,
    variance: f64,
    freedom: f64,
}

/// Returns the mean of the failures of rounds. `None` without a round that varies.
fn spread(rounds: &[Round]) -> Option<RoundMean> {
    let parts = contributions(rounds, |_| true);
    let (mut mean, mut variance) = (0.0, 0.0);
    for (round, share) in rounds.iter().zip(round_shares(rounds)) {
        let failures = round.failures.iter();
        let (own, spread) = round.mean(failures.map(|it| (it.component, it.weight)));
        mean += share * own;
        variance += share * share * spread;
    }
    let squares: f64 = parts.iter().map(|it| it * it).sum();
    (variance > 0.0).then(|| RoundMean {
        mean,
        variance,
        freedom: freedom(&parts, mean * mean / squares),
    })
}

/// Returns the degrees of freedom of the spread of an estimate, at least 1.
///
/// A few heavy contributions x make the spread itself uncertain. Satterthwaite's formula
/// is 2 (Σ x²)² / Σ x⁴, for rare contributions.
fn freedom(contributions: &[f64], ess: f64) -> f64 {
    let squares = contributions.iter().map(|it| it * it);
    let fourths: f64 = squares.clone().map(|it| it * it).sum();
    let sum: f64 = squares.sum();
    // Without any spread, 0 / 0 leaves the other number.
    (2.0 * sum * sum / fourths).min(ess - 1.0).max(1.0)
}

/// Tail of the weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WeightTail {
    /// Shape k̂ of the largest contributions.
    pub(super) k: f64,
    /// Expected share of weights that are greater than all so far.
    pub(super) unseen: f64,
}

/// Returns the tail of the contributions to the pooled estimate.
///
/// `cap` is the greatest weight that a proposal allows. A fitted tail has no end, and k̂ of
/// few or equal weights is often large by chance. So k̂ alone would refuse estimates
/// whose largest weights carry nothing.
pub(super) fn weight_tail(rounds: &[Round], cap: f64) -> Option<WeightTail> {
    let mut parts = contributions(rounds, |_| true);
    parts.sort_by(|a, b| b.total_cmp(a));
    let k = pareto_k(&parts)?;
    let weights = rounds.iter().flat_map(|round| &round.failures);
    let greatest = weights.map(|it| it.weight).fold(0.0, f64::max);
    Some(WeightTail {
        k,
        unseen: greatest_share(rounds) * beyond_greatest(k, (cap / greatest).max(1.0)),
    })
}

/// Returns the mean sum of Pareto weights from the greatest seen to `reach` times it.
///
/// One weight is expected above the greatest, with the density of shape k.
fn beyond_greatest(k: f64, reach: f64) -> f64 {
    let slope = 1.0 / k.max(0.01);
    if (slope - 1.0).abs() < 1e-6 {
        return libm::log(reach);
    }
    slope * (libm::pow(reach, 1.0 - slope) - 1.0) / (1.0 - slope)
}

/// Returns k̂ of the largest of sorted contributions. `None` for too few.
fn pareto_k(parts: &[f64]) -> Option<f64> {
    let hits = parts.len() as f64;
    // The size of the tail is that of Pareto-smoothed importance sampling.
    let tail = (0.2 * hits).min(3.0 * libm::sqrt(hits)).max(5.0) as usize;
    let threshold = *parts.get(tail)?;
    let above = parts[..tail].iter().map(|it| it - threshold);
    // Equal weights, as in worlds with few paths, have no tail.
    let excesses: Vec<f64> = above.filter(|it| *it > 0.0).collect();
    match excesses.len() {
        0 => Some(0.0),
        // Too few for a fit, so the shape is that of a mean that barely exists.
        1..=4 => Some(1.0),
        _ => pareto_shape(&excesses),
    }
}

/// Returns the share of the greatest contribution.
pub(super) fn greatest_share(rounds: &[Round]) -> f64 {
    let parts = contributions(rounds, |_| true);
    let sum: f64 = parts.iter().sum();
    parts.iter().copied().fold(0.0, f64::max) / sum.max(f64::MIN_POSITIVE)
}

/// Upper bound that holds whatever the proposals missed.
///
/// Up to the weight `limit`, which earlier runs fixed, the empirical Bernstein bound of
/// Maurer and Pontil (2009) holds for the last round. Above it, only natural runs count,
/// of which the first of `beyond` failed among the second. Both parts share the error.
pub(super) fn bound(last: &Round, limit: f64, beyond: [usize; 2], error: f64) -> f64 {
    let n = last.len() as f64;
    let light = last.failures.iter().filter(|it| it.weight <= limit);
    let sums = light.fold([0.0; 2], |[sum, squares], it| {
        [sum + it.weight, squares + it.weight * it.weight]
    });
    let mean = sums[0] / n;
    // It is the variance of the mean, so the bound has no further division by n.
    let variance = (sums[1] - n * mean * mean).max(0.0) / (n * (n - 1.0));
    let log = libm::log(4.0 / error);
    let inside = mean + libm::sqrt(2.0 * variance * log) + 7.0 * limit * log / (3.0 * (n - 1.0));
    let [failed, natural] = beyond;
    inside + clopper_pearson_upper(failed, natural, 0.5 * error)
}

/// Ratio of two risks on the same draws.
///
/// The interval is for the ratio of the first to the second. `None` without failures.
pub(super) fn ratio(first: &[Round], second: &[Round]) -> Option<RiskEstimate> {
    let [a, b] = [pooled(first, |_| true)?, pooled(second, |_| true)?];
    let (mut variance, mut parts) = (0.0, Vec::new());
    let shares = round_shares(first);
    for ((own, other), share) in first.iter().zip(second).zip(shares) {
        let side = |round: &Round, by: f64| -> Vec<(usize, usize, f64)> {
            let all = round.failures.iter();
            all.map(|it| (it.index, it.component, it.weight / by))
                .collect()
        };
        // Draws on which both egos fail cancel out, as far as they weigh the same.
        let mut values = side(own, a.probability);
        values.extend(side(other, -b.probability));
        values.sort_by_key(|(index, ..)| *index);
        let paired = values.chunk_by(|a, b| a.0 == b.0);
        let sums: Vec<(usize, f64)> = paired
            .map(|of| (of[0].1, of.iter().map(|it| it.2).sum::<f64>()))
            .collect();
        let each = share / own.len() as f64;
        parts.extend(sums.iter().map(|(_, sum)| each * sum));
        variance += share * share * own.mean(sums.into_iter()).1;
    }
    let probability = a.probability / b.probability;
    // The weaker of both estimates limits the ratio.
    let ess = a.ess.min(b.ess);
    let t = student_quantile(1.0 - 0.5 * ERROR, freedom(&parts, ess));
    let factor = libm::exp(t * libm::sqrt(variance));
    Some(RiskEstimate {
        probability,
        interval: [probability / factor, probability * factor],
        ess,
        hits: a.hits.min(b.hits),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::generator;
    use rand::RngExt;

    /// Failures of a chain of two steps with exact probability 0.02 · 0.1.
    ///
    /// Component 0 is natural. Component 1 takes the rare step with 0.5 and the second
    /// one with 0.8.
    fn rounds(seed: u64, sizes: &[usize]) -> Vec<Round> {
        let mut rng = generator("pool", &[seed]);
        let shares = [0.1, 0.9];
        let round = |n: &usize| {
            let draws = [n / 10, n - n / 10];
            let mut failures = Vec::new();
            for index in 0..*n {
                let component = usize::from(draws[0] <= index);
                let q = [[0.02, 0.1], [0.5, 0.8]][component];
                if rng.random::<f64>() < q[0] && rng.random::<f64>() < q[1] {
                    let ratio = 0.5 * 0.8 / (0.02 * 0.1);
                    failures.push(WeightedFailure {
                        index,
                        component,
                        weight: 1.0 / (shares[0] + shares[1] * ratio),
                        mode: String::new(),
                        lawful: index % 2 == 0,
                        preventable: None,
                    });
                }
            }
            Round {
                draws: draws.to_vec(),
                failures,
                faults: Vec::new(),
            }
        };
        sizes.iter().map(round).collect()
    }

    #[test]
    fn pooled_estimates_are_unbiased_and_their_intervals_cover() {
        let truth = 0.002;
        let (mut sum, mut squares, mut covered, mut unweighted) = (0.0, 0.0, 0, 0.0);
        let repeats = 200;
        for seed in 0..repeats {
            let rounds = rounds(seed, &[500, 1000]);
            let found = pooled(&rounds, |_| true).expect("failures");
            let [lo, hi] = found.interval;
            covered += usize::from((lo..=hi).contains(&truth));
            sum += found.probability;
            squares += found.probability * found.probability;
            let mut blind = rounds.clone();
            for round in &mut blind {
                round.failures.iter_mut().for_each(|it| it.weight = 1.0);
            }
            unweighted += pooled(&blind, |_| true).expect("failures").probability;
        }
        let n = repeats as f64;
        let mean = sum / n;
        let error = libm::sqrt((squares / n - mean * mean) / n);
        assert!((mean - truth).abs() < 3.0 * error, "{mean} ± {error}");
        assert!(covered >= 180, "{covered} of 200 intervals cover");
        // Without weights the estimate is that of the proposal.
        assert!(unweighted / n > 0.3);
    }

    #[test]
    fn a_heavy_contribution_leaves_few_degrees_of_freedom() {
        // Equal contributions have twice as many as there are.
        assert!((freedom(&[1e-9; 40], 1e9) - 80.0).abs() < 1e-9);
        assert_eq!(freedom(&[1e-9; 40], 40.0), 39.0);
        // One of 20 that is ten times as heavy carries nearly all of the spread.
        let mut heavy = [1e-9; 20];
        heavy[7] = 1e-8;
        let exact = 2.0 * 119.0 * 119.0 / 10_019.0;
        assert!((freedom(&heavy, 1e9) - exact).abs() < 1e-9);
        assert_eq!(freedom(&[0.0; 3], 3.0), 2.0);
        assert_eq!(freedom(&[1.0], 1.0), 1.0);
    }

    #[test]
    fn an_ego_has_the_ratio_one_to_itself_with_no_width() {
        let own = rounds(7, &[1000]);
        let found = ratio(&own, &own).expect("failures");
        assert!((found.probability - 1.0).abs() < 1e-12 && found.half_width() < 1e-9);
        let mut fewer = own.clone();
        fewer[0].failures.retain(|it| it.lawful);
        let found = ratio(&fewer, &own).expect("failures");
        let [lo, hi] = found.interval;
        assert!(lo < 0.5 && hi > 0.5 && hi < 0.6, "{found:?}");
    }

    #[test]
    fn the_bound_is_above_the_estimate_and_grows_with_failures_beyond() {
        let rounds = rounds(3, &[2000]);
        let limit = rounds[0].failures[0].weight;
        let none = bound(&rounds[0], limit, [0, 10_000], ERROR);
        let two = bound(&rounds[0], limit, [2, 10_000], ERROR);
        assert!(none > 0.002 && none < two, "{none} {two}");
        // Weights beyond the limit leave the first part.
        assert!(bound(&rounds[0], 0.5 * limit, [0, 10_000], ERROR) < none);
    }

    #[test]
    fn heavy_tails_matter_as_far_as_they_carry_something() {
        // The mean of a Pareto density between 1 and 10, in closed form for k = 1/2.
        assert!((beyond_greatest(0.5, 10.0) - 1.8).abs() < 1e-12);
        assert!((beyond_greatest(1.0, 10.0) - libm::log(10.0)).abs() < 1e-9);
        assert_eq!(beyond_greatest(2.0, 1.0), 0.0);
        let round = |weights: &[f64]| Round {
            draws: vec![20_000],
            failures: weights
                .iter()
                .enumerate()
                .map(|(index, weight)| WeightedFailure {
                    index,
                    component: 0,
                    weight: *weight,
                    mode: String::new(),
                    lawful: true,
                    preventable: None,
                })
                .collect(),
            faults: Vec::new(),
        };
        // Quantiles of a Pareto density of shape 1.2, alone and beside many equal weights.
        let heavy = |i: u32| 1e-4 * libm::pow((f64::from(i) + 0.5) / 200.0, -1.2);
        let alone: Vec<f64> = (0..200).map(heavy).collect();
        let found = weight_tail(&[round(&alone)], 10.0).expect("enough");
        assert!(found.k > 0.7 && found.unseen > 0.3, "{found:?}");
        let mut beside = alone;
        beside.extend([1e-3; 4000]);
        let found = weight_tail(&[round(&beside)], 10.0).expect("enough");
        assert!(found.unseen < 0.2, "{found:?}");
    }

    #[test]
    fn a_rate_divides_and_multiplies_with_its_width() {
        let risk = RiskEstimate::counted(100, 10_000);
        let rate = RiskEstimate::counted(900, 1000);
        let over = risk.over(&rate);
        assert!((over.probability - 0.01 / 0.9).abs() < 1e-12);
        assert!(risk.half_width() < over.half_width());
        let back = over.times(&rate);
        assert!((back.probability - 0.01).abs() < 1e-12);
        // A wide interval over a rate ends at 1.
        let wide = RiskEstimate {
            interval: [1e-9, 0.95],
            ..risk
        };
        assert!(wide.over(&rate).interval[1] > 1.0);
        assert_eq!(wide.over(&rate).at_most_one().interval[1], 1.0);
        // No hit leaves an upper end, above that of the count alone.
        let none = RiskEstimate::counted(0, 10_000);
        let [lo, hi] = none.over(&rate).interval;
        assert!(lo == 0.0 && none.interval[1] / 0.9 < hi && hi < 2.0 * none.interval[1]);
    }

    #[test]
    fn means_and_variances_are_stratified_by_component() {
        let round = Round {
            draws: vec![4, 6],
            ..Round::default()
        };
        let (mean, variance) = round.mean([(0, 1.0), (0, 3.0), (1, 2.0)].into_iter());
        assert!((mean - 0.6).abs() < 1e-12 && (variance - 0.12).abs() < 1e-12);
        // A single draw of a component has no spread, and no division by 0.
        let round = Round {
            draws: vec![1, 0, 3],
            ..Round::default()
        };
        let (mean, variance) = round.mean([(0, 2.0)].into_iter());
        assert_eq!((mean, variance), (0.5, 0.0));
    }

    /// Round of failures of equal weights.
    fn equal(draws: usize, failures: usize, weight: f64) -> Round {
        let failure = |index| WeightedFailure {
            index,
            component: 0,
            weight,
            mode: String::new(),
            lawful: true,
            preventable: None,
        };
        Round {
            draws: vec![draws],
            failures: (0..failures).map(failure).collect(),
            faults: Vec::new(),
        }
    }

    #[test]
    fn pooled_estimates_have_exact_numbers() {
        let found = pooled(&[equal(10_000, 100, 0.1)], |_| true).expect("failures");
        assert!((found.probability - 1e-3).abs() < 1e-12);
        assert!((found.ess - 100.0).abs() < 1e-9 && found.hits == 100);
        // The error of the mean is √(1 − 0.01²) / 10,000 up to 1 / n, and t of 99 is 1.984.
        let spread = libm::log(found.interval[1] / found.probability);
        assert!((spread - 1.98422 * 0.0995).abs() < 1e-4, "{spread}");
        let product = found.interval[0] * found.interval[1];
        assert!((product - 1e-6).abs() < 1e-12);
        assert!(pooled(&[equal(100, 0, 1.0)], |_| true).is_none());
        assert!(pooled(&[equal(100, 9, 1.0)], |it| !it.lawful).is_none());
        // An interval of probabilities ends at 1.
        let wide = pooled(&[equal(2, 1, 1.8)], |_| true).expect("a failure");
        assert_eq!(wide.interval[1], 1.0);
        // The second of two rounds of one size counts √2 times as much as the first.
        let two = [equal(1000, 10, 1.0), equal(1000, 20, 1.0)];
        let found = pooled(&two, |_| true).expect("failures").probability;
        let root = std::f64::consts::SQRT_2;
        assert!((found - (0.01 + root * 0.02) / (1.0 + root)).abs() < 1e-12);
        // A larger round counts as its size.
        let two = [equal(3000, 30, 1.0), equal(1000, 20, 1.0)];
        let found = pooled(&two, |_| true).expect("failures").probability;
        assert!((found - (3.0 * 0.01 + root * 0.02) / (3.0 + root)).abs() < 1e-12);
    }

    #[test]
    fn the_bound_has_exact_parts() {
        let mut last = equal(1000, 2, 0.5);
        last.failures[1].weight = 2.0;
        // The part up to the limit, and that of no failure in 1000 natural runs.
        let above = 1.0 - libm::pow(0.025, 1e-3);
        let found = bound(&last, 1.0, [0, 1000], ERROR);
        assert!(
            (found - (0.012_215_170_965 + above)).abs() < 1e-9,
            "{found}"
        );
        // A weight at the limit counts.
        assert!(bound(&last, 2.0, [0, 1000], ERROR) > found);
        assert!(bound(&last, 0.5, [0, 1000], ERROR) < found);
    }

    #[test]
    fn a_tail_needs_more_than_five_failures_of_different_weights() {
        assert_eq!(pareto_k(&[1.0; 5]), None);
        assert_eq!(pareto_k(&[1.0; 6]), Some(0.0));
        let mut few = vec![1.0; 40];
        few[..3].fill(2.0);
        assert_eq!(pareto_k(&few), Some(1.0));
        let rising: Vec<f64> = (0..100).map(|at| 1.0 / (1.0 + f64::from(at))).collect();
        assert!(pareto_k(&rising).expect("enough") > 0.5);
        // The greatest of these contributions has a tenth of all.
        let mut round = equal(100, 91, 1.0);
        round.failures[40].weight = 10.0;
        assert!((greatest_share(&[round]) - 0.1).abs() < 1e-12);
        assert_eq!(greatest_share(&[equal(100, 0, 1.0)]), 0.0);
    }

    #[test]
    fn faults_are_lawful_and_preventable_failures_at_the_most() {
        let mut round = equal(1000, 10, 0.5);
        round.failures[0].lawful = false;
        let fault = |index| WeightedFault {
            index,
            component: 0,
            weight: 0.25,
        };
        round.faults = vec![fault(500), fault(501)];
        let failing = round.with_failing_faults();
        assert_eq!((failing.len(), failing.failures.len()), (1000, 12));
        assert!(failing.faults.is_empty());
        let of = |rounds: &[Round], lawful: bool| {
            let found = pooled(rounds, |it| it.lawful || !lawful);
            (found.expect("failures").probability * 1e6).round()
        };
        let (rounds, failing) = ([round], [failing]);
        assert_eq!((of(&rounds, false), of(&rounds, true)), (5000.0, 4500.0));
        assert_eq!((of(&failing, false), of(&failing, true)), (5500.0, 5000.0));
        let avoided = pooled(&failing, |it| it.preventable == Some(DriverAnswer::Avoids));
        assert_eq!(avoided.expect("faults").hits, 2);
        assert!((fault_share(&rounds) - 5e-4).abs() < 1e-12);
        // Two rounds share it as they share the estimate.
        let root = std::f64::consts::SQRT_2;
        let two = [rounds[0].clone(), equal(1000, 1, 1.0)];
        assert!((fault_share(&two) - 5e-4 / (1.0 + root)).abs() < 1e-12);
    }

    #[test]
    fn an_exact_rate_divides_without_width_and_a_ratio_has_no_limit_of_one() {
        let risk = RiskEstimate::counted(100, 10_000);
        let half = RiskEstimate {
            probability: 0.5,
            interval: [0.5; 2],
            ess: 1.0,
            hits: 1,
        };
        let over = risk.over(&half);
        assert!((over.probability - 0.02).abs() < 1e-12);
        assert!((over.half_width() - risk.half_width()).abs() < 1e-12);
        assert_eq!((over.hits, over.ess), (100, 100.0));
        let [many, few] = [equal(1000, 60, 1.0), equal(1000, 30, 1.0)].map(|it| [it]);
        let found = ratio(&many, &few).expect("failures");
        assert!((found.probability - 2.0).abs() < 1e-12);
        // The weaker of both limits it.
        assert_eq!((found.hits, found.ess.round()), (30, 30.0));
        assert!(found.interval[0] < 2.0 && found.interval[1] > 2.0);
        assert!(ratio(&many, &[equal(1000, 0, 1.0)]).is_none());
        // Failures on the same draws cancel out, and on others they do not.
        let mut elsewhere = few.clone();
        elsewhere[0]
            .failures
            .iter_mut()
            .for_each(|it| it.index += 500);
        let apart = ratio(&many, &elsewhere).expect("failures");
        assert!(
            found.half_width() + 0.1 < apart.half_width(),
            "{found:?} {apart:?}"
        );
    }

    #[test]
    fn widths_add_as_squares_on_each_side() {
        let of = |probability: f64, interval| RiskEstimate {
            probability,
            interval,
            ess: 30.0,
            hits: 40,
        };
        let (risk, rate) = (of(0.01, [0.008, 0.012]), of(0.9, [0.85, 0.92]));
        let near = |found: [f64; 2], expected: [f64; 2]| {
            let pairs = found.iter().zip(expected);
            let far = pairs.map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
            assert!(far < 1e-12, "{found:?}, not {expected:?}");
        };
        let side = |own: f64, other: f64| libm::hypot(libm::log(own), libm::log(other));
        let times = risk.times(&rate);
        let expected = [side(0.8, 0.85 / 0.9), -side(1.2, 0.92 / 0.9)];
        near(times.interval, expected.map(|it| 0.009 * libm::exp(-it)));
        // A greater rate makes a smaller quotient, so the sides of the rate change.
        let over = risk.over(&rate);
        let expected = [side(0.8, 0.9 / 0.92), -side(1.2, 0.9 / 0.85)];
        near(
            over.interval,
            expected.map(|it| 0.01 / 0.9 * libm::exp(-it)),
        );
        assert_eq!((over.ess, over.hits, times.hits), (30.0, 40, 40));
        // Without a hit, the end is divided by the least rate.
        let none = of(0.0, [0.0, 0.001]).over(&rate);
        near([1.0, none.interval[1]], [1.0, 0.001 / 0.85]);
    }

    #[test]
    fn a_ratio_has_an_exact_width() {
        let many = [equal(1000, 60, 1.0)];
        let mut few = [equal(1000, 30, 1.0)];
        few[0].failures.iter_mut().for_each(|it| it.index += 500);
        let found = ratio(&many, &few).expect("failures");
        // 60 values of 1 / 0.06 and 30 of −1 / 0.03 have the variance 50 · 1000 / 999, and
        // t of 29 is 2.04523.
        let spread = 2.04523 * libm::sqrt(0.05 * 1000.0 / 999.0);
        for (side, sign) in [(0, -1.0), (1, 1.0)] {
            let log = libm::log(found.interval[side] / 2.0);
            assert!((log - sign * spread).abs() < 1e-4, "{log}, not {spread}");
        }
    }
}
