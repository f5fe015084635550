//! Actions that are the same from every start, and the best of them on a surrogate.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::model::Surrogate;
use super::surrogate_sim::{ModelBench, RunPrefix, VARIATIONS};
use crate::rulebook::Verdict;
use crate::scene::Start;
use crate::testbench::NoisyStart;
use crate::world::DriveScenario;

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
pub(crate) struct TriedActions {
    /// Actions in order, the last action held.
    pub actions: Vec<usize>,
    /// Runs of the ego under them.
    pub runs: u64,
    /// Runs in which the ego failed and the ado kept every rule.
    pub successes: u64,
}

/// Result of actions on the surrogate.
#[derive(Clone, Copy, Debug, Default)]
struct ActionScore {
    successes: usize,
    /// Starts with a broken rule or without a counted verdict.
    violations: usize,
    /// Sum of the margins over all other starts.
    margins: f64,
}

/// Returns the best constant action or pair of actions on the surrogate.
///
/// Candidates are ordered by successes, then by broken rules, then by margin.
/// `None`: the ado has no actions.
pub(super) fn best_fixed(
    world: DriveScenario<'_>,
    surrogate: &Arc<Surrogate>,
    starts: &[(Start, u64)],
) -> Option<Vec<usize>> {
    let mut model = ModelBench::quick(world);
    let actions = model.bench.spaces().actions;
    let decisions = model.bench.clock().decisions();
    // All candidates play the same starts, so their counts are comparable.
    let starts = &starts[..starts.len().min(STARTS)];
    let mut score = |actions: &[usize]| {
        let mut score = ActionScore::default();
        for (start, noise) in starts {
            let from = NoisyStart {
                start,
                noise: *noise,
            };
            model.begin(from, &RunPrefix::default(), Some(surrogate), VARIATIONS[0]);
            model.play_actions(actions);
            match model.bench.verdict() {
                Some(Verdict::Counterexample { .. }) => score.successes += 1,
                Some(Verdict::Held { margin }) => score.margins += margin,
                // None of these verdicts has a margin, so the starts are counted instead.
                _ => score.violations += 1,
            }
        }
        score
    };
    let mut tried: Vec<(Vec<usize>, ActionScore)> = (0..actions)
        .map(|action| (vec![action], score(&[action])))
        .collect();
    // The constants must be ranked before the best of them are taken as second actions.
    sort(&mut tried);
    let second = if actions > MANY { SECOND } else { actions };
    let last: Vec<usize> = tried.iter().take(second).map(|one| one.0[0]).collect();
    for first in 0..actions {
        for &then in last.iter().filter(|&&then| then != first) {
            for share in SWITCH_AT {
                // At least one decision, so that the first action is played at all.
                let held = ((share * decisions as f64).round() as usize).max(1);
                let mut sequence = vec![first; held];
                sequence.push(then);
                let score = score(&sequence);
                tried.push((sequence, score));
            }
        }
    }
    sort(&mut tried);
    tried.into_iter().next().map(|(actions, _)| actions)
}

/// Sorts the candidates, the best first, and keeps the order of equals.
fn sort(tried: &mut [(Vec<usize>, ActionScore)]) {
    tried.sort_by(|(_, a), (_, b)| {
        let by_successes = b.successes.cmp(&a.successes);
        let by_violations = a.violations.cmp(&b.violations);
        by_successes
            .then(by_violations)
            // A smaller margin means that the ego came closer to a failure.
            .then(a.margins.total_cmp(&b.margins))
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::LearnerRng;
    use crate::rl::nn::Mlp;
    use crate::surrogate::dataset::starts;
    use crate::surrogate::model::OUTPUTS;
    use crate::surrogate::surrogate_sim::width_of;
    use crate::world::Scenario;

    #[test]
    fn of_actions_that_are_the_same_everywhere_those_with_most_successes_are_found() {
        let scenario = Scenario::shipped("acc").expect("shipped").expect("sound");
        let world = scenario.drive().expect("driven");
        let width = width_of(world);
        // Surrogate that keeps its acceleration whatever it sees.
        let net = Mlp::orthogonal(&[width, 4, OUTPUTS], 0.1, &mut LearnerRng::new(1));
        let idle = Arc::new(Surrogate::of_members(vec![net], [0.0, 0.0], [-9.0, 9.0]));
        let from = starts(&world, 20, 3);
        let found = best_fixed(world, &idle, &from).expect("actions");
        // A coasting follower is hit most surely by braking at once. A stop breaks a rule.
        let (last, before) = found.split_last().expect("an action");
        assert!(
            !before.is_empty() && before.iter().all(|&action| action == 0),
            "{found:?}"
        );
        assert_ne!(*last, 0);
    }
}
