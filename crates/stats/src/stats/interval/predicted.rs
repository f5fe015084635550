//! Prediction of other trials from those that were seen.

use super::Z;

/// 95 % interval of the success share of `of` other trials.
///
/// `successes` of `n` trials succeeded. Two parts vary: the rate is not known
/// from n trials, and the others are few. The rate has Jeffreys' prior Beta(½,
/// ½), so the others' successes are beta-binomial. The interval leaves at most
/// 2.5 % of them on either side. It is [0, 1] for `of` = 0.
pub fn predicted(successes: usize, n: usize, of: usize) -> [f64; 2] {
    if of == 0 {
        return [0.0, 1.0];
    }
    let (a, b) = (successes as f64 + 0.5, (n - successes.min(n)) as f64 + 0.5);
    let ln_beta = |x: f64, y: f64| libm::lgamma(x) + libm::lgamma(y) - libm::lgamma(x + y);
    let whole = of as f64;
    let share = |k: usize| {
        // ln C(of, k) by the beta function, which does not overflow.
        let (k, rest) = (k as f64, (of - k) as f64);
        let ln_choices = -libm::log(whole + 1.0) - ln_beta(rest + 1.0, k + 1.0);
        libm::exp(ln_choices + ln_beta(k + a, rest + b) - ln_beta(a, b))
    };
    let tail = 0.5 * libm::erfc(Z / core::f64::consts::SQRT_2);
    // The first number whose tail, including itself, is more than 2.5 %.
    let first = |mut numbers: Box<dyn Iterator<Item = usize>>, last: usize| {
        let mut sum = 0.0;
        let found = numbers.find(|&k| {
            sum += share(k);
            tail < sum
        });
        found.unwrap_or(last) as f64 / whole
    };
    [
        first(Box::new(0..=of), of),
        first(Box::new((0..=of).rev()), 0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::interval::wilson;

    fn binomial(k: usize, n: usize, p: f64) -> f64 {
        let choices = (0..k).fold(1.0, |c, i| c * (n - i) as f64 / (i + 1) as f64);
        choices * p.powi(k as i32) * (1.0 - p).powi((n - k) as i32)
    }

    /// Probability that the others lie in the predicted interval.
    fn coverage(p: f64, n: usize, of: usize) -> f64 {
        let within = |successes: usize| {
            let [low, high] = predicted(successes, n, of);
            let others = (0..=of).filter(|&k| {
                let share = k as f64 / of as f64;
                low <= share && share <= high
            });
            others.map(|k| binomial(k, of, p)).sum::<f64>()
        };
        (0..=n).map(|s| binomial(s, n, p) * within(s)).sum()
    }

    #[test]
    fn what_is_said_of_other_trials_comes_true_and_the_interval_of_the_rate_does_not() {
        for (n, of) in [(16, 24), (32, 24), (32, 40), (32, 300)] {
            for p in [0.05, 0.3, 0.5, 0.8, 0.95] {
                let covered = coverage(p, n, of);
                assert!((0.93..=1.0).contains(&covered), "{p} {n} {of}: {covered}");
            }
        }
        // Wilson's interval of 16 of 32 concerns the rate, and not 24 others.
        let [low, high] = wilson(16, 32);
        let [below, above] = predicted(16, 32, 24);
        assert!(below < low && high < above, "{below} {above}");
    }

    #[test]
    fn nothing_seen_says_nothing_and_many_trials_say_the_rate() {
        assert_eq!(predicted(0, 0, 0), [0.0, 1.0]);
        let [low, high] = predicted(0, 0, 50);
        assert!(low < 0.02 && high > 0.98);
        let [low, high] = predicted(5_000, 10_000, 10_000);
        assert!(
            (low - 0.486).abs() < 2e-3 && (high - 0.514).abs() < 2e-3,
            "{low} {high}"
        );
        assert_eq!(predicted(32, 32, 24)[1], 1.0);
    }
}
