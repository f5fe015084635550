//! Definition 5 and Theorem 3, and the faults that they notice.

use std::collections::{HashSet, VecDeque};

use brakecheck::world::AtWall;
use brakecheck::world::{GridChange, Scenario};
use brakecheck_evaluation::theorems::{TheoremOutcome, bisimulations, theorem_3};
use brakecheck_experiment::grid_solver::bisimulation::{Bisimulation, coarse};
use brakecheck_experiment::grid_solver::exact::Game;
use brakecheck_scene::scene::grid::Position;

use super::theorems::{converged, trained};
use super::{A, B, cells, changed, game, world};

/// The same grid, every cell cut into `refine` × `refine`.
fn refined(game: &Game, refine: u32) -> Game {
    let mut fine = game.clone();
    fine.arena.refine = refine;
    fine.arena.ego_step *= refine;
    fine
}

fn refined_world(scenario: &Scenario, refine: u32) -> Scenario {
    let step = cells(scenario).world().spec().arena.ego_step;
    changed(
        scenario,
        GridChange {
            refine: Some(refine),
            ego_step: Some(refine * step),
            ..GridChange::default()
        },
    )
}

/// Both states after an action, a captured one staying.
fn next(games: [&Game; 2], states: [Position; 2], action: usize) -> [Position; 2] {
    let step = |i: usize| {
        if games[i].arena.touching(states[i]) {
            states[i]
        } else {
            games[i].arena.next(states[i], games[i].moves[action])
        }
    };
    [step(0), step(1)]
}

/// Whether actions lead a pair of states out of `within`, by search.
fn can_be_driven_apart(games: [&Game; 2], states: [Position; 2], within: &Bisimulation) -> bool {
    let mut seen = HashSet::from([states]);
    let mut queue = VecDeque::from([states]);
    while let Some(states) = queue.pop_front() {
        if !within.relates(states[0], states[1]) {
            return true;
        }
        for action in 0..games[0].moves.len() {
            let states = next(games, states, action);
            if seen.insert(states) {
                queue.push_back(states);
            }
        }
    }
    false
}

#[test]
fn the_greatest_bisimulation_drops_what_can_be_driven_apart_and_nothing_else() {
    for wall in [A, B] {
        let first = game(wall, 3, 1, 6);
        let second = refined(&first, 3);
        let within = Bisimulation::within(&first, &second, 0.4);
        let greatest = Bisimulation::greatest(&first, &second, 0.4);
        assert!(!greatest.is_empty() && greatest.len() < within.len());
        assert_eq!((within.candidates(), within.sweeps()), (within.len(), 0));
        assert_eq!(greatest.candidates(), within.len());
        let mut compared = 0;
        for fine in second.arena.starts().step_by(7) {
            let states = [coarse(&first, &second, fine), fine];
            let apart = can_be_driven_apart([&first, &second], states, &within);
            assert_eq!(greatest.relates(states[0], fine), !apart, "{states:?}");
            compared += 1;
        }
        assert!(compared > 500);
    }
}

#[test]
fn equal_offsets_in_their_cells_are_related_and_centres_even_at_zero() {
    let first = game(B, 4, 2, 8);
    for refine in [3, 5] {
        let second = refined(&first, refine);
        let widest = f64::from(refine - 1) / 2.0 / f64::from(refine);
        let relation = Bisimulation::greatest(&first, &second, widest);
        assert!(relation.is_by_cell());
        let offset = |cell: i32| cell % refine as i32;
        for both in second.arena.starts() {
            let equal = offset(both.ego.x) == offset(both.ado.x)
                && offset(both.ego.y) == offset(both.ado.y);
            let first = relation.coarse(both);
            assert!(!equal || relation.relates(first, both), "{both:?}");
        }
        assert_eq!(Bisimulation::least_epsilon(&first, &second, 1.0), Some(0.0));
        let centres = Bisimulation::greatest(&first, &second, 0.0);
        assert_eq!(centres.len(), first.pairs());
    }
}

/// The least ε is found up to a bound that it reaches, and none below it.
#[test]
fn the_least_epsilon_is_within_its_bound() {
    let first = game(B, 4, 2, 8);
    let second = refined(&first, 2);
    let least = Bisimulation::least_epsilon(&first, &second, 4.0).expect("related");
    assert!(least > 0.0 && least < 1.0, "{least}");
    assert_eq!(
        Bisimulation::least_epsilon(&first, &second, least),
        Some(least)
    );
    let below = least - 0.5 / 2.0;
    assert_eq!(Bisimulation::least_epsilon(&first, &second, below), None);
    let at = Bisimulation::greatest(&first, &second, least);
    assert!(at.starts().next().is_some());
    assert!(
        Bisimulation::greatest(&first, &second, below)
            .starts()
            .next()
            .is_none()
    );
}

#[test]
fn an_ego_is_bisimilar_to_itself_and_to_another_only_where_both_never_differ() {
    let nominal = game(A, 4, 2, 8);
    let itself = Bisimulation::greatest(&nominal, &nominal, 0.0);
    assert_eq!((itself.len(), itself.sweeps()), (nominal.pairs(), 1));
    for (first, second) in [
        (game(A, 4, 2, 8), game(A, 4, 1, 8)),
        (game(A, 4, 2, 8), game(B, 4, 2, 8)),
        (game(B, 4, 2, 8), game(B, 4, 1, 8)),
        (game(A, 4, 3, 8), game(A, 4, 4, 8)),
    ] {
        let relation = Bisimulation::greatest(&first, &second, 0.0);
        let within = Bisimulation::within(&first, &second, 0.0);
        for both in second.arena.starts() {
            let apart = can_be_driven_apart([&first, &second], [both, both], &within);
            assert_eq!(relation.relates(both, both), !apart, "{both:?}");
        }
    }
    // Cornered, an ego of one cell stays as one of two cells does, forever.
    let slower = Bisimulation::greatest(&nominal, &game(A, 4, 1, 8), 0.0);
    assert_eq!(slower.starts().count(), 60);
    // On 2 × 2 cells an ego of two or more cells never moves.
    let stuck = [game(A, 2, 2, 4), game(A, 2, 3, 4)];
    let relation = Bisimulation::greatest(&stuck[0], &stuck[1], 0.0);
    assert_eq!(relation.starts().count(), 12);
}

fn checked(
    nominal: &Scenario,
    other: &Scenario,
    policy: &dyn brakecheck::rl::Policy,
) -> Vec<brakecheck_evaluation::theorems::Theorem3> {
    let (nominal, other) = (cells(nominal), cells(other));
    let relations = bisimulations(nominal, other, 0.5).expect("comparable");
    let rows = relations.iter();
    rows.map(|relation| theorem_3(nominal, "other", other, policy, relation))
        .collect::<Result<_, _>>()
        .expect("solvable")
}

#[test]
fn theorem_3_holds_where_the_relation_does() {
    for wall in [A, B] {
        let nominal = cells(&world(wall)).fully_observed();
        let policy = converged(&nominal);
        for refine in [2, 3] {
            let other = refined_world(&nominal, refine);
            let rows = checked(&nominal, &other, &policy);
            assert!(rows.iter().any(|row| row.related_starts > 0), "{refine}");
            for row in rows {
                if row.related_starts == 0 {
                    continue;
                }
                assert_eq!(row.outcome, TheoremOutcome::Holds, "{row:?}");
                assert_eq!(row.inside.replayed, row.inside.pairs, "{row:?}");
                assert_eq!(row.inside.by_cell, row.inside.pairs, "{row:?}");
                assert!(row.outside.replayed < row.outside.pairs, "{row:?}");
            }
        }
    }
}

#[test]
fn theorem_3_fails_with_a_relation_that_is_too_large() {
    let nominal = cells(&world(B)).fully_observed();
    let policy = converged(&nominal);
    let other = refined_world(&nominal, 3);
    let games = [&nominal, &other].map(|world| Game::of(cells(world).world()));
    let within = Bisimulation::within(&games[0], &games[1], 0.4);
    let row =
        theorem_3(cells(&nominal), "3 x 3", cells(&other), &policy, &within).expect("solvable");
    assert!(row.outcome.is_refuted(), "{row:?}");
}

#[test]
fn theorem_3_says_nothing_without_a_counterexample_or_a_relation() {
    let nominal = world(B);
    let untrained = trained(&nominal, "ppo", 50);
    for row in checked(&nominal, &refined_world(&nominal, 3), &*untrained) {
        assert_ne!(row.outcome, TheoremOutcome::Holds, "{row:?}");
    }
    let wall = GridChange {
        at_wall: Some(AtWall::Stays),
        ..GridChange::default()
    };
    let seen = cells(&nominal).fully_observed();
    let policy = converged(&seen);
    for row in checked(&seen, &changed(&seen, wall), &policy) {
        let is_met = row.outcome == TheoremOutcome::Holds;
        assert_eq!(is_met, row.related_starts > 0, "{row:?}");
    }
}

#[test]
fn theorem_3_holds_for_a_slower_ego_where_both_are_cornered() {
    let nominal = cells(&world(A)).fully_observed();
    let slower = GridChange {
        ego_step: Some(1),
        ..GridChange::default()
    };
    for row in checked(&nominal, &changed(&nominal, slower), &converged(&nominal)) {
        assert_eq!(row.outcome, TheoremOutcome::Holds, "{row:?}");
        assert_eq!((row.related_starts, row.inside.pairs), (60, 60), "{row:?}");
        assert!(row.outside.pairs > 0, "{row:?}");
    }
}
