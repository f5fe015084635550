//! Bounds of a risk that hold whatever the proposals missed.

use serde::{Deserialize, Serialize};

use super::batch::assessed_step;
use super::lower_bound::{BetRound, lower_bound};
use super::mixture::Mixture;
use super::natural_counts::{FaultsAs, NaturalCounts};
use super::pool::{RiskEstimate, Round, WeightedFailure, bound};
use super::record::DriverAnswer;
use crate::stats::clopper_pearson_upper;

/// Probability that a lower bound fails.
const BELOW: f64 = 0.01;
/// Probability that an upper bound fails by its natural runs alone, or with its rounds.
///
/// Both together leave 95 % for the pair.
const ABOVE: f64 = 0.02;

/// Least and greatest probabilities per run: the pair of each holds with 95 %.
///
/// No failure that the proposals miss breaks them. A fault is no failure in the first number
/// and a failure in the second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RiskLimits {
    /// Probability that the ego fails.
    pub fails: [f64; 2],
    /// That it fails, with every rule kept.
    pub fails_lawful: [f64; 2],
    /// That it fails where a driver model of UN R157 has no contact.
    pub fails_preventable: [f64; 2],
    /// That it fails where no driver model of UN R157 applies.
    pub fails_unjudged: [f64; 2],
    /// That it fails, given that every rule is kept.
    pub fails_given_lawful: [f64; 2],
}

/// Runs of an ego, from which its bounds follow.
pub(super) struct LimitRuns<'a> {
    /// All rounds, also those that are set aside.
    pub(super) rounds: &'a [Round],
    /// Number of rounds before the first one after which they may end.
    pub(super) least_rounds: usize,
    pub(super) natural: &'a NaturalCounts,
    /// Share of the law of starts inside X_init.
    pub(super) inside: RiskEstimate,
    /// Greatest failing weight before the last round.
    pub(super) limit: f64,
    /// Mixture of the last round.
    pub(super) mixture: &'a Mixture,
}

impl RiskLimits {
    /// Returns the bounds of an ego from weighted and natural runs.
    pub(super) fn of(runs: &LimitRuns<'_>) -> RiskLimits {
        let natural = runs.natural;
        let most = runs.most_by_rounds();
        let pair = |least: f64, failures: usize| {
            let own = runs.most_by_counts(failures);
            [least.min(1.0), most.min(own).min(1.0)]
        };
        let answered = |answer: DriverAnswer| runs.least(true, |it| it.preventable == Some(answer));
        let fails_lawful = pair(runs.least(false, |it| it.lawful), natural.lawful);
        let [rarely, often] = natural.lawful_rate(FaultsAs::Failing).interval;
        RiskLimits {
            fails: pair(runs.least(false, |_| true), natural.failures()),
            fails_lawful,
            fails_preventable: pair(answered(DriverAnswer::Avoids), natural.preventable),
            fails_unjudged: pair(answered(DriverAnswer::NoAnswer), natural.unjudged),
            fails_given_lawful: [
                // A rate of 0 must not divide, and leaves the bound at 1.
                fails_lawful[0] / often.max(f64::MIN_POSITIVE),
                fails_lawful[1] / rarely.max(f64::MIN_POSITIVE),
            ]
            .map(|it| it.min(1.0)),
        }
    }

    /// Returns the bounds of all readings.
    pub(super) fn all(&self) -> [[f64; 2]; 5] {
        [
            self.fails,
            self.fails_lawful,
            self.fails_preventable,
            self.fails_unjudged,
            self.fails_given_lawful,
        ]
    }

    /// Returns whether no probability is between its bounds.
    ///
    /// That happens by chance with 5 %, or by a fault in a weight.
    pub(super) fn is_crossed(&self) -> bool {
        self.fails[1] < self.fails[0]
    }
}

impl LimitRuns<'_> {
    /// Returns the lower bound of the probability of some failures.
    fn least(&self, is_assessed: bool, counts: impl Fn(&WeightedFailure) -> bool) -> f64 {
        let (mut bets, mut excess) = (Vec::new(), 1.0_f64);
        for round in self.rounds {
            let step = if is_assessed {
                assessed_step(round.len())
            } else {
                1
            };
            let drawn = every(step, &round.draws);
            let all = drawn.iter().sum::<usize>();
            // Every second draw of a component may be one more than half of it.
            let share = |part: usize, of: usize| part as f64 / of.max(1) as f64;
            let shares = drawn.iter().zip(&round.draws);
            let ratios = shares.map(|(own, of)| share(*own, all) / share(*of, round.len()));
            excess = ratios.filter(|it| it.is_finite()).fold(excess, f64::max);
            let failures = round.failures.iter();
            let counted = failures.filter(|it| it.index.is_multiple_of(step) && counts(it));
            bets.push(BetRound {
                draws: all,
                weights: counted.map(|it| it.weight).collect(),
            });
        }
        // Both divisors are the greatest possible ones, so the bound stays a lower one.
        lower_bound(&bets, BELOW) / (excess * self.inside.interval[1])
    }

    /// Returns the upper bound of the failures by natural runs alone.
    fn most_by_counts(&self, failures: usize) -> f64 {
        // Any fault may have been a failure of this kind.
        let all = failures + self.natural.faults.invalid;
        clopper_pearson_upper(all, self.natural.inside(), ABOVE)
    }

    /// Returns the upper bound of all failures by the last round and the natural runs.
    fn most_by_rounds(&self) -> f64 {
        let Some(last) = self.rounds.last() else {
            return 1.0;
        };
        // Rounds end by their results, so each look at one has an error of its own.
        let look = (self.rounds.len() + 1)
            .saturating_sub(self.least_rounds)
            .max(1) as f64;
        let error = ABOVE / (look * (look + 1.0));
        let beyond = self
            .natural
            .stored_with(|run| self.limit < self.mixture.weight_of(run));
        // Any fault may have been a failure of any weight.
        let failing = beyond.0 + self.natural.stored_faults();
        let all = last.with_failing_faults();
        bound(&all, self.limit, [failing, beyond.1], error) / self.inside.interval[0]
    }
}

/// Returns the draws of each component among every so many draws of a round.
fn every(step: usize, draws: &[usize]) -> Vec<usize> {
    let mut first = 0;
    let each = draws.iter().map(|count| {
        // Components are drawn one after the other.
        let end = first + count;
        let own = end.div_ceil(step) - first.div_ceil(step);
        first = end;
        own
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::super::record::{EgoFailure, RiskRun, RunEnd};
    use super::*;
    use crate::ego::Fault;

    const ALL: RiskEstimate = RiskEstimate {
        probability: 1.0,
        interval: [1.0; 2],
        ess: 1.0,
        hits: 1,
    };

    /// Round of 8000 draws, of which 400 fail with equal weights, half of them lawfully.
    fn round(weight: f64) -> Round {
        let failure = |at: usize| WeightedFailure {
            index: 19 * at,
            component: usize::from(at >= 200),
            weight,
            mode: "contact".to_owned(),
            lawful: at.is_multiple_of(2),
            preventable: at.is_multiple_of(4).then_some(DriverAnswer::Avoids),
        };
        Round {
            draws: vec![4000, 4000],
            failures: (0..400).map(failure).collect(),
            faults: Vec::new(),
        }
    }

    fn natural(runs: usize, lawful: usize, faults: usize) -> NaturalCounts {
        let end = |at: usize| match at {
            _ if at < lawful => RunEnd::Failed(EgoFailure {
                mode: "contact".to_owned(),
                lawful: true,
                preventable: None,
            }),
            _ if at < lawful + faults => RunEnd::Invalid {
                fault: Fault::error("x"),
            },
            _ => RunEnd::Held { lawful: Some(true) },
        };
        let mut counts = NaturalCounts::default();
        counts.add((0..runs).map(|at| RiskRun::ending(end(at))).collect());
        counts
    }

    fn limits(rounds: &[Round], natural: &NaturalCounts, inside: RiskEstimate) -> RiskLimits {
        RiskLimits::of(&LimitRuns {
            rounds,
            least_rounds: 3,
            natural,
            inside,
            limit: 1.0,
            mixture: &Mixture::natural(0),
        })
    }

    #[test]
    fn every_reading_is_within_its_own_bounds() {
        let found = limits(&[round(0.01), round(0.01)], &natural(1000, 0, 0), ALL);
        // 400 of weight 0.01 in 8000 draws are 5e-4, half of them lawful. Half of the draws are
        // assessed, and half of their failures are prevented.
        for ([least, most], truth) in [
            (found.fails, 5e-4),
            (found.fails_lawful, 2.5e-4),
            (found.fails_preventable, 2.5e-4),
        ] {
            assert!(0.6 * truth < least && least < truth, "{least} of {truth}");
            assert!(truth < most, "{most} of {truth}");
        }
        assert_eq!(found.fails_unjudged[0], 0.0);
        // No failure of 1000 natural runs is as rare as 2 %.
        let none = 1.0 - libm::pow(0.02, 1e-3);
        assert!((found.fails_lawful[1] - none).abs() < 1e-9, "{found:?}");
        assert!(!found.is_crossed());
    }

    #[test]
    fn natural_failures_and_faults_raise_the_upper_bound_alone() {
        let of = |failing: usize, faults: usize| {
            limits(&[round(0.01)], &natural(10_000, failing, faults), ALL)
        };
        let sound = of(0, 0);
        for found in [of(30, 0), of(0, 30)] {
            assert_eq!(found.fails[0], sound.fails[0]);
            assert!(found.fails[1] > 2.0 * sound.fails[1], "{found:?}");
        }
        // Without a natural run nothing is excluded.
        assert_eq!(limits(&[], &natural(0, 0, 0), ALL).fails, [0.0, 1.0]);
    }

    #[test]
    fn bounds_are_of_starts_inside_whose_share_is_uncertain() {
        let inside = RiskEstimate {
            probability: 0.5,
            interval: [0.4, 0.8],
            ..ALL
        };
        let all = limits(&[round(0.01)], &natural(10_000, 0, 0), ALL);
        let found = limits(&[round(0.01)], &natural(10_000, 0, 0), inside);
        assert!((found.fails[0] - all.fails[0] / 0.8).abs() < 1e-12);
    }

    #[test]
    fn later_looks_and_crossed_bounds_are_noticed() {
        let natural = natural(1_000_000, 0, 0);
        let of = |rounds: usize| limits(&vec![round(1e-4); rounds], &natural, ALL);
        // The rounds end with a share of the error each, and natural runs do not.
        let limit = |rounds: usize| {
            LimitRuns {
                rounds: &vec![round(1e-4); rounds],
                least_rounds: 3,
                natural: &natural,
                inside: ALL,
                limit: 1e-4,
                mixture: &Mixture::natural(0),
            }
            .most_by_rounds()
        };
        assert_eq!(limit(1), limit(3));
        assert!(limit(3) < limit(4), "{} {}", limit(3), limit(4));
        assert!(of(3).fails[0] < 5e-6);
        // Rounds that claim more than nature shows cannot both be right.
        assert!(limits(&[round(0.5)], &natural, ALL).is_crossed());
    }

    #[test]
    fn every_second_draw_of_each_component_is_counted() {
        assert_eq!(every(1, &[3, 4]), [3, 4]);
        // Draws 0, 2 | 4, 6 of 0 to 2 and 3 to 6.
        assert_eq!(every(2, &[3, 4]), [2, 2]);
        assert_eq!(every(3, &[1, 1, 5]), [1, 0, 2]);
    }
}
