//! Theorems 1 and 2 on a grid, where V* is known: every pair of starts.

use rayon::prelude::*;
use serde::Serialize;

use super::TheoremsError;
use crate::campaign::Watch;
use crate::campaign::episodes::{EpisodeLoop, Turn};
use crate::rl::Policy;
use crate::rulebook::Verdict;
use crate::scenario::Scenario;
use crate::scene::Start;
use crate::scene::grid::exact::{Game, Solution};
use crate::scene::grid::{GridWorld, position_of};
use crate::testbench::{Aftermath, Replay, Testbench, play};

/// By how much δ exceeds a difference of values: the theorems say "less than".
const JUST_ABOVE: f64 = 1e-9;

/// Theorems 1 and 2, checked on every pair of starts of a grid.
#[derive(Clone, Debug, Serialize)]
pub struct NearbyStarts {
    /// Starts.
    pub starts: usize,
    /// Starts from which the best ado makes the ego fail.
    pub counterexamples: usize,
    /// Ordered pairs (x0 a counterexample, x0') with δ < V*(x0) + 1.
    pub pairs: u64,
    /// Pairs on which Theorem 1 fails: each is a bug of this program.
    pub misses: u64,
    /// Theorem 2's α = max |V_k − V*| of the trained ado.
    pub alpha: f64,
    /// Pairs with δ + 2α < V*(x0) + 1, δ in terms of V_k.
    pub pairs_of_2: u64,
    /// Pairs on which Theorem 2 fails: each is a bug of this program.
    pub misses_of_2: u64,
}

/// Checks both theorems on every pair; `policy` is the trained ado.
///
/// # Errors
/// The world is no grid, or the exact solver does not speak of its
/// specification.
pub fn nearby_starts(
    scenario: &Scenario,
    policy: &dyn Policy,
) -> Result<NearbyStarts, TheoremsError> {
    let best = optimal_values(scenario)?;
    let learned = learned_values(scenario, policy);
    let gaps = best.iter().zip(&learned).map(|(v, l)| (v - l).abs());
    let alpha = gaps.fold(0.0, f64::max);
    // V* is what the best continuation is paid: `optimal_values` played it.
    let counts: Vec<[u64; 4]> = (0..best.len())
        .into_par_iter()
        .filter(|&here| 0.0 < best[here])
        .map(|here| {
            let mut counts = [0; 4];
            for (there, paid) in best.iter().enumerate() {
                let near = (best[here] - paid).abs() + JUST_ABOVE;
                let learned = (learned[here] - learned[there]).abs() + 2.0 * alpha + JUST_ABOVE;
                for (first, delta) in [(0, near), (2, learned)] {
                    if delta < best[here] + 1.0 {
                        counts[first] += 1;
                        counts[first + 1] += u64::from(*paid < best[here] - delta);
                    }
                }
            }
            counts
        })
        .collect();
    let sum = |which: usize| counts.iter().map(|counts| counts[which]).sum();
    Ok(NearbyStarts {
        starts: best.len(),
        counterexamples: counts.len(),
        pairs: sum(0),
        misses: sum(1),
        alpha,
        pairs_of_2: sum(2),
        misses_of_2: sum(3),
    })
}

/// V* of every start, in units of the reward, by exact backward induction.
///
/// From every start the best continuation is played, its rules are seen to
/// hold, and what it is paid is compared with V*.
///
/// # Errors
/// As [`nearby_starts`].
pub fn optimal_values(scenario: &Scenario) -> Result<Vec<f64>, TheoremsError> {
    let not_solved = |why: String| TheoremsError::NotSolved {
        world: scenario.name.clone(),
        why,
    };
    let (Some(grid), Some(starts)) = (scenario.grid(), scenario.starts()) else {
        return Err(not_solved("it is no grid with a list of starts".to_owned()));
    };
    let game = Game::of(grid);
    // With every number of steps left: what is best changes towards the end.
    let left: Vec<Solution> = (0..=game.steps)
        .into_par_iter()
        .map(|steps| {
            let game = Game {
                steps,
                ..game.clone()
            };
            game.solve()
        })
        .collect();
    let reward = scenario.rulebook().reward;
    let value_of = |bench: &mut Testbench, start: &Start| {
        let value = left.last().map_or(0.0, |whole| {
            whole.robustness(position_of(start, &game.arena))
        });
        let best = reward.lawful(value);
        let actions = best_actions(grid, &left, start);
        let mut ado = Replay::holding(&actions);
        let played = play(bench, start, 0, &mut ado, Aftermath::Skip);
        if let Verdict::Foul { .. } | Verdict::Invalid = played.verdict {
            let word = played.verdict.word();
            return Err(not_solved(format!("from {:?} it is a {word}", start.0)));
        }
        match scenario.rulebook().reward_of(&played.verdict) {
            Some(paid) if paid == best => Ok(best),
            paid => Err(not_solved(format!(
                "from {:?} V* is {best}, but {paid:?} is paid",
                start.0
            ))),
        }
    };
    let value_of = |bench: &mut Testbench, start: &Start, _: &Turn| Some(value_of(bench, start));
    let unwatched = Watch::unwatched();
    let all = EpisodeLoop::uncounted(&unwatched);
    let values = all.run(&starts, || scenario.bench(), value_of);
    values.into_iter().flatten().collect()
}

fn best_actions(grid: &GridWorld, left: &[Solution], start: &Start) -> Vec<usize> {
    let game = Game::of(grid);
    let mut both = position_of(start, &game.arena);
    let mut actions = Vec::new();
    for after in left.iter().rev().skip(1) {
        let next = |action: usize| game.arena.next(both, game.moves[action]);
        let rho = |action: usize| after.robustness(next(action));
        let best = (0..game.moves.len()).max_by(|a, b| rho(*a).total_cmp(&rho(*b)));
        let Some(best) = best else { break };
        actions.push(best);
        both = next(best);
    }
    actions
}

fn learned_values(scenario: &Scenario, policy: &dyn Policy) -> Vec<f64> {
    let starts = scenario.starts().unwrap_or_default();
    let mut bench = scenario.bench();
    let mut obs = vec![0.0; bench.spaces().observation];
    let values = starts.iter().map(|start| {
        bench.begin(start, 0, Aftermath::Skip);
        bench.observe(&mut obs);
        f64::from(policy.value(&obs))
    });
    values.collect()
}
