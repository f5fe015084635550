//! Rounds that count: those whose proposals could draw what later rounds found.

use super::mixture::Mixture;
use super::pool::{RiskEstimate, Round, distance, pooled};
use super::record::RiskRun;
use crate::stats::student_quantile;
use rayon::prelude::*;

/// Number of equal weights of which a failure must not weigh more than one.
const PARTS: f64 = 100.0;
/// Failures of a round that stand for all of it.
const EXEMPLARS: usize = 400;
/// Least and greatest share of the risk that a round may draw too rarely.
///
/// In between, it is half of the half-width, below which it does not matter.
const BLIND: [f64; 2] = [0.01, 0.05];
/// Probability that rounds of equal means disagree.
const FALSE_ALARM: f64 = 0.01;
/// Fewest rounds that may disagree.
const LEAST: usize = 2;

/// Weights that failures of later rounds would have in each round of an ego.
#[derive(Clone, Debug, Default)]
pub(super) struct Hindsight {
    mixtures: Vec<Mixture>,
    /// Weights by the round that would draw, and by the later round that drew.
    weights: Vec<Vec<Vec<f64>>>,
}

impl Hindsight {
    /// Adds a round by its mixture and the failures that stand for it.
    pub(super) fn add(&mut self, mixture: &Mixture, exemplars: &[&RiskRun]) {
        for (earlier, weights) in self.mixtures.iter().zip(&mut self.weights) {
            let own = exemplars.par_iter().map(|run| earlier.weight_of(run));
            weights.push(own.collect());
        }
        self.mixtures.push(mixture.clone());
        self.weights.push(Vec::new());
    }

    /// Returns the number of rounds, from the first, that do not count.
    ///
    /// A round does not count if it draws a part of the risk too rarely that a later round
    /// shows, or if the rounds from it on disagree. Nor do the rounds before it, whose
    /// proposals were learned from less.
    pub(super) fn set_aside(&self, rounds: &[Round]) -> usize {
        let mut first = 0;
        while let Some(blind) = self.last_blind(rounds, first) {
            first = blind + 1;
        }
        // Two rounds are left at least, or nothing could disagree with the last one.
        while rounds.len() - first > LEAST && disagreement(&rounds[first..]).is_some() {
            first += 1;
        }
        first
    }

    /// Returns the last round from `first` on that draws a part of the risk too rarely.
    fn last_blind(&self, rounds: &[Round], first: usize) -> Option<usize> {
        let counted = rounds.get(first..)?;
        let estimate = pooled(counted, |_| true)?;
        let heaviest = heaviest(counted, Some(estimate));
        let most = (0.5 * estimate.half_width()).clamp(BLIND[0], BLIND[1]);
        let is_blind = |later: &Vec<f64>| {
            // The exemplars stand for equal parts of the risk, so their
            // number is a share of it.
            let heavy = later.iter().filter(|weight| heaviest < **weight).count();
            heavy as f64 > most * later.len() as f64
        };
        let last = rounds.len().min(self.weights.len());
        // From the last one, because all rounds before a blind one are set aside with it.
        let mut from_last = (first..last).rev();
        from_last.find(|round| self.weights[*round].iter().any(is_blind))
    }
}

/// Returns the greatest weight of a failure that would hardly change the estimate.
///
/// Heavier failures that are missing make an estimate too low and its interval too narrow.
pub(super) fn heaviest(rounds: &[Round], estimate: Option<RiskEstimate>) -> f64 {
    let draws: usize = rounds.iter().map(Round::len).sum();
    estimate.map_or(0.0, |it| {
        let sum = it.probability * draws as f64;
        // In an estimate of few failures, every failure weighs more. Equal ones must not
        // refuse each other by rounding.
        (1.0 + 1e-9) * sum / it.ess.min(PARTS)
    })
}

/// Returns the positions of failures that stand for equal parts of a round's risk.
///
/// `weights` has those of its failures in order.
pub(super) fn exemplars(weights: &[f64]) -> Vec<usize> {
    let part = weights.iter().sum::<f64>() / EXEMPLARS as f64;
    let (mut sum, mut taken) = (0.0, 0);
    let mut all = Vec::new();
    for (at, weight) in weights.iter().enumerate() {
        sum += weight;
        // A heavy failure stands for several parts.
        while taken < EXEMPLARS && (taken as f64 + 0.5) * part <= sum {
            all.push(at);
            taken += 1;
        }
    }
    all
}

/// Distance of a round from the others that chance hardly explains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disagreement {
    /// Position of the round.
    pub(super) round: usize,
    /// Distance in joint standard errors.
    pub(super) apart: f64,
}

/// Returns the round that differs most from the others, if chance hardly explains it.
pub(super) fn disagreement(rounds: &[Round]) -> Option<Disagreement> {
    if rounds.len() < LEAST {
        return None;
    }
    let each = 0..rounds.len();
    let far = each.filter_map(|round| {
        let found = distance(rounds, round)?;
        // Any of the rounds may be the farthest one, on either side.
        let error = 0.5 * FALSE_ALARM / rounds.len() as f64;
        let allowed = student_quantile(1.0 - error, found.freedom);
        let apart = found.apart;
        (apart > allowed).then_some(Disagreement { round, apart })
    });
    far.max_by(|a, b| a.apart.total_cmp(&b.apart))
}

#[cfg(test)]
mod tests {
    use super::super::pool::WeightedFailure;
    use super::super::record::RunEnd;
    use super::super::start_tree::StartTree;
    use super::super::value_network::ValueNetwork;
    use super::*;

    /// Round of 10,000 draws, of which some fail with a weight.
    fn round(failures: usize, weight: f64) -> Round {
        let failure = |index| WeightedFailure {
            index,
            component: 0,
            weight,
            mode: "contact".to_owned(),
            lawful: true,
            preventable: None,
        };
        Round {
            draws: vec![10_000],
            failures: (0..failures).map(failure).collect(),
            faults: Vec::new(),
        }
    }

    /// Mixture that draws starts in the lower half about twice as often, the others hardly.
    fn lower_half() -> Mixture {
        let starts = (0..200).map(|at| {
            let share = (f64::from(at) + 0.5) / 200.0;
            (vec![share], if share < 0.5 { 1.0 } else { 0.0 })
        });
        let tree = StartTree::fit(&starts.collect::<Vec<_>>(), 1);
        Mixture::of(ValueNetwork::flat([1, 1, 1]), vec![tree; 2])
    }

    fn at(share: f64) -> RiskRun {
        RiskRun {
            shares: vec![share],
            ..RiskRun::ending(RunEnd::Outside)
        }
    }

    /// Rounds set aside after three, of which the last one found a share in the upper half.
    fn set_aside(upper: usize, seeing: Mixture) -> usize {
        let mut hindsight = Hindsight::default();
        let (low, high) = (at(0.25), at(0.75));
        hindsight.add(&lower_half(), &[&low; 100]);
        hindsight.add(&seeing, &[&low; 100]);
        let mut last = vec![&high; upper];
        last.resize(100, &low);
        hindsight.add(&Mixture::natural(1), &last);
        // A hundredth of the sum is 1.7, and 1.1 without the first round.
        hindsight.set_aside(&[round(80, 0.7), round(80, 0.7), round(80, 0.7)])
    }

    #[test]
    fn rounds_that_could_not_draw_a_later_kind_are_set_aside() {
        // Those of the lower half have weights of 0.55 in the first mixture, and 5 above it.
        assert_eq!(set_aside(0, lower_half()), 0);
        assert_eq!(set_aside(5, lower_half()), 0);
        assert_eq!(set_aside(6, lower_half()), 2);
        // A round whose proposal could draw it counts.
        assert_eq!(set_aside(6, Mixture::natural(1)), 1);
        assert_eq!(Hindsight::default().set_aside(&[]), 0);
    }

    #[test]
    fn rounds_that_disagree_are_noticed_and_the_earliest_set_aside() {
        assert_eq!(disagreement(&[round(100, 0.1)]), None);
        assert_eq!(disagreement(&[round(100, 0.1), round(110, 0.1)]), None);
        let far = [round(200, 0.1), round(400, 0.1)];
        let found = disagreement(&far).expect("twice as much");
        assert!(found.apart > 7.0, "{found:?}");
        let third = [round(200, 0.1), round(400, 0.1), round(410, 0.1)];
        assert_eq!(disagreement(&third).map(|it| it.round), Some(0));
        let empty = Hindsight::default();
        assert_eq!(empty.set_aside(&third), 1);
        // Two rounds are left to disagree, or nothing would say so.
        assert_eq!(empty.set_aside(&far), 0);
        // Few failures may differ by chance.
        assert_eq!(disagreement(&[round(3, 0.1), round(8, 0.1)]), None);
    }

    #[test]
    fn exemplars_stand_for_equal_parts_of_the_risk() {
        let mut weights = vec![1.0; 800];
        weights[7] = 800.0;
        let found = exemplars(&weights);
        assert_eq!(found.len(), EXEMPLARS);
        assert_eq!(found.iter().filter(|at| **at == 7).count(), EXEMPLARS / 2);
        assert!(found.is_sorted() && exemplars(&[]).is_empty());
    }
}
