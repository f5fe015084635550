//! Counts that were computed independently before this solver existed.

use brakecheck::rl::LearnerRng;
use brakecheck::testbench::{Aftermath, Random, Replay, play};
use brakecheck_experiment::grid_solver::exact::{Game, UNIT_MOVES, chase};
use brakecheck_experiment::grid_solver::position_policy::PositionPolicy;
use brakecheck_scene::scene::grid::position_of;

use super::{A, B, captures, cells, changed, episode, game, soonest, world};
use brakecheck::world::{AtWall, GridChange, Horizon, Scenario};

fn chased(game: &Game) -> usize {
    let caught = |start: &_| game.captures(*start, |both| chase(both, &UNIT_MOVES));
    game.arena.starts().filter(caught).count()
}

/// The shipped world with n cells a side, an ego of k cells per step, and K steps.
fn sized(wall: AtWall, size: u32, k: u32, steps: u32) -> Scenario {
    let change = GridChange {
        size: Some(size),
        ego_step: Some(k),
        horizon: Some(Horizon::Steps(steps)),
        ..GridChange::default()
    };
    changed(&world(wall), change)
}

#[test]
fn with_twice_the_side_in_steps_the_best_ado_captures_from_everywhere() {
    for (size, all, steps) in [
        (2, 12, 1..=4),
        (4, 240, 1..=4),
        (5, 600, 1..=4),
        (10, 9900, 2..=2),
    ] {
        for k in steps {
            for wall in [A, B] {
                let best = soonest(&sized(wall, size, k, 2 * size));
                assert_eq!(best.graph().starts().count(), all);
                assert_eq!(best.successes(), all, "{wall:?}, n = {size}, k = {k}");
            }
        }
    }
}

#[test]
fn with_as_many_steps_as_the_side_it_does_not() {
    let known = [(4, [188, 204, 214, 220]), (5, [440, 480, 504, 528])];
    for (size, counts) in known {
        for (k, count) in (1..).zip(counts) {
            let captures = soonest(&sized(A, size, k, size)).successes();
            assert_eq!(captures, count, "n = {size}, k = {k}");
        }
    }
}

#[test]
fn random_actions_capture_as_often_as_backward_induction_says() {
    for (size, k, known) in [(4, 1, 24.5), (4, 2, 32.2), (5, 2, 52.0), (10, 2, 209.0)] {
        let expected: f64 = game(A, size, k, 2 * size).random_captures().iter().sum();
        assert!(
            (expected / known - 1.0).abs() < 0.005,
            "n = {size}, k = {k}: {expected}"
        );
    }
}

#[test]
fn random_actions_on_the_test_bench_agree_with_it() {
    let world = world(B);
    let game = Game::of(cells(&world).world());
    let expected: f64 = game.random_captures().iter().sum();
    let starts = world.starts().expect("a finite world");
    let mut bench = world.bench();
    let mut actor = Random::new(UNIT_MOVES.len());
    let rounds = 40;
    let mut captured = 0;
    for round in 0..rounds {
        for (i, start) in starts.iter().enumerate() {
            let noise = round * 1_000 + i as u64;
            let played = play(&mut bench, start, noise, &mut actor, Aftermath::Skip);
            captured += u32::from(played.verdict.is_success());
        }
    }
    let mean = f64::from(captured) / rounds as f64;
    // Five standard deviations of the mean of 40 × 240 Bernoulli draws.
    assert!((mean - expected).abs() < 6.0, "{mean} against {expected}");
}

#[test]
fn random_tables_capture_little() {
    for (size, k, known) in [(2, 2, 1.8), (4, 2, 11.0), (5, 2, 14.6), (10, 2, 31.5)] {
        let game = game(A, size, k, 2 * size);
        let tables = 4_000 / size.pow(3).max(27);
        let mut dice = LearnerRng::new(7);
        let captured: usize = (0..tables)
            .map(|_| game.table_captures(|| dice.below(5)))
            .sum();
        let mean = captured as f64 / f64::from(tables);
        // Tables differ a lot; the order of magnitude is what the paper's ado has.
        assert!(
            (0.5 * known..1.6 * known).contains(&mean),
            "n = {size}: {mean}"
        );
    }
}

#[test]
fn under_a_two_lines_are_optimal_and_under_b_they_are_not() {
    for (size, all) in [(2, 12), (4, 240), (5, 600), (10, 9900)] {
        for k in 1..=4 {
            assert_eq!(chased(&game(A, size, k, 2 * size)), all);
        }
    }
    let known = [
        (4, 1, 112),
        (4, 2, 20),
        (4, 3, 60),
        (4, 4, 240),
        (5, 2, 208),
        (10, 2, 4946),
    ];
    for (size, k, count) in known {
        assert_eq!(
            chased(&game(B, size, k, 2 * size)),
            count,
            "n = {size}, k = {k}"
        );
    }
}

#[test]
fn the_best_ado_plays_on_the_test_bench_as_it_was_solved() {
    for wall in [A, B] {
        for change in [
            GridChange::default(),
            GridChange {
                size: Some(5),
                ego_step: Some(1),
                ..GridChange::default()
            },
            GridChange {
                refine: Some(2),
                ego_step: Some(3),
                ..GridChange::default()
            },
        ] {
            let world = cells(&changed(&world(wall), change)).fully_observed();
            let grid = cells(&world).world();
            let solution = soonest(&world);
            let best = PositionPolicy::optimal(grid, world.rulebook()).expect("distinct");
            assert_eq!(captures(&world, &best), solution.successes());
            for start in world.starts().expect("a finite world") {
                let both = position_of(&start, &grid.spec().arena);
                let played = episode(&world, &start, &best);
                assert_eq!(played.actions, solution.actions(both), "{both:?}");
            }
        }
    }
}

#[test]
fn the_shipped_observation_is_the_whole_state_of_the_training_map() {
    for wall in [A, B] {
        let world = world(wall);
        let best = PositionPolicy::optimal(cells(&world).world(), world.rulebook())
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(captures(&world, &best), 240);
    }
}

#[test]
fn swapping_places_is_no_capture() {
    let world = world(B);
    // The ado steps up into the ego's cell as the ego bounces down over it.
    let start = brakecheck::scene::Start(vec![0.0, 3.0, 0.0, 2.0]);
    let mut ado = Replay::holding(&[0, 4]);
    let played = play(&mut world.bench(), &start, 0, &mut ado, Aftermath::Skip);
    let distance = played.trace.signal("d_man").expect("published");
    assert_eq!(distance[..2], [1.0, 2.0]);
}
