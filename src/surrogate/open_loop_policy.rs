//! Actions that are the same from every start, as a baseline for plans.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::model::Surrogate;
use super::surrogate_sim::{ModelBench, RunPrefix, VARIATIONS};
use crate::rulebook::Verdict;
use crate::scene::Start;
use crate::world::Scenario;

/// Times of the switch to the second action, as shares of the horizon.
const SWITCH_AT: [f64; 3] = [0.125, 0.25, 0.5];
/// Number of actions above which only the best constants are tried second.
const MANY: usize = 6;
/// Number of constants tried second in that case.
const SECOND: usize = 3;
/// Starts in the surrogate on which the candidates are compared.
const STARTS: usize = 40;

/// Actions tried on an ego, the same from every start.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriedActions {
    /// Actions in order, the last action held.
    pub actions: Vec<usize>,
    /// Runs of the ego under them.
    pub runs: u64,
    /// Runs in which the ego failed and the ado kept every rule.
    pub successes: u64,
}

/// Result of actions on the surrogate.
#[derive(Clone, Copy, Debug, Default)]
struct Worth {
    successes: usize,
    /// Starts with a broken rule or without a counted verdict.
    fouls: usize,
    /// Sum of the margins over all other starts.
    margins: f64,
}

/// Returns the best constant action or pair of actions on the surrogate.
///
/// Candidates are ordered by successes, then by broken rules, then by margin.
/// `None`: the world has no driving scene.
pub(super) fn best_fixed(
    world: &Scenario,
    surrogate: &Arc<Surrogate>,
    starts: &[(Start, u64)],
) -> Option<Vec<usize>> {
    let mut model = ModelBench::quick(world)?;
    let actions = model.bench.spaces().actions;
    let decisions = model.bench.clock().decisions();
    // All candidates play the same starts, so their counts are comparable.
    let starts = &starts[..starts.len().min(STARTS)];
    let mut worth = |actions: &[usize]| {
        let mut worth = Worth::default();
        for (start, noise) in starts {
            let from = (start, *noise);
            model.begin(from, &RunPrefix::default(), Some(surrogate), VARIATIONS[0]);
            model.go_on(actions);
            match model.bench.verdict() {
                Some(Verdict::Counterexample { .. }) => worth.successes += 1,
                Some(Verdict::Held { margin }) => worth.margins += margin,
                _ => worth.fouls += 1,
            }
        }
        worth
    };
    let mut tried: Vec<(Vec<usize>, Worth)> = (0..actions)
        .map(|action| (vec![action], worth(&[action])))
        .collect();
    // The constants must be ranked before the best of them are taken as second actions.
    sort(&mut tried);
    let second = if MANY < actions { SECOND } else { actions };
    let last: Vec<usize> = tried.iter().take(second).map(|one| one.0[0]).collect();
    for first in 0..actions {
        for &then in last.iter().filter(|&&then| then != first) {
            for share in SWITCH_AT {
                // At least one decision, so that the first action is played at all.
                let held = ((share * decisions as f64).round() as usize).max(1);
                let mut sequence = vec![first; held];
                sequence.push(then);
                let worth = worth(&sequence);
                tried.push((sequence, worth));
            }
        }
    }
    sort(&mut tried);
    tried.into_iter().next().map(|(actions, _)| actions)
}

/// Sorts the candidates, the best first, and keeps the order of equals.
fn sort(tried: &mut [(Vec<usize>, Worth)]) {
    tried.sort_by(|(_, a), (_, b)| {
        let by_successes = b.successes.cmp(&a.successes);
        let by_fouls = a.fouls.cmp(&b.fouls);
        by_successes
            .then(by_fouls)
            // A smaller margin means that the ego came closer to a failure.
            .then(a.margins.total_cmp(&b.margins))
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::nn::Mlp;
    use crate::surrogate::model::OUTPUTS;

    #[test]
    fn of_actions_that_are_the_same_everywhere_those_with_most_successes_are_found() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let width = super::super::surrogate_sim::width_of(&world);
        // Surrogate that keeps its acceleration whatever it sees.
        let idle = Arc::new(Surrogate {
            mean: vec![0.0; width],
            inverse_sd: vec![1.0; width],
            unit: [0.0, 0.0],
            range_mps2: [-9.0, 9.0],
            alike: Arc::default(),
            members: vec![Mlp::orthogonal(
                &[width, 4, OUTPUTS],
                0.1,
                &mut crate::rl::LearnerRng::new(1),
            )],
            brake: None,
        });
        let from = super::super::dataset::starts(&world, 20, 3);
        let found = best_fixed(&world, &idle, &from).expect("driven");
        // A coasting follower is hit most surely by braking at once. A stop breaks a rule.
        let (last, before) = found.split_last().expect("an action");
        assert!(
            !before.is_empty() && before.iter().all(|&action| action == 0),
            "{found:?}"
        );
        assert_ne!(*last, 0);
        let grid = Scenario::shipped("grid").expect("shipped").expect("sound");
        assert_eq!(best_fixed(&grid, &idle, &from), None);
    }
}
