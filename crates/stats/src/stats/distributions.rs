//! Distribution functions behind intervals: beta, Student t, normal and Pareto.

use special::Beta;

/// Returns the distribution function of Student's t with `freedom` > 0 degrees.
pub fn student_cdf(t: f64, freedom: f64) -> f64 {
    let half = 0.5 * freedom;
    let x = freedom / (freedom + t * t);
    let tail = 0.5 * x.inc_beta(half, 0.5, half.ln_beta(0.5));
    // The tail depends on t² alone, so the sign chooses the side.
    if t > 0.0 { 1.0 - tail } else { tail }
}

/// Returns the quantile of Student's t. Shares are inside (0, 1).
pub fn student_quantile(share: f64, freedom: f64) -> f64 {
    let half = 0.5 * freedom;
    let tail = share.min(1.0 - share);
    let x = (2.0 * tail).inv_inc_beta(half, 0.5, half.ln_beta(0.5));
    let t = libm::sqrt(freedom * (1.0 - x) / x);
    // The law is symmetric, so the quantile of the smaller tail serves both sides.
    if share > 0.5 { t } else { -t }
}

/// Returns the standard normal distribution function.
pub fn normal_cdf(z: f64) -> f64 {
    // `erfc` keeps the digits of small tails.
    0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2)
}

/// Returns the standard normal quantile. Shares are inside (0, 1).
pub fn normal_quantile(share: f64) -> f64 {
    // Below −38.5 the distribution function underflows to 0, so no share lies outside.
    let (mut lo, mut hi) = (-40.0, 40.0);
    // Eighty halvings exhaust the digits of this range.
    for _ in 0..80 {
        let middle = 0.5 * (lo + hi);
        if normal_cdf(middle) < share {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    0.5 * (lo + hi)
}

/// Upper bound of Clopper and Pearson of a rate, with `hits` of `n` trials.
///
/// The rate is above it with a probability of at most `error`. 1 for n = 0.
pub fn clopper_pearson_upper(hits: usize, n: usize, error: f64) -> f64 {
    // Without a miss no rate is excluded, and the beta law below has no parameter 0.
    if n <= hits {
        return 1.0;
    }
    let (above, below) = (hits as f64 + 1.0, (n - hits) as f64);
    let ln_beta = above.ln_beta(below);
    // The library's inverse has four digits only where rates are small.
    let (mut lo, mut hi) = (0.0, 1.0);
    // Rates of a millionth need the halvings that reach their last digit.
    for _ in 0..100 {
        let middle: f64 = 0.5 * (lo + hi);
        if middle.inc_beta(above, below, ln_beta) < 1.0 - error {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    0.5 * (lo + hi)
}

/// Returns the probability of at least `count` events of a Poisson law.
pub fn poisson_tail(count: usize, mean: f64) -> f64 {
    let (mut term, mut below) = (libm::exp(-mean), 0.0);
    for i in 0..count {
        below += term;
        term *= mean / (i as f64 + 1.0);
    }
    // Rounding may carry the sum slightly above 1.
    (1.0 - below).max(0.0)
}

/// Returns k̂, the shape of a generalized Pareto distribution of `excesses` above 0.
///
/// It is the estimator of Zhang and Stephens (2009) with the prior of Vehtari et al.
/// (2024), which pulls small samples to 0.5. At least five excesses are needed.
pub fn pareto_shape(excesses: &[f64]) -> Option<f64> {
    let mut x: Vec<f64> = excesses.to_vec();
    x.sort_by(f64::total_cmp);
    let (n, largest) = (x.len(), *x.last()?);
    let quartile = x[((n as f64 / 4.0 + 0.5) as usize).max(1) - 1];
    // The grid below divides by the quartile.
    if n < 5 || quartile <= 0.0 {
        return None;
    }
    let grid = 30 + libm::sqrt(n as f64) as usize;
    let theta = |j: usize| {
        // The root is above 1, so θ is below 1 / largest and each logarithm of 1 − θ x
        // exists.
        let root = libm::sqrt(grid as f64 / (j as f64 + 0.5));
        1.0 / largest + (1.0 - root) / (3.0 * quartile)
    };
    let shape = |theta: f64| {
        let sum: f64 = x.iter().map(|it| libm::log1p(-theta * it)).sum();
        sum / n as f64
    };
    let profile = |theta: f64| {
        let k = shape(theta);
        n as f64 * (libm::log(-theta / k) - k - 1.0)
    };
    let thetas: Vec<f64> = (0..grid).map(theta).collect();
    let likelihoods: Vec<f64> = thetas.iter().map(|it| profile(*it)).collect();
    // Relative to the greatest, since likelihoods of large samples underflow.
    let most = likelihoods.iter().copied().fold(f64::MIN, f64::max);
    let weights: Vec<f64> = likelihoods.iter().map(|it| libm::exp(it - most)).collect();
    let sum: f64 = weights.iter().sum();
    let mean: f64 = thetas.iter().zip(&weights).map(|(t, w)| t * w / sum).sum();
    let n = n as f64;
    // The prior counts as ten more excesses with a shape of 0.5.
    Some((n * shape(mean) + 5.0) / (n + 10.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, exact: f64) -> bool {
        (found - exact).abs() < 1e-9 * exact.abs()
    }

    /// Exact to 17 digits, by interval arithmetic with 300 bits.
    #[test]
    fn quantiles_are_exact_to_nine_digits() {
        for (share, freedom, exact) in [
            (0.975, 1.0, 12.706_204_736_174_705),
            (0.975, 2.7, 3.392_148_383_173_752_3),
            (0.975, 5.0, 2.570_581_835_636_315_5),
            (0.975, 30.0, 2.042_272_456_301_238),
            (0.975, 1234.5, 1.961_887_483_331_345_6),
            (0.95, 10.0, 1.812_461_122_811_676_4),
            (0.999_5, 3.2, 11.640_148_047_769_328),
            (0.6, 8.0, 0.261_921_096_748_832_37),
            (0.025, 4.0, -2.776_445_105_197_794_4),
        ] {
            let found = student_quantile(share, freedom);
            assert!(close(found, exact), "{share}, {freedom}: {found}");
            let again = student_cdf(found, freedom);
            assert!(close(again, share), "{share}, {freedom}: {again}");
        }
        assert_eq!(student_quantile(0.5, 3.0), 0.0);
        for (hits, n, error, exact) in [
            (0, 1000, 0.025, 0.003_682_083_896_865_672),
            (0, 1_000_000, 0.025, 3.688_872_650_206_489e-6),
            (1, 20, 0.05, 0.216_106_164_206_847_35),
            (12, 400, 0.01, 0.056_281_906_895_427_03),
            (499, 500, 0.025, 0.999_949_365_665_992_6),
            (250, 1000, 0.025, 0.278_050_006_223_755_53),
            (17, 100_000, 0.025, 0.000_272_172_561_193_328),
            (50_000, 100_000, 0.025, 0.503_103_937_508_199_6),
            (3, 2_000_000, 0.025, 4.383_630_214_467_908e-6),
        ] {
            let found = clopper_pearson_upper(hits, n, error);
            assert!(close(found, exact), "{hits} of {n}: {found}");
        }
        assert!(close(normal_quantile(0.975), 1.959_963_984_540_054_2));
        assert_eq!(student_cdf(-1.3, 4.0) + student_cdf(1.3, 4.0), 1.0);
    }

    /// The bound is the rate at which so few hits have exactly the stated probability.
    #[test]
    fn the_bound_of_a_rate_solves_its_binomial_equation() {
        for (hits, n, error) in [(0, 1000, 0.025), (3, 50, 0.05), (12, 400, 0.01)] {
            let p = clopper_pearson_upper(hits, n, error);
            let term = |k: usize| {
                let (k, n) = (k as f64, n as f64);
                let choose =
                    libm::lgamma(n + 1.0) - libm::lgamma(k + 1.0) - libm::lgamma(n - k + 1.0);
                libm::exp(choose + k * libm::log(p) + (n - k) * libm::log1p(-p))
            };
            let few: f64 = (0..=hits).map(term).sum();
            assert!((few - error).abs() < 1e-9, "{hits} of {n}: {few}");
        }
        assert_eq!(clopper_pearson_upper(0, 0, 0.05), 1.0);
        assert_eq!(poisson_tail(0, 3.0), 1.0);
        assert!((poisson_tail(2, 0.5) - (1.0 - 1.5 * libm::exp(-0.5))).abs() < 1e-12);
    }

    #[test]
    fn the_shape_of_a_pareto_tail_is_found_on_both_sides_of_its_limit() {
        let mut rng = crate::seed::generator("pareto", &[1]);
        for truth in [0.2, 0.9] {
            let mut draw = || {
                use rand::RngExt;
                let share: f64 = 1.0 - rng.random::<f64>();
                (libm::pow(share, -truth) - 1.0) / truth
            };
            let excesses: Vec<f64> = (0..3000).map(|_| draw()).collect();
            let found = pareto_shape(&excesses).expect("enough");
            assert!((found - truth).abs() < 0.08, "{found} instead of {truth}");
        }
        assert_eq!(pareto_shape(&[1.0; 4]), None);
    }
}
