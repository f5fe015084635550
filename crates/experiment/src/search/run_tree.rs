//! Runs from one start as a tree of decisions, with the learned value of every action.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;

use crate::stats::pick;

/// Draws of a departure from the known runs before it is given up.
const REDRAWS: usize = 100;
/// Bounds of a temperature, in units of reward. Rewards are from −1.1 to 1.
const TEMPERATURES: [f64; 2] = [1e-4, 10.0];
/// Least reward. A run without one, since it was invalid, counts as such.
const LEAST_REWARD: f64 = -1.1;
/// Halvings of the interval in which a temperature is sought.
const HALVINGS: usize = 40;

/// Decision of a run.
#[derive(Clone, Debug)]
pub(super) struct ValuedDecision {
    /// Learned value of every action, −∞ for an action that is not allowed.
    pub values: Vec<f32>,
    /// Action that was played.
    pub action: usize,
}

/// Runs from one start, none of which succeeded.
///
/// The start and its noise decide an episode, so equal actions lead to equal decisions.
#[derive(Debug, Default)]
pub(super) struct RunTree {
    nodes: Vec<KnownDecision>,
}

/// Decision in the tree.
#[derive(Debug)]
struct KnownDecision {
    /// Decision before this one. `None` for the first.
    parent: Option<TreeAction>,
    values: Vec<f32>,
    /// Decision after each action that was played. `None`: the run ended with it.
    next: BTreeMap<usize, Option<usize>>,
    /// Runs through this decision.
    runs: u32,
}

/// Action at a decision of the tree.
#[derive(Clone, Copy, Debug)]
struct TreeAction {
    node: usize,
    action: usize,
}

impl RunTree {
    /// Adds a run that did not succeed.
    pub(super) fn add(&mut self, run: &[ValuedDecision]) {
        let mut at: Option<TreeAction> = None;
        for decision in run {
            let node = self.reach(at, decision);
            self.nodes[node].runs += 1;
            let action = decision.action;
            // Overwritten below if the run goes on.
            self.nodes[node].next.entry(action).or_insert(None);
            at = Some(TreeAction { node, action });
        }
    }

    /// Returns the decision after an action, which is new unless an earlier run went there.
    fn reach(&mut self, parent: Option<TreeAction>, decision: &ValuedDecision) -> usize {
        let known = match parent {
            None => (!self.nodes.is_empty()).then_some(0),
            // Invariant: `add` has entered the action that leads here.
            Some(edge) => self.nodes[edge.node].next[&edge.action],
        };
        if let Some(node) = known {
            return node;
        }
        let node = self.nodes.len();
        self.nodes.push(KnownDecision {
            parent,
            values: decision.values.clone(),
            next: BTreeMap::new(),
            runs: 0,
        });
        if let Some(edge) = parent {
            self.nodes[edge.node].next.insert(edge.action, Some(node));
        }
        node
    }

    /// Returns the actions up to the most promising one that no run has tried.
    ///
    /// The promise is the learned chance of a success, divided by one more than the runs
    /// through the decision, each of which has failed. `None`: all actions were tried.
    pub(super) fn departure(&self) -> Option<Vec<usize>> {
        let mut best: Option<(f64, TreeAction)> = None;
        for (node, known) in self.nodes.iter().enumerate() {
            for (action, &value) in known.values.iter().enumerate() {
                // A departure must be new and allowed, since the bench would replace a
                // barred action.
                if value == f32::NEG_INFINITY || known.next.contains_key(&action) {
                    continue;
                }
                // Decisions that many runs have passed give way to others.
                let promise = chance(value) / f64::from(1 + known.runs);
                // Strict, so that equal promises give the earliest decision.
                if best.is_none_or(|(most, _)| promise > most) {
                    best = Some((promise, TreeAction { node, action }));
                }
            }
        }
        best.map(|(_, edge)| self.path_to(edge))
    }

    /// Draws actions until one that no run has tried, which is the last one returned.
    ///
    /// `None`: no draw left the known runs.
    pub(super) fn draw(&self, temperature: f64, rng: &mut ChaCha8Rng) -> Option<Vec<usize>> {
        (0..REDRAWS).find_map(|_| self.draw_once(temperature, rng))
    }

    fn draw_once(&self, temperature: f64, rng: &mut ChaCha8Rng) -> Option<Vec<usize>> {
        let (mut actions, mut node) = (Vec::new(), self.nodes.first()?);
        loop {
            // Actions that ended a run here broke a rule or came too late, so they are known
            // to fail.
            let mut values = node.values.clone();
            let ended = node.next.iter().filter(|(_, next)| next.is_none());
            ended.for_each(|(&action, _)| values[action] = f32::NEG_INFINITY);
            // Once every allowed action here has ended a run, this draw has nowhere to
            // go.
            let action = drawn(&values, temperature, rng)?;
            actions.push(action);
            match node.next.get(&action) {
                None => return Some(actions),
                // Invariant: an action that ended a run is never drawn.
                Some(next) => node = &self.nodes[(*next)?],
            }
        }
    }

    /// Returns the actions of the way to an action, itself included.
    fn path_to(&self, edge: TreeAction) -> Vec<usize> {
        let mut actions = Vec::new();
        let mut at = Some(edge);
        while let Some(TreeAction { node, action }) = at {
            actions.push(action);
            at = self.nodes[node].parent;
        }
        actions.reverse();
        actions
    }
}

/// Returns the chance of a success behind a learned value.
///
/// Rewards of successes are above 0, up to 1, and all others are below, down to −1.
fn chance(value: f32) -> f64 {
    f64::midpoint(f64::from(value), 1.0).clamp(0.0, 1.0)
}

/// Draws an action from the softmax of values over a temperature.
///
/// `None`: no action is allowed.
pub(super) fn drawn(values: &[f32], temperature: f64, rng: &mut ChaCha8Rng) -> Option<usize> {
    let shares = softmax(values, temperature)?;
    Some(pick(&shares, rng))
}

/// Returns the softmax of values over a temperature, 0 for actions that are not allowed.
fn softmax(values: &[f32], temperature: f64) -> Option<Vec<f64>> {
    let top = values.iter().copied().max_by(f32::total_cmp)?;
    if top == f32::NEG_INFINITY {
        return None;
    }
    // The largest value is subtracted, so no exponential overflows.
    let weight = |value: &f32| libm::exp(f64::from(value - top) / temperature);
    let weights: Vec<f64> = values.iter().map(weight).collect();
    let sum: f64 = weights.iter().sum();
    Some(weights.iter().map(|weight| weight / sum).collect())
}

/// Returns the temperature at which draws leave a failed run so often on average.
///
/// A decision counts by the hope that it had: its best value above the reward in the end.
/// Decisions after the chance has passed have no better value, all actions are alike there,
/// and draws that differ there only are worth nothing.
pub(super) fn temperature(run: &[ValuedDecision], reward: f64, departures: f64) -> f64 {
    let hope = |decision: &ValuedDecision| {
        let best = decision.values.iter().copied().fold(f32::MIN, f32::max);
        // The reward of an invalid run is −∞, which would make every hope infinite.
        (f64::from(best) - reward.max(LEAST_REWARD)).max(0.0)
    };
    let hopes: Vec<f64> = run.iter().map(hope).collect();
    // A policy without any hope is drawn from at all decisions alike.
    let weights: Vec<f64> = if hopes.iter().any(|hope| *hope > 0.0) {
        hopes
    } else {
        vec![1.0; run.len()]
    };
    let sum: f64 = weights.iter().sum();
    let squares: f64 = weights.iter().map(|weight| weight * weight).sum();
    // The number of equal weights that would be as uneven.
    let decisions = sum * sum / squares.max(f64::MIN_POSITIVE);
    let leaving = |temperature: f64| {
        let shares = run.iter().zip(&weights).map(|(decision, weight)| {
            let shares = softmax(&decision.values, temperature);
            // A decision without an allowed action cannot leave the run.
            let stays = shares.map_or(1.0, |shares| shares[decision.action]);
            weight * (1.0 - stays)
        });
        decisions * shares.sum::<f64>() / sum.max(f64::MIN_POSITIVE)
    };
    // Temperatures span five decades, so the halvings work on logarithms.
    let [mut low, mut high] = TEMPERATURES.map(libm::log);
    // Forty halvings shrink the interval of 11.5 to 1e-11, far below any visible change.
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if leaving(libm::exp(middle)) < departures {
            low = middle;
        } else {
            high = middle;
        }
    }
    libm::exp(high)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::seed;

    const BARRED: f32 = f32::NEG_INFINITY;

    fn run(decisions: &[(&[f32], usize)]) -> Vec<ValuedDecision> {
        let decisions = decisions.iter().map(|(values, action)| ValuedDecision {
            values: values.to_vec(),
            action: *action,
        });
        decisions.collect()
    }

    /// Run of three decisions between two actions, with values of their own.
    fn toy(given: &[usize]) -> Vec<ValuedDecision> {
        let mut played: Vec<ValuedDecision> = Vec::new();
        for depth in 0..3 {
            let before: usize = played.iter().map(|decision| decision.action).sum();
            let values = vec![0.1 * before as f32, 0.3 - 0.2 * depth as f32];
            let greedy = usize::from(values[1] > values[0]);
            let action = given.get(depth).copied().unwrap_or(greedy);
            played.push(ValuedDecision { values, action });
        }
        played
    }

    #[test]
    fn draws_and_departures_play_every_sequence_once() {
        let mut rng = seed::generator("test", &[1]);
        let turns: [fn(usize) -> bool; 3] = [|_| false, |_| true, |nth| nth.is_multiple_of(2)];
        for is_draw in turns {
            let mut tree = RunTree::default();
            let mut played = BTreeSet::new();
            let mut next = Some(Vec::new());
            while let Some(given) = next {
                let run = toy(&given);
                let actions: Vec<usize> = run.iter().map(|decision| decision.action).collect();
                assert!(played.insert(actions.clone()), "{actions:?} twice");
                tree.add(&run);
                let drawn = is_draw(played.len()).then(|| tree.draw(1.0, &mut rng));
                next = drawn.flatten().or_else(|| tree.departure());
            }
            assert_eq!(played.len(), 8);
        }
    }

    #[test]
    fn a_departure_has_the_best_chance_that_is_left_and_failures_lower_it() {
        let mut tree = RunTree::default();
        assert_eq!(tree.departure(), None);
        let first: &[f32] = &[0.5, 0.4, BARRED];
        tree.add(&run(&[
            (first, 0),
            (&[0.2, 0.3, 0.9], 2),
            (&[-0.9, -1.0, -0.8], 2),
        ]));
        // 0.4 at the first decision is the best value without a run.
        assert_eq!(tree.departure(), Some(vec![1]));
        tree.add(&run(&[(first, 1), (&[0.1, -0.2, -0.3], 0)]));
        // The first decision has no untried action, and 0.3 is the best value of the others.
        assert_eq!(tree.departure(), Some(vec![0, 1]));
        tree.add(&run(&[
            (first, 0),
            (&[0.2, 0.3, 0.9], 1),
            (&[0.1, 0.0, 0.0], 0),
        ]));
        // Behind two failures, 0.2 has a third of its chance, and 0.0 behind one has half.
        assert_eq!(tree.departure(), Some(vec![0, 1, 1]));
    }

    #[test]
    fn a_temperature_leaves_the_run_as_often_as_asked_where_there_was_hope() {
        let hopeful: &[f32] = &[0.6, 0.5, 0.1];
        let lost: &[f32] = &[-0.9, -0.9, -0.9];
        let open = run(&[(hopeful, 0), (hopeful, 0), (hopeful, 0), (hopeful, 0)]);
        for departures in [1.0, 2.0] {
            let at = temperature(&open, -0.9, departures);
            let stays = softmax(hopeful, at).expect("allowed")[0];
            assert!((4.0 * (1.0 - stays) - departures).abs() < 1e-6, "{at}");
            // Decisions that cannot matter any more change nothing.
            let tail = [open.clone(), run(&[(lost, 0); 20])].concat();
            assert!((temperature(&tail, -0.9, departures) / at - 1.0).abs() < 1e-6);
        }
        // Values of another scale give draws that are as different.
        let far: &[f32] = &[6.0, 5.0, 1.0];
        let wide = run(&[(far, 0); 4]);
        let ratio = temperature(&wide, -0.9, 1.0) / temperature(&open, -0.9, 1.0);
        assert!((ratio - 10.0).abs() < 1e-4, "{ratio}");
        // Without hope anywhere, and for an invalid run, it is still a number.
        for reward in [1.0, f64::NEG_INFINITY] {
            let at = temperature(&run(&[(lost, 0); 4]), reward, 1.0);
            assert!(at.is_finite() && at > 0.0, "{at}");
        }
    }

    #[test]
    fn actions_that_are_not_allowed_are_never_drawn() {
        let mut rng = seed::generator("test", &[2]);
        for _ in 0..200 {
            assert_ne!(drawn(&[0.0, BARRED, 0.1], 5.0, &mut rng), Some(1));
        }
        assert_eq!(drawn(&[BARRED; 2], 1.0, &mut rng), None);
        // Nearly 0, the draw is greedy.
        assert_eq!(drawn(&[0.0, 0.5, 0.4], 1e-4, &mut rng), Some(1));
    }
}
