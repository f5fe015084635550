//! Distribution functions behind intervals: beta, Student t, normal and Pareto.

/// Returns the regularised incomplete beta function I_x(a, b), for a, b > 0.
///
/// It is the continued fraction of Press et al., "Numerical Recipes", section 6.4.
fn beta_cdf(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    // In logarithms, since gamma functions of large parameters overflow.
    let front = libm::exp(
        libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b)
            + a * libm::log(x)
            + b * libm::log1p(-x),
    );
    // The fraction converges fast on one side of the mean, so the other is mirrored.
    if x < (a + 1.0) / (a + b + 2.0) {
        front * beta_fraction(x, a, b) / a
    } else {
        1.0 - front * beta_fraction(1.0 - x, b, a) / b
    }
}

fn beta_fraction(x: f64, a: f64, b: f64) -> f64 {
    const TINY: f64 = 1e-300;
    // Lentz's method divides by both factors, which must not be 0.
    let away = |value: f64| if value.abs() < TINY { TINY } else { value };
    let mut c = 1.0;
    let mut d = 1.0 / away(1.0 - (a + b) * x / (a + 1.0));
    let mut product = d;
    // Large parameters converge in about √max(a, b) terms.
    for m in 1..20_000 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / away(1.0 + even * d);
        c = away(1.0 + even / c);
        product *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / away(1.0 + odd * d);
        c = away(1.0 + odd / c);
        let step = d * c;
        product *= step;
        if (step - 1.0).abs() < 1e-14 {
            break;
        }
    }
    product
}

/// Returns the point at which a rising function reaches a value, by bisection.
fn inverse([mut lo, mut hi]: [f64; 2], value: f64, rising: impl Fn(f64) -> f64) -> f64 {
    // Eighty halvings exhaust the digits of the ranges used here.
    for _ in 0..80 {
        let middle = 0.5 * (lo + hi);
        if rising(middle) < value {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    0.5 * (lo + hi)
}

/// Returns the distribution function of Student's t with `freedom` > 0 degrees.
pub fn student_cdf(t: f64, freedom: f64) -> f64 {
    let tail = 0.5 * beta_cdf(freedom / (freedom + t * t), 0.5 * freedom, 0.5);
    // The tail depends on t² alone, so the sign chooses the side.
    if t > 0.0 { 1.0 - tail } else { tail }
}

/// Returns the quantile of Student's t. Shares are inside (0, 1).
pub fn student_quantile(share: f64, freedom: f64) -> f64 {
    inverse([-1e4, 1e4], share, |t| student_cdf(t, freedom))
}

/// Returns the standard normal distribution function.
pub fn normal_cdf(z: f64) -> f64 {
    // `erfc` keeps the digits of small tails.
    0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2)
}

/// Returns the standard normal quantile. Shares are inside (0, 1).
pub fn normal_quantile(share: f64) -> f64 {
    inverse([-40.0, 40.0], share, normal_cdf)
}

/// Upper bound of Clopper and Pearson of a rate, with `hits` of `n` trials.
///
/// The rate is above it with a probability of at most `error`. 1 for n = 0.
pub fn clopper_pearson_upper(hits: usize, n: usize, error: f64) -> f64 {
    if n <= hits {
        return 1.0;
    }
    let (hits, n) = (hits as f64, n as f64);
    inverse([0.0, 1.0], 1.0 - error, |p| {
        beta_cdf(p, hits + 1.0, n - hits)
    })
}

/// Returns the probability of at least `count` events of a Poisson law.
pub fn poisson_tail(count: usize, mean: f64) -> f64 {
    let (mut term, mut below) = (libm::exp(-mean), 0.0);
    for i in 0..count {
        below += term;
        term *= mean / (i as f64 + 1.0);
    }
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
    if n < 5 || quartile <= 0.0 {
        return None;
    }
    let grid = 30 + libm::sqrt(n as f64) as usize;
    let theta = |j: usize| {
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
    Some((n * shape(mean) + 5.0) / (n + 10.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_tables() {
        for (share, freedom, expected) in [
            (0.975, 1.0, 12.706_2),
            (0.975, 5.0, 2.570_6),
            (0.975, 30.0, 2.042_3),
            (0.95, 10.0, 1.812_5),
        ] {
            let found = student_quantile(share, freedom);
            assert!((found - expected).abs() < 1e-4, "{found}");
        }
        assert!((normal_quantile(0.975) - 1.959_964).abs() < 1e-6);
        assert!((student_cdf(-1.3, 4.0) + student_cdf(1.3, 4.0) - 1.0).abs() < 1e-12);
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
