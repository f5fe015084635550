//! Exact test of McNemar: two egos on the same starts.

/// Two-sided exact p-value of McNemar's test on discordant pairs.
///
/// It is the probability that coins split the `worse` and `better` pairs at
/// least as unevenly. It is 1 without a discordant pair. McNemar, Psychometrika
/// 12 (1947) 153–157, in the exact form by the binomial distribution with 1/2.
///
/// ```
/// # use brakecheck_stats as brakecheck;
/// assert_eq!(brakecheck::stats::mcnemar(0, 5), 2.0 / 32.0);
/// ```
pub fn mcnemar(worse: usize, better: usize) -> f64 {
    let (n, fewer) = (worse + better, worse.min(better));
    // ln C(n, k) from gamma functions, because 2⁻ⁿ alone would underflow for
    // large n.
    let ln_factorial = |k: usize| libm::lgamma(k as f64 + 1.0);
    let ln_half_to_n = -(n as f64) * core::f64::consts::LN_2;
    let tail: f64 = (0..=fewer)
        .map(|k| ln_factorial(n) - ln_factorial(k) - ln_factorial(n - k) + ln_half_to_n)
        .map(libm::exp)
        .sum();
    // The two-sided value counts the middle term twice for an even split.
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn p_values_by_hand() {
        // (worse, better, 2 · Σ C(n, k) / 2ⁿ written out)
        let table = [
            (0, 0, 1.0),
            (1, 0, 1.0),
            (3, 3, 1.0),
            (0, 6, 2.0 / 64.0),
            (1, 7, 2.0 * (1.0 + 8.0) / 256.0),
            (2, 8, 2.0 * (1.0 + 10.0 + 45.0) / 1024.0),
            (10, 3, 2.0 * (1.0 + 13.0 + 78.0 + 286.0) / 8192.0),
        ];
        for (worse, better, expect) in table {
            let p = mcnemar(worse, better);
            assert!(
                (p - expect).abs() < 1e-12,
                "{worse} {better}: {p} not {expect}"
            );
            assert_eq!(p, mcnemar(better, worse));
        }
        // R's binom.test(30, 100) gives 7.85e-05. There is no underflow beyond
        // 1074 pairs.
        assert!((mcnemar(30, 70) - 7.850_140e-5).abs() < 1e-9);
        let large = mcnemar(1900, 2100);
        assert!((1e-3..2e-3).contains(&large), "{large}");
    }
}
