//! Theorems 1 and 2, checked against the exact V*.

use brakecheck::rl::Control;
use brakecheck::rulebook::Verdict;
use brakecheck::scenario::{GridChange, Scenario};
use brakecheck::scene::grid::exact::{Game, Solution};
use brakecheck::scene::grid::{Horizon, position_of};
use brakecheck::seed::Purpose;
use brakecheck::testbench::{Aftermath, Gym, Replay, play};

use super::{A, B, changed, world};

/// V* of every start and the reward that an optimal continuation is paid.
fn values(scenario: &Scenario) -> Vec<(f64, f64)> {
    let grid = scenario.grid().expect("a grid");
    let game = Game::of(grid);
    // With every number of steps left: what is best changes towards the end.
    let left = 0..=game.steps;
    let left: Vec<Solution> = left.map(|steps| with_steps(&game, steps).solve()).collect();
    let rulebook = scenario.rulebook();
    let value = |start| {
        let from = position_of(start, &game.arena);
        let mut both = from;
        let mut actions = Vec::new();
        for steps in (0..game.steps).rev() {
            let next = |action: usize| game.arena.next(both, game.moves[action]);
            let rho = |action: usize| left[steps as usize].robustness(next(action));
            let best = |a: &usize, b: &usize| rho(*a).total_cmp(&rho(*b));
            actions.push((0..game.moves.len()).max_by(best).expect("moves"));
            both = next(actions[actions.len() - 1]);
        }
        let mut ado = Replay::holding(&actions);
        let played = play(&mut scenario.bench(), start, 0, &mut ado, Aftermath::Skip);
        let broken = matches!(played.verdict, Verdict::Foul { .. } | Verdict::Invalid);
        assert!(!broken, "the rules hold from every start");
        let paid = rulebook.reward_of(&played.verdict).expect("no fault");
        let best = rulebook
            .reward
            .lawful(left[game.steps as usize].robustness(from));
        assert_eq!(paid, best, "V* is what its continuation is paid");
        (best, paid)
    };
    let starts = scenario.starts().expect("a finite world");
    starts.iter().map(value).collect()
}

fn with_steps(game: &Game, steps: u32) -> Game {
    Game {
        steps,
        ..game.clone()
    }
}

/// Theorem 1 in reward units: V* differs by less than δ < V*(x0) + 1, so the
/// rules hold from x0' and what is paid there is at least V*(x0) − δ.
#[test]
fn theorem_1_holds_on_every_pair_of_starts() {
    for wall in [A, B] {
        for horizon in [Horizon::PerSize(2), Horizon::PerSize(1)] {
            let change = GridChange {
                horizon: Some(horizon),
                ..GridChange::default()
            };
            let values = values(&changed(&world(wall), change));
            let mut pairs = 0;
            for (here, _) in values.iter().filter(|(value, _)| 0.0 < *value) {
                for (there, paid) in &values {
                    let delta = (here - there).abs() + 1e-9;
                    if delta < here + 1.0 {
                        pairs += 1;
                        assert!(here - delta <= *paid, "{wall:?}: {here} {there} {paid}");
                    }
                }
            }
            assert!(values.len() < pairs, "the theorem is not vacuous");
        }
    }
}

/// Theorem 2's α for a tabular ado, and what follows: values that a learner
/// finds close are close in V*, up to 2α.
#[test]
fn theorem_2_carries_closeness_over_to_the_exact_values() {
    let scenario = world(B);
    let exact = values(&scenario);
    let config = &scenario.learners["q"];
    let mut learner = config.build(scenario.world().spaces(), 1);
    let mut gym = Gym::new(scenario.bench(), Purpose::Train, 1);
    learner.train(&mut gym, &mut |_| Control::Continue);
    let policy = learner.policy();
    let mut bench = scenario.bench();
    let mut obs = vec![0.0; bench.spaces().observation];
    let learned: Vec<f64> = scenario
        .starts()
        .expect("a finite world")
        .iter()
        .map(|start| {
            bench.begin(start, 0, Aftermath::Skip);
            bench.observe(&mut obs);
            f64::from(policy.value(&obs))
        })
        .collect();
    let gaps = learned
        .iter()
        .zip(&exact)
        .map(|(v, (best, _))| (v - best).abs());
    let alpha = gaps.fold(0.0, f64::max);
    println!("α = {alpha:.3}");
    assert!(
        alpha < 0.6,
        "γ < 1 discounts by at most the steps to the capture: {alpha}"
    );
    for (i, here) in learned.iter().enumerate() {
        for (j, there) in learned.iter().enumerate() {
            let bound = (here - there).abs() + 2.0 * alpha + 1e-9;
            assert!((exact[i].0 - exact[j].0).abs() <= bound);
        }
    }
}
