//! Counterexamples get smaller and stay counterexamples.

use std::cmp::Ordering;

use brakecheck::experiment::Watch;
use brakecheck::run_dir::Effort;
use brakecheck::testbench::Episode;
use brakecheck::world::Scenario;
use brakecheck_crashes::crashes::minimize::{CLOSING, effort, shrink, up_to_failure};

use super::found::{acc, acc_found, cut_in, cut_in_found, replayed};
use super::near;

#[test]
fn effort_counts_switches_first_then_distance_then_how_late() {
    let world = acc();
    // −3, 0 and 3 m/s², the middle one neutral: half the largest distance.
    let it = effort(world, &[1, 1, 0, 2, 2, 1]);
    assert_eq!((it.switches, it.first), (3, Some(2)));
    near(it.deviation, 1.5);
    assert_eq!(effort(world, &[1, 1]).first, None);
    let of = |switches, deviation, first| Effort {
        switches,
        deviation,
        first,
    };
    let ascending = [
        of(0, 9.0, Some(0)),
        of(1, 0.5, Some(7)),
        of(1, 0.5, Some(6)),
        of(1, 0.6, Some(9)),
        of(2, 0.1, Some(9)),
    ];
    for (n, low) in ascending.iter().enumerate() {
        assert_eq!(low.order(low), Ordering::Equal);
        assert!(ascending[n + 1..].iter().all(|high| low.is_less_than(high)));
    }
}

#[test]
fn actions_are_as_far_apart_as_what_they_ask_for() {
    // 3 accelerations (−3, 0, 2) with 2 lateral moves, hold first; 1 is neutral.
    let world = cut_in().world();
    near(world.action_distance(1, 1), 0.0);
    near(world.action_distance(0, 1), 0.5 * 0.6);
    near(world.action_distance(2, 1), 0.5 * 0.4);
    near(world.action_distance(4, 1), 0.5);
    near(world.action_distance(3, 2), 1.0);
}

/// Whether a crash has the parties, sides, speed and drivers of another.
fn is_same(world: &Scenario, small: &Episode, large: &Episode) -> bool {
    let crash = match (&small.contact, &large.contact) {
        (None, None) => true,
        (Some(kept), Some(touch)) => {
            let by_mps = (kept.closing_speed_mps - touch.closing_speed_mps).abs();
            let [kept_sides, sides] = [kept, touch].map(|it| {
                let impact = it.impact.expect("of vehicles");
                (impact.kind, impact.ego_side, impact.other_side)
            });
            kept.between == touch.between
                && by_mps <= CLOSING * touch.closing_speed_mps
                && kept_sides == sides
                && world.preventability(small).label == world.preventability(large).label
        }
        _ => false,
    };
    crash && (!small.is_foul_before_contact() || large.is_foul_before_contact())
}

fn shrinks(world: &Scenario, episodes: &[Episode]) {
    let mut smaller = 0;
    let neutral = world.world().spaces().neutral;
    for large in &episodes[..6] {
        let (small, shrunk) = shrink(world, large, &Watch::unwatched());
        assert!(small.verdict.is_success() && is_same(world, &small, large));
        let [before, after] = [large, &small].map(|it| up_to_failure(world, it));
        assert_eq!(shrunk.before, effort(world, before));
        assert_eq!(shrunk.after, effort(world, after));
        let unchanged = small == *large && shrunk.after == shrunk.before;
        assert!(
            unchanged || shrunk.after.is_less_than(&shrunk.before),
            "{shrunk}"
        );
        // Neither part of the effort grows.
        assert!(shrunk.after.switches <= shrunk.before.switches, "{shrunk}");
        let most = shrunk.before.deviation + 1e-9;
        assert!(shrunk.after.deviation <= most, "{shrunk}");
        // After the failure the ado does as recorded, then nothing.
        let mut recorded = large.actions[before.len()..]
            .iter()
            .copied()
            .chain(std::iter::repeat(neutral));
        for action in &small.actions[after.len()..] {
            assert_eq!(Some(*action), recorded.next());
        }
        // Bit for bit, and the same each time.
        assert_eq!(replayed(world, &small, &small.actions), small);
        assert_eq!(shrink(world, large, &Watch::unwatched()).0, small);
        smaller += usize::from(!unchanged);
    }
    assert!(smaller >= 2, "{smaller} of 6 are smaller");
}

/// Actions count up to the failure: the sample of the start needs none.
#[test]
fn an_action_counts_if_it_comes_before_the_failure() {
    let world = acc();
    let found = &acc_found()[0];
    // Ten samples a decision.
    for (judged, actions) in [(1, 0), (2, 1), (11, 1), (12, 2)] {
        let mut episode = found.clone();
        episode.judged = judged;
        assert_eq!(up_to_failure(world, &episode).len(), actions, "{judged}");
    }
    // Of an episode whose contact is held to the horizon.
    let mut held = found.clone();
    held.judged = 301;
    assert_eq!(up_to_failure(world, &held), held.actions);
}

/// A pulse every second decision becomes a single pulse of the same sum.
#[test]
fn a_flicker_becomes_fewer_switches() {
    let world = acc();
    let mut seen = 0;
    for found in acc_found() {
        let decisions = world.bench().clock().decisions();
        let actions: Vec<usize> = (0..decisions).map(|at| at % 2).collect();
        let large = replayed(world, found, &actions);
        if !large.verdict.is_success() {
            continue;
        }
        let (small, shrunk) = shrink(world, &large, &Watch::unwatched());
        assert!(is_same(world, &small, &large));
        if shrunk.before.switches < 6 {
            continue;
        }
        assert!(
            2 * shrunk.after.switches <= shrunk.before.switches,
            "{shrunk}"
        );
        seen += 1;
    }
    assert!(seen > 0, "no flicker makes it fail");
}

#[test]
fn what_held_random_actions_find_gets_smaller_and_stays_the_same_crash() {
    shrinks(acc(), acc_found());
    shrinks(cut_in(), cut_in_found());
}

/// The actions up to a failure, then those after the failure of another.
fn with_aftermath(world: &Scenario, tried: &Episode, large: &Episode) -> Episode {
    let aftermath = &large.actions[up_to_failure(world, large).len()..];
    let mut actions = up_to_failure(world, tried).to_vec();
    actions.extend(aftermath);
    actions.extend([1; 30]);
    replayed(world, large, &actions)
}

/// With one switch or none the smallest is found, by trying all of them.
#[test]
fn with_one_switch_nothing_smaller_exists() {
    let world = acc();
    let mut compared = 0;
    for large in &acc_found()[..6] {
        let (small, shrunk) = shrink(world, large, &Watch::unwatched());
        if shrunk.after.switches > 1 || compared >= 3 {
            continue;
        }
        let decisions = world.bench().clock().decisions();
        for (first, second) in (0..9).map(|pair| (pair / 3, pair % 3)) {
            for at in 1..decisions {
                let actions: Vec<usize> = (0..decisions)
                    .map(|decision| if decision < at { first } else { second })
                    .collect();
                let tried = replayed(world, large, &actions);
                let tried = with_aftermath(world, &tried, large);
                let effort = effort(world, up_to_failure(world, &tried));
                let smaller = effort.is_less_than(&shrunk.after)
                    && effort.deviation <= shrunk.before.deviation;
                let counts = smaller && tried.verdict.is_success() && is_same(world, &tried, large);
                assert!(!counts, "{:?} against {:?}", tried.actions, small.actions);
            }
        }
        compared += 1;
    }
    assert_eq!(compared, 3);
}
