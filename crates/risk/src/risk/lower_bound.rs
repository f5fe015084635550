//! Lower bound of a probability from weighted runs, which no missed failure can break.
//!
//! A gambler bets in every round that the mean of the weights is above m. If m is the truth
//! or more, the capital is expected not to grow, whatever the proposals were learned from and
//! however long the rounds go on. So it exceeds 1 / error with a probability of at most error
//! (Ville 1939), and each m at which it does is excluded. Weights need no upper bound, because
//! a heavy weight that was never drawn only makes the bound lower (Waudby-Smith and Ramdas,
//! "Estimating means of bounded random variables by betting", JRSS B 86, 2024).

/// Stakes, as shares of the capital: 2^-1 to 2^-12.
const STAKES: i32 = 12;
/// Halvings of the range in which the bound is searched.
const HALVINGS: usize = 24;
/// Ratio of the greatest bound to the least one that is not 0.
const RANGE: f64 = 1e6;

/// Draws of a round, in fixed numbers per component of its mixture.
pub(super) struct BetRound {
    /// Number of draws.
    pub(super) draws: usize,
    /// Weights of the failures among them.
    pub(super) weights: Vec<f64>,
}

impl BetRound {
    fn mean(&self) -> f64 {
        self.weights.iter().sum::<f64>() / self.draws.max(1) as f64
    }

    /// Returns the logarithm of the factor by which a stake multiplies the capital.
    ///
    /// Draws of several components have different means μ. The product of their expected
    /// factors is at most that of as many draws with the mean of all, because the logarithm
    /// is concave. So fixed numbers of draws leave the argument as it is.
    fn log_factor(&self, stake: f64, mean: f64) -> f64 {
        let empty = self.draws.saturating_sub(self.weights.len()) as f64;
        let won = self.weights.iter();
        // The least stakes would lose digits in the sum with 1.
        let logs = won.map(|weight| libm::log1p(stake * (weight / mean - 1.0)));
        empty * libm::log1p(-stake) + logs.sum::<f64>()
    }
}

/// Returns a lower bound of the mean weight, which fails with a probability of `error`.
///
/// Gamblers begin at every round, because early proposals may have missed failures. Their
/// capitals are added, with shares that are fixed before the first round.
pub(super) fn lower_bound(rounds: &[BetRound], error: f64) -> f64 {
    let (mut sum, mut draws, mut greatest) = (0.0, 0.0, 0.0_f64);
    // A gambler plays from its own round to the last one, so the means are those of the
    // latest rounds.
    for round in rounds.iter().rev() {
        sum += round.mean() * round.draws as f64;
        draws += round.draws as f64;
        greatest = greatest.max(sum / f64::max(draws, 1.0));
    }
    let least = -libm::log(error);
    let is_excluded = |mean: f64| log_capital(rounds, mean) >= least;
    // At the greatest mean of the latest rounds, no gambler has won anything.
    let (mut excluded, mut open) = (greatest / RANGE, greatest);
    if greatest <= 0.0 || !is_excluded(excluded) {
        return 0.0;
    }
    for _ in 0..HALVINGS {
        // On a logarithmic scale, since the bound may be decades below the mean.
        let middle = libm::sqrt(excluded * open);
        if is_excluded(middle) {
            excluded = middle;
        } else {
            open = middle;
        }
    }
    excluded
}

/// Returns the logarithm of the capital of all gamblers after the last round.
fn log_capital(rounds: &[BetRound], mean: f64) -> f64 {
    let mut logs = Vec::new();
    for power in 1..=STAKES {
        let stake = libm::exp2(-f64::from(power));
        let factors: Vec<f64> = rounds.iter().map(|it| it.log_factor(stake, mean)).collect();
        for first in 0..rounds.len() {
            // Shares 1/2, 1/6, 1/12 … of the gamblers that begin at each round.
            let begin = (first + 1) as f64;
            let share = 1.0 / (begin * (begin + 1.0) * f64::from(STAKES));
            let won: f64 = factors[first..].iter().sum();
            logs.push(libm::log(share) + won);
        }
    }
    // The rest belongs to gamblers that have not begun.
    logs.push(-libm::log((rounds.len() + 1) as f64));
    // By differences, because the capital itself may overflow.
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = logs.iter().map(|it| libm::exp(it - most)).sum();
    most + libm::log(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::generator;
    use rand::RngExt;

    /// Draws of which a share fails with a weight.
    fn round(rng: &mut impl RngExt, draws: usize, kinds: &[(f64, f64)]) -> BetRound {
        let mut weights = Vec::new();
        for _ in 0..draws {
            let mut at = rng.random::<f64>();
            for (share, weight) in kinds {
                if at < *share {
                    weights.push(*weight);
                    break;
                }
                at -= share;
            }
        }
        BetRound { draws, weights }
    }

    /// Bounds of many estimates by three rounds, with their share above the truth.
    fn bounds(kinds: [&[(f64, f64)]; 3], error: f64) -> (Vec<f64>, f64) {
        let truth: f64 = kinds[2].iter().map(|(share, weight)| share * weight).sum();
        let all: Vec<f64> = (0..100)
            .map(|seed| {
                let mut rng = generator("lower-bound", &[seed]);
                let rounds = kinds.map(|it| round(&mut rng, 1000, it));
                lower_bound(&rounds, error)
            })
            .collect();
        let above = all.iter().filter(|it| truth < **it).count();
        (all, above as f64 / 100.0)
    }

    #[test]
    fn a_bound_holds_and_is_near_where_no_weight_is_heavy() {
        let light: &[(f64, f64)] = &[(0.3, 1e-3), (0.1, 4e-3)];
        let (all, above) = bounds([light; 3], 0.05);
        assert!(above <= 0.05, "{above}");
        let mean = all.iter().sum::<f64>() / 100.0;
        assert!(mean > 0.85 * 7e-4, "{mean}");
    }

    #[test]
    fn a_failure_that_is_nearly_never_drawn_can_only_lower_it() {
        // Half of the truth is in a weight that one in 10,000 draws has.
        let heavy: &[(f64, f64)] = &[(0.3, 1e-3), (1e-4, 3.0)];
        let (all, above) = bounds([heavy; 3], 0.05);
        assert!(above <= 0.05, "{above}");
        assert!(all.iter().all(|it| *it > 2e-4), "{all:?}");
    }

    #[test]
    fn rounds_that_missed_a_kind_do_not_hold_the_bound_down() {
        let (blind, seeing): (&[_], &[_]) = (&[(0.3, 1e-3)], &[(0.3, 1e-3), (0.3, 3e-3)]);
        let (all, above) = bounds([blind, blind, seeing], 0.05);
        assert!(above <= 0.05, "{above}");
        // Of all draws alike, the mean would be half of the truth.
        let mean = all.iter().sum::<f64>() / 100.0;
        assert!(mean > 0.75 * 1.2e-3, "{mean}");
    }

    #[test]
    fn nothing_is_known_without_a_failure() {
        let none = BetRound {
            draws: 1000,
            weights: Vec::new(),
        };
        assert_eq!(lower_bound(&[], 0.05), 0.0);
        assert_eq!(lower_bound(&[none], 0.05), 0.0);
        let one = BetRound {
            draws: 1000,
            weights: vec![1.0],
        };
        // A single failure of 1000 draws: below the exact bound of Clopper and Pearson.
        let found = lower_bound(&[one], 0.05);
        assert!(found <= 5.13e-5, "{found}");
    }

    #[test]
    fn a_smaller_error_has_a_lower_bound() {
        let of = |error: f64| {
            let weights = vec![1.0; 50];
            let one = BetRound {
                draws: 1000,
                weights,
            };
            lower_bound(&[one], error)
        };
        assert!(of(0.001) < of(0.05) && of(0.001) > 0.015, "{}", of(0.001));
    }
}
