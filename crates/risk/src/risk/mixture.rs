//! Mixture of proposals: natural traffic, and traffic tilted by V.

use super::decisions::ActionValues;
use super::record::{RiskRun, multiply};
use super::start_tree::StartTree;
use super::value_network::ValueNetwork;

/// Least multiplier of an action, as a share of the best one.
const FLOOR: f64 = 1e-6;
/// Share of the law in every tilted decision, which bounds the weight of a surprise.
// On `cut_in` this share left the variance as it was and halved the greatest contributions.
// 15 % cost up to 10 % of variance.
const LAW: f64 = 0.05;
/// Share of natural runs, which bounds every weight by its reciprocal.
const NATURAL: f64 = 0.1;
/// Share of the proposal by the root of V, which forgives a V that misses failures.
// Without it, estimates of the world of 243 sequences were up to 12 % below counting, with
// intervals of 2 to 5 %.
const SOFT: f64 = 0.3;
/// Share of the proposal for all failures.
const ALL: f64 = 0.2;

/// Mixture of natural traffic and a proposal per head of V.
///
/// A proposal q takes an action with p · V / Σ p · V, which has no variance if V is exact.
/// A share of it is p, so that a single action that V misses does not cost the whole run.
/// Component 0 is natural, and component 1 tilts by √V of all failures.
#[derive(Clone, Debug)]
pub(super) struct Mixture {
    value: Option<ValueNetwork>,
    /// Starts of each component.
    trees: Vec<StartTree>,
    /// Share of each component.
    shares: Vec<f64>,
}

impl Mixture {
    /// Returns natural traffic alone.
    pub(super) fn natural(dimensions: usize) -> Mixture {
        Mixture {
            value: None,
            trees: vec![StartTree::natural(dimensions)],
            shares: vec![1.0],
        }
    }

    /// Returns the mixture of a fitted V. Head 0 is for all failures, the others for modes.
    pub(super) fn of(value: ValueNetwork, trees: Vec<StartTree>) -> Mixture {
        let modes = value.heads() - 1;
        let mut shares = vec![NATURAL, SOFT];
        let rest = 1.0 - NATURAL - SOFT;
        if modes == 0 {
            shares.push(rest);
        } else {
            shares.push(ALL);
            // Equal shares, because a rare kind of failure may be most of the risk.
            shares.extend(vec![(rest - ALL) / modes as f64; modes]);
        }
        // Component 0 draws from the law itself, which needs no boxes.
        let natural = StartTree::natural(0);
        Mixture {
            value: Some(value),
            trees: std::iter::once(natural).chain(trees).collect(),
            shares,
        }
    }

    /// Returns the share of each component.
    pub(super) fn shares(&self) -> &[f64] {
        &self.shares
    }

    /// Returns the greatest weight of a run, which the natural share bounds.
    pub(super) fn greatest_weight(&self) -> f64 {
        1.0 / self.shares[0]
    }

    /// Returns the starts of a component.
    pub(super) fn tree(&self, component: usize) -> &StartTree {
        &self.trees[component]
    }

    /// Returns the density ratio q / p of every component for a start.
    pub(super) fn start_ratios(&self, shares: &[f64]) -> Vec<f64> {
        let tilted = self.trees.iter().skip(1).map(|it| it.density(shares));
        std::iter::once(1.0).chain(tilted).collect()
    }

    /// Returns the action probabilities of every component in a state.
    pub(super) fn proposals(&self, input: &[f32], law: &[f64]) -> Vec<Vec<f64>> {
        let mut all = vec![law.to_vec()];
        if let Some(value) = &self.value {
            let values = value.values(input);
            // The first head is that of all failures.
            let softened = softened(&values[..law.len()]);
            all.push(tilted(law, &softened, LAW));
            let heads = values.chunks(law.len());
            all.extend(heads.map(|own| tilted(law, own, LAW)));
        }
        all
    }

    /// Returns the weight of a recorded run, whatever drew it.
    pub(super) fn weight_of(&self, run: &RiskRun) -> f64 {
        let mut ratios = self.start_ratios(&run.shares);
        for (decision, action) in run.actions.iter().enumerate() {
            let law: Vec<f64> = run.law(decision).iter().map(|it| f64::from(*it)).collect();
            let proposals = self.proposals(run.input(decision), &law);
            multiply(&mut ratios, &proposals, &law, *action as usize);
        }
        self.weight(&ratios)
    }

    /// Returns the weight p / q of a run from the density ratios of all components.
    ///
    /// It is the balance heuristic (Veach and Guibas 1995).
    pub(super) fn weight(&self, ratios: &[f64]) -> f64 {
        let pairs = self.shares.iter().zip(ratios);
        // The balance heuristic: the weight is by the whole mixture and not by the
        // component drawn.
        1.0 / pairs.map(|(share, ratio)| share * ratio).sum::<f64>()
    }

    /// Returns the weight of a run beside the draws of a round, by component.
    ///
    /// Shares are rounded to draws, and the weight of the draws themselves has no bias.
    pub(super) fn weight_among(&self, ratios: &[f64], draws: &[usize]) -> f64 {
        let n = draws.iter().sum::<usize>() as f64;
        let pairs = draws.iter().zip(ratios);
        n / pairs
            .map(|(draws, ratio)| *draws as f64 * ratio)
            .sum::<f64>()
    }

    /// Returns the component of each of `n` runs, in proportion to the shares.
    pub(super) fn allocation(&self, n: usize) -> Vec<usize> {
        let mut all = Vec::with_capacity(n);
        let mut sum = 0.0;
        for (component, share) in self.shares.iter().enumerate() {
            sum += share;
            // Sums are rounded and not shares, so that the errors do not add up.
            let end = libm::round(sum * n as f64) as usize;
            all.resize(end.min(n), component);
        }
        // Rounding of the shares leaves at most one run over.
        all.resize(n, self.shares.len() - 1);
        all
    }
}

/// Returns the roots of values, with the floor of the values themselves.
fn softened(values: &[f64]) -> Vec<f64> {
    let best = values.iter().copied().fold(0.0, f64::max);
    let floored = values.iter().map(|value| value.max(FLOOR * best));
    floored.map(libm::sqrt).collect()
}

/// Returns the law tilted by values, with a share of the law itself.
fn tilted(law: &[f64], values: &[f64], share: f64) -> Vec<f64> {
    // An impossible action must not set the floor for the others.
    let possible = law.iter().zip(values).filter(|(p, _)| **p > 0.0);
    let best = possible.map(|(_, v)| *v).fold(0.0, f64::max);
    let pairs = law.iter().zip(values);
    let raw: Vec<f64> = pairs.map(|(p, v)| p * v.max(FLOOR * best)).collect();
    let sum: f64 = raw.iter().sum();
    // Values of 0 prefer no action to another.
    if sum > 0.0 {
        let pairs = raw.iter().zip(law);
        pairs
            .map(|(it, p)| share * p + (1.0 - share) * it / sum)
            .collect()
    } else {
        law.to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allocations_follow_the_shares_and_weights_are_bounded() {
        let value = ValueNetwork::new([3, 3, 2], 1);
        let trees = vec![StartTree::natural(0); 4];
        let mixture = Mixture::of(value, trees);
        let sum: f64 = mixture.shares().iter().sum();
        assert!((sum - 1.0).abs() < 1e-12);
        let all = mixture.allocation(1000);
        let of = |component| all.iter().filter(|it| **it == component).count();
        assert_eq!([0, 1, 2, 3, 4].map(of), [100, 300, 200, 200, 200]);
        // A run that no proposal would play still has a bounded weight.
        assert!((mixture.weight(&[1.0, 0.0, 0.0, 0.0, 0.0]) - 10.0).abs() < 1e-9);
    }

    #[test]
    fn a_root_tilts_less_than_the_value() {
        let law = [0.5, 0.5];
        let values = [0.01, 0.0001];
        let [hard, soft] = [&values[..], &softened(&values)].map(|it| tilted(&law, it, LAW));
        let with_law = |tilted: f64| 0.05 * 0.5 + 0.95 * tilted;
        assert!((hard[1] - with_law(1.0 / 101.0)).abs() < 1e-12);
        assert!((soft[1] - with_law(1.0 / 11.0)).abs() < 1e-12);
    }

    #[test]
    fn tilting_keeps_impossible_actions_impossible() {
        let q = tilted(&[0.5, 0.0, 0.5], &[0.1, 1.0, 0.3], LAW);
        assert!((q[0] - 0.2625).abs() < 1e-12 && q[1] == 0.0);
        assert_eq!(tilted(&[0.5, 0.5], &[0.0, 0.0], LAW), [0.5, 0.5]);
    }

    /// Starts of which the lower half is drawn often.
    fn tree() -> StartTree {
        let starts = (0..200).map(|at| {
            let share = (f64::from(at) + 0.5) / 200.0;
            (vec![share], if share < 0.5 { 1.0 } else { 0.0 })
        });
        StartTree::fit(&starts.collect::<Vec<_>>(), 1)
    }

    fn mixture(heads: usize) -> Mixture {
        let value = ValueNetwork::flat([1, heads, 2]);
        Mixture::of(value, vec![tree(); heads + 1])
    }

    #[test]
    fn shares_of_a_mixture_without_kinds_go_to_all_failures() {
        let one = mixture(1);
        let near = |found: &[f64], expected: &[f64]| {
            let pairs = found.iter().zip(expected);
            let far = pairs.filter(|(a, b)| (*a - *b).abs() > 1e-9).count();
            assert!(far == 0 && found.len() == expected.len(), "{found:?}");
        };
        near(one.shares(), &[0.1, 0.3, 0.6]);
        near(mixture(3).shares(), &[0.1, 0.3, 0.2, 0.2, 0.2]);
        assert!((one.greatest_weight() - 10.0).abs() < 1e-9);
        assert_eq!(Mixture::natural(1).greatest_weight(), 1.0);
    }

    #[test]
    fn weights_are_those_of_the_start_and_of_every_decision() {
        let one = mixture(1);
        let ratios = one.start_ratios(&[0.25]);
        // A tenth of the law, and the rest in half of its range.
        for (found, expected) in ratios.iter().zip([1.0, 1.9, 1.9]) {
            assert!((found - expected).abs() < 1e-9, "{ratios:?}");
        }
        assert_eq!(one.tree(0).density(&[0.9]), 1.0);
        let law = [0.25, 0.75];
        let proposals = one.proposals(&[0.0], &law);
        assert_eq!((proposals.len(), &proposals[0][..]), (3, &law[..]));
        let mut run = RiskRun::ending(super::super::record::RunEnd::Outside);
        run.shares = vec![0.25];
        let expected = 1.0 / (0.1 + 0.9 * 1.9);
        assert!((one.weight_of(&run) - expected).abs() < 1e-9);
        // A V that prefers nothing changes no weight, and an impossible action has none.
        (run.actions, run.inputs) = (vec![1, 0], vec![0.0, 0.0]);
        run.laws = [0.25, 0.75].repeat(2);
        assert!((one.weight_of(&run) - expected).abs() < 1e-6);
        run.laws = vec![0.25, 0.75, 0.0, 1.0];
        assert_eq!(one.weight_of(&run), f64::INFINITY);
    }

    #[test]
    fn weights_of_draws_are_those_of_the_whole_numbers() {
        let one = mixture(1);
        let weight = one.weight_among(&[1.0, 2.0, 4.0], &[1, 0, 1]);
        assert!((weight - 2.0 / 5.0).abs() < 1e-12, "{weight}");
        let as_shares = one.weight_among(&[1.0, 2.0, 4.0], &[10, 30, 60]);
        assert!((as_shares - one.weight(&[1.0, 2.0, 4.0])).abs() < 1e-12);
    }

    #[test]
    fn allocations_round_to_whole_runs_and_leave_none_over() {
        let one = mixture(1);
        let counts = |n: usize| {
            let all = one.allocation(n);
            assert!(all.is_sorted() && all.len() == n);
            [0, 1, 2].map(|of| all.iter().filter(|it| **it == of).count())
        };
        assert_eq!(counts(10), [1, 3, 6]);
        assert_eq!(counts(1), [0, 0, 1]);
        assert_eq!(counts(3), [0, 1, 2]);
        assert_eq!(counts(0), [0, 0, 0]);
    }

    #[test]
    fn a_tilt_has_a_floor_below_the_best_possible_action() {
        // The floor is a millionth of the best action that the law allows.
        let q = tilted(&[0.5, 0.5], &[1.0, 0.0], 0.0);
        assert!((q[1] - 1e-6 / (1.0 + 1e-6)).abs() < 1e-12, "{q:?}");
        let q = tilted(&[0.5, 0.5, 0.0], &[1e-3, 0.0, 1.0], 0.0);
        assert!((q[1] - 1e-6 / (1.0 + 1e-6)).abs() < 1e-12, "{q:?}");
        let soft = softened(&[1e-2, 0.0]);
        assert!((soft[0] - 0.1).abs() < 1e-12 && (soft[1] - 1e-4).abs() < 1e-12);
    }
}
