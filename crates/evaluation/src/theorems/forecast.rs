//! Prediction of carry-over before a run, by a conformal bound on the distance.
//!
//! Split conformal prediction (Vovk, Gammerman, Shafer 2005): of n calibration distances
//! the ⌈(n + 1)(1 − α)⌉-th smallest is a bound. A further exchangeable distance stays
//! below it with probability at least 1 − α, whatever the distribution.

use serde::{Serialize, Serializer};

use crate::run_dir::number_or_word;
use crate::stats::wilson;

/// Probability below which the coverage counts as a failure.
const TOO_IMPROBABLE: f64 = 1e-3;

/// Prediction of carry-over, compared with the test starts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Counterexamples on calibration starts.
    pub calibration: usize,
    /// Bounds that the distance stays below with probability 1 − α.
    ///
    /// They bound ε, or for the sharper test the increase and then each rule's ε.
    #[serde(serialize_with = "numbers_or_words")]
    pub quantiles: Vec<f64>,
    /// Share of test pairs that stay below the bounds.
    pub coverage: f64,
    /// Wilson's 95 % interval of the coverage.
    pub coverage_ci95: [f64; 2],
    /// Probability of at most this coverage for exchangeable starts.
    pub(crate) chance_of_so_little: f64,
    /// Whether coverage agrees with the promised 1 − α.
    pub as_promised: bool,
    /// Share of test pairs for which carry-over was predicted.
    pub predicted: f64,
    /// Share of correct predictions. `None`: no predictions.
    pub precision: Option<f64>,
    /// Share of carried-over pairs that were predicted. `None`: no such pairs.
    pub recall: Option<f64>,
}

/// Test pair in the form that a forecast uses.
pub(super) struct ForecastCase {
    /// Distances that the prediction bounded.
    pub distances: Vec<f64>,
    /// Margins below which carry-over is certain.
    pub margins: Vec<f64>,
    /// True if the pair carried over.
    pub carried: bool,
}

/// Bounds each component of the distance, jointly at level 1 − `alpha`.
///
/// Several components share `alpha` equally (Bonferroni).
pub(super) fn forecast(calibration: &[Vec<f64>], tests: &[ForecastCase], alpha: f64) -> Forecast {
    // Without calibration α is not divided, and the bound is infinite anyway.
    let components = calibration.first().map_or(1, Vec::len).max(1);
    let share = alpha / components as f64;
    let quantiles: Vec<f64> = (0..components)
        .map(|k| {
            let column = calibration.iter().filter_map(|distances| distances.get(k));
            conformal(column.copied().collect(), share)
        })
        .collect();
    let below = |case: &&ForecastCase| {
        let mut pairs = case.distances.iter().zip(&quantiles);
        pairs.all(|(distance, q)| distance <= q)
    };
    let promises = |case: &&ForecastCase| {
        let mut pairs = quantiles.iter().zip(&case.margins);
        // Strictly below, as Theorem 3 requires ε < τ.
        pairs.all(|(q, margin)| q < margin)
    };
    let count = |test: &dyn Fn(&&ForecastCase) -> bool| tests.iter().filter(test).count();
    let covered = count(&below);
    let predicted = count(&promises);
    let carried = count(&|case| case.carried);
    let both = count(&|case| case.carried && promises(case));
    let n = calibration.len();
    // A rank beyond n means an infinite bound, which covers everything.
    let rank = rank(n, alpha).min(n + 1);
    let chance = match components {
        1 => chance_of_at_most(covered, tests.len(), rank, n + 1 - rank),
        // Bonferroni covers more than promised, so a plain binomial is a lenient comparison.
        _ => binomial_at_most(covered, tests.len(), 1.0 - alpha),
    };
    Forecast {
        calibration: n,
        quantiles,
        coverage: ratio(covered, tests.len()).unwrap_or(0.0),
        coverage_ci95: wilson(covered, tests.len()),
        chance_of_so_little: chance,
        as_promised: chance >= TOO_IMPROBABLE,
        predicted: ratio(predicted, tests.len()).unwrap_or(0.0),
        precision: ratio(both, predicted),
        recall: ratio(both, carried),
    }
}

fn ratio(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

/// Returns ⌈(n + 1)(1 − α)⌉. Beyond n there is no finite bound.
fn rank(n: usize, alpha: f64) -> usize {
    // Rounding must not lift an integer product to the next rank.
    ((n + 1) as f64 * (1.0 - alpha) - 1e-9).ceil().max(1.0) as usize
}

fn conformal(mut values: Vec<f64>, alpha: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    // Ranks count from 1.
    let bound = values.get(rank(values.len(), alpha) - 1);
    bound.copied().unwrap_or(f64::INFINITY)
}

/// Returns P(at most `k` of `m`) with a Beta(`a`, `b`) probability of each.
///
/// This is the coverage of a conformal bound over both draws (Vovk 2012). `b` = 0 covers
/// everything.
fn chance_of_at_most(k: usize, m: usize, a: usize, b: usize) -> f64 {
    // An infinite bound covers every test, so that a single miss is impossible.
    if b == 0 {
        return if k < m { 0.0 } else { 1.0 };
    }
    let (a, b) = (a as f64, b as f64);
    let term = |j: usize| {
        let (j, m) = (j as f64, m as f64);
        // Logarithms of the gamma function keep the binomial coefficients finite.
        let choose = ln_gamma(m + 1.0) - ln_gamma(j + 1.0) - ln_gamma(m - j + 1.0);
        choose + ln_beta(j + a, m - j + b) - ln_beta(a, b)
    };
    // Rounding may lift the sum above 1.
    (0..=k).map(|j| libm::exp(term(j))).sum::<f64>().min(1.0)
}

fn binomial_at_most(k: usize, m: usize, p: f64) -> f64 {
    // A probability of 0 or 1 has no finite logarithm and promises nothing testable.
    if p <= 0.0 || p >= 1.0 {
        return 1.0;
    }
    let term = |j: usize| {
        let (j, m) = (j as f64, m as f64);
        let choose = ln_gamma(m + 1.0) - ln_gamma(j + 1.0) - ln_gamma(m - j + 1.0);
        choose + j * libm::log(p) + (m - j) * libm::log(1.0 - p)
    };
    (0..=k).map(|j| libm::exp(term(j))).sum::<f64>().min(1.0)
}

fn ln_beta(a: f64, b: f64) -> f64 {
    ln_gamma(a) + ln_gamma(b) - ln_gamma(a + b)
}

fn ln_gamma(x: f64) -> f64 {
    libm::lgamma(x)
}

/// Serializes infinities as the words "inf" and "-inf", because JSON has none.
fn numbers_or_words<S: Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|value| number_or_word(*value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_the_rank_that_exchangeability_gives() {
        let values: Vec<f64> = (1..=19).map(f64::from).collect();
        assert_eq!(conformal(values.clone(), 0.1), 18.0);
        assert_eq!(conformal(values.clone(), 0.05), 19.0);
        assert_eq!(conformal(values, 0.04), f64::INFINITY);
        assert_eq!(conformal(Vec::new(), 0.1), f64::INFINITY);
    }

    #[test]
    fn chances_are_those_of_the_textbook() {
        // With a uniform probability every count from 0 to m is equally likely.
        for k in 0..=10 {
            let chance = chance_of_at_most(k, 10, 1, 1);
            assert!((chance - (k + 1) as f64 / 11.0).abs() < 1e-12);
        }
        assert!((binomial_at_most(1, 3, 0.5) - 0.5).abs() < 1e-12);
        assert!((binomial_at_most(3, 3, 0.9) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_prediction_is_made_where_the_bound_is_below_the_margin() {
        let calibration: Vec<Vec<f64>> = (1..=9).map(|i| vec![f64::from(i)]).collect();
        let case = |distance, margin, carried| ForecastCase {
            distances: vec![distance],
            margins: vec![margin],
            carried,
        };
        let tests = [
            case(2.0, 10.0, true),
            case(9.5, 10.0, false),
            case(1.0, 5.0, true),
            case(3.0, 12.0, true),
        ];
        let forecast = forecast(&calibration, &tests, 0.1);
        assert_eq!(forecast.quantiles, [9.0]);
        assert_eq!(forecast.coverage, 0.75);
        assert_eq!(forecast.predicted, 0.75);
        assert_eq!(forecast.precision, Some(2.0 / 3.0));
        assert_eq!(forecast.recall, Some(2.0 / 3.0));
        assert!(forecast.as_promised);
    }

    fn case(distances: &[f64], margins: &[f64], carried: bool) -> ForecastCase {
        ForecastCase {
            distances: distances.to_vec(),
            margins: margins.to_vec(),
            carried,
        }
    }

    #[test]
    fn several_components_share_alpha_and_have_to_hold_together() {
        let calibration: Vec<Vec<f64>> = (1..=19)
            .map(|i| vec![f64::from(i), 100.0 * f64::from(i)])
            .collect();
        let tests = [
            case(&[18.0, 1800.0], &[18.5, 1801.0], true),
            case(&[1.0, 1801.0], &[18.5, 1801.0], true),
            case(&[19.0, 1.0], &[18.5, 1.0], false),
            case(&[1.0, 1.0], &[18.0, 1801.0], false),
        ];
        // Half of 0.2 each, so the 18th of 19.
        let found = forecast(&calibration, &tests, 0.2);
        assert_eq!(found.calibration, 19);
        assert_eq!(found.quantiles, [18.0, 1800.0]);
        assert_eq!(found.coverage, 0.5);
        assert_eq!(found.coverage_ci95, wilson(2, 4));
        assert_eq!(found.predicted, 0.5);
        assert_eq!((found.precision, found.recall), (Some(1.0), Some(1.0)));
        // At most two of four with 0.8 each.
        let chance = 1.0 - 4.0 * 0.8_f64.powi(3) * 0.2 - 0.8_f64.powi(4);
        assert!((found.chance_of_so_little - chance).abs() < 1e-9);
    }

    #[test]
    fn a_coverage_that_chance_does_not_explain_is_not_as_promised() {
        let calibration: Vec<Vec<f64>> = (1..=99).map(|i| vec![f64::from(i)]).collect();
        let with = |covered: usize| {
            let distance = |at: usize| if at < covered { 1.0 } else { 1e3 };
            let tests = (0..40).map(|at| case(&[distance(at)], &[0.0], false));
            forecast(&calibration, &tests.collect::<Vec<_>>(), 0.1)
        };
        assert!(with(36).as_promised && with(30).as_promised);
        assert!(!with(15).as_promised && !with(0).as_promised);
        // 90 of 99 are below a conformal bound of rank 90: a Beta(90, 10) of 40.
        let found = with(0).chance_of_so_little;
        let exact = (0..40).map(|j| f64::from(10 + j) / f64::from(100 + j));
        assert!(
            (found / exact.product::<f64>() - 1.0).abs() < 1e-6,
            "{found}"
        );
        // No prediction, and nothing that carried over, has no share.
        let none = with(36);
        assert_eq!(
            (none.predicted, none.precision, none.recall),
            (0.0, None, None)
        );
    }

    #[test]
    fn an_infinite_bound_covers_everything_and_is_a_word() {
        let found = forecast(&[vec![1.0]], &[case(&[5.0], &[9.0], true)], 0.1);
        assert_eq!((found.quantiles[0], found.coverage), (f64::INFINITY, 1.0));
        assert_eq!((found.chance_of_so_little, found.predicted), (1.0, 0.0));
        assert_eq!(found.recall, Some(0.0));
        let json = serde_json::to_value(&found).expect("words");
        assert_eq!(json["quantiles"], serde_json::json!(["inf"]));
        // A bound that covers everything cannot miss anything.
        assert_eq!(chance_of_at_most(3, 4, 5, 0), 0.0);
        assert_eq!(chance_of_at_most(4, 4, 5, 0), 1.0);
        assert_eq!([0.0, 1.0].map(|p| binomial_at_most(0, 4, p)), [1.0; 2]);
        assert_eq!(forecast(&[], &[], 0.1).coverage, 0.0);
    }
}
