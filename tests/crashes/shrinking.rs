//! Counterexamples get smaller and stay counterexamples.

use std::cmp::Ordering;

use brakecheck::experiment::Watch;
use brakecheck::run_dir::Effort;
use brakecheck::testbench::Episode;
use brakecheck::world::Scenario;
use brakecheck_crashes::crashes::minimize::{CLOSING, effort, shrink};

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

/// The crash of `small` is almost as bad as that of `large`.
fn is_as_bad(small: &Episode, large: &Episode) -> bool {
    let crash = large.contact.as_ref().is_none_or(|touch| {
        small.contact.as_ref().is_some_and(|kept| {
            let least_mps = CLOSING * touch.closing_speed_mps;
            kept.between == touch.between && least_mps <= kept.closing_speed_mps
        })
    });
    crash && (!small.is_foul_before_contact() || large.is_foul_before_contact())
}

fn shrinks(world: &Scenario, episodes: &[Episode]) {
    let mut switches = Vec::new();
    for large in &episodes[..6] {
        let (small, shrunk) = shrink(world, large, &Watch::unwatched());
        assert!(small.verdict.is_success() && is_as_bad(&small, large));
        assert_eq!(shrunk.before, effort(world, &large.actions));
        assert_eq!(shrunk.after, effort(world, &small.actions));
        let unchanged = small == *large && shrunk.after == shrunk.before;
        assert!(
            unchanged || shrunk.after.is_less_than(&shrunk.before),
            "{shrunk}"
        );
        // Bit for bit, and the same each time.
        assert_eq!(replayed(world, &small, &small.actions), small);
        assert_eq!(shrink(world, large, &Watch::unwatched()).0, small);
        switches.push(shrunk.after.switches);
    }
    switches.sort_unstable();
    assert!(switches[switches.len() / 2] <= 2, "{switches:?}");
}

#[test]
fn what_held_random_actions_find_takes_two_switches_at_most() {
    shrinks(acc(), acc_found());
    shrinks(cut_in(), cut_in_found());
}

/// With one switch or none the smallest is found, by trying all of them.
#[test]
fn with_one_switch_nothing_smaller_exists() {
    let world = acc();
    let mut compared = 0;
    for large in &acc_found()[..6] {
        let (small, shrunk) = shrink(world, large, &Watch::unwatched());
        if 1 < shrunk.after.switches || 3 <= compared {
            continue;
        }
        let decisions = world.bench().clock().decisions();
        for (first, second) in (0..9).map(|pair| (pair / 3, pair % 3)) {
            for at in 1..decisions {
                let actions: Vec<usize> = (0..decisions)
                    .map(|decision| if decision < at { first } else { second })
                    .collect();
                let tried = replayed(world, large, &actions);
                let counts = tried.verdict.is_success() && is_as_bad(&tried, large);
                let smaller = effort(world, &tried.actions).is_less_than(&shrunk.after);
                assert!(
                    !(counts && smaller),
                    "{:?} against {:?}",
                    tried.actions,
                    small.actions
                );
            }
        }
        compared += 1;
    }
    assert_eq!(compared, 3);
}
