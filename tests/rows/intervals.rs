//! Intervals against those of `intervals.py`, and against published ones.

use brakecheck::stats::{
    Outcomes, at_most, mean_difference, paired_difference, runs_interval, seeds_interval, wilson,
};
use serde::Deserialize;

use super::near;

/// Marks of both sides, their difference and its interval.
type Pair = (Vec<Outcomes>, Vec<Outcomes>, f64, [f64; 2]);

/// What the script wrote.
#[derive(Deserialize)]
struct Worked {
    z: f64,
    wilson: Vec<(usize, usize, [f64; 2])>,
    at_most: Vec<(usize, f64)>,
    seeds: Vec<(Vec<Outcomes>, [f64; 2])>,
    agreeing: Vec<(Vec<Outcomes>, [f64; 2])>,
    pairs: Vec<Pair>,
    runs: Vec<(Vec<Outcomes>, [f64; 2])>,
}

fn worked() -> Worked {
    serde_json::from_str(include_str!("intervals.json")).expect("what the script wrote")
}

/// Every training of a list, as the intervals take them.
fn all(outcomes: &[Outcomes]) -> Vec<&Outcomes> {
    outcomes.iter().collect()
}

fn marked<const N: usize>(marks: [&str; N]) -> [Outcomes; N] {
    marks.map(|marks| marks.parse().expect("marks"))
}

#[track_caller]
fn near_ends(seen: [f64; 2], expected: [f64; 2], slack: f64) {
    let off = (seen[0] - expected[0])
        .abs()
        .max((seen[1] - expected[1]).abs());
    assert!(off <= slack, "{seen:?}, not {expected:?}");
}

#[test]
fn wilson_intervals_are_those_of_the_equation_they_solve() {
    let worked = worked();
    assert!((worked.z - 1.959_963_985).abs() < 1e-9);
    for (successes, n, expected) in worked.wilson {
        near_ends(wilson(successes, n), expected, 1e-12);
    }
    assert_eq!(wilson(0, 0), [0.0, 1.0]);
    // Newcombe 1998, Table I, method 3, 95 %.
    for (successes, n, expected) in [
        (81, 263, [0.2553, 0.3662]),
        (15, 148, [0.0624, 0.1605]),
        (0, 20, [0.0, 0.1611]),
        (1, 29, [0.0061, 0.1718]),
    ] {
        near_ends(wilson(successes, n), expected, 5.1e-5);
    }
}

#[test]
fn the_bound_of_a_rate_that_was_never_seen_is_exact() {
    for (n, expected) in worked().at_most {
        near(at_most(n), expected);
    }
    assert_eq!(at_most(0), 1.0);
}

/// Ends within 3 % of the width: the crate sums over a few nodes, the script over many.
/// Where trainings agree the starts are most of it, and 1 % is enough.
#[test]
fn intervals_of_several_trainings_are_those_of_fine_sums() {
    let worked = worked();
    for (cases, slack) in [(worked.seeds, 0.03), (worked.agreeing, 0.01)] {
        for (solved, expected) in cases {
            let seen = seeds_interval(&all(&solved));
            near_ends(seen, expected, slack * (expected[1] - expected[0]));
        }
    }
}

#[test]
fn intervals_of_differences_are_those_of_fine_sums() {
    for (a, b, difference, expected) in worked().pairs {
        let (a, b) = (all(&a), all(&b));
        let slack = match a.len().max(b.len()) {
            1 => 1e-12,
            _ => 0.03 * (expected[1] - expected[0]),
        };
        let (seen, interval) = paired_difference(&a, &b);
        near(seen, difference);
        near_ends(interval, expected, slack);
        let (turned, [lo, hi]) = paired_difference(&b, &a);
        near(turned, -difference);
        near_ends([-hi, -lo], expected, slack);
        // The same difference on another ego is no further evidence, and the mean
        // with an ego on which the sides change places is none at all.
        let pair = || (a.clone(), b.clone());
        let (twice, interval) = mean_difference(&[pair(), pair()]);
        near(twice, difference);
        near_ends(interval, expected, slack);
    }
}

/// By hand: a solves 3 of 4 on one ego and 1 of 4 on the other, b 1 and 1.
#[test]
fn a_mean_over_egos_is_the_mean_of_their_differences() {
    let [a, b, other_a, other_b] = &marked(["1110", "1000", "0001", "1000"]);
    let pairs = [(vec![a], vec![b]), (vec![other_a], vec![other_b])];
    let (mean, [lo, hi]) = mean_difference(&pairs);
    near(mean, (0.5 + 0.0) / 2.0);
    // Per start (0 − 1 + 0)/2, (1 + 0)/2, (1 + 0)/2, (0 + 1)/2 about 1/4: squares sum
    // to 9/16 + 3/16 = 3/4, so the starts' variance is 3/4 / 3 / 4 = 1/16. With two
    // more starts: 1/16 + 2/36, and the middle moves by 1/4 · 2/6 towards 0.
    let half = 1.959_963_984_540_054 * (1.0 / 16.0 + 2.0 / 36.0_f64).sqrt();
    near(lo, 0.25 - (half + 1.0 / 12.0));
    near(hi, 0.25 + (half - 1.0 / 12.0));
}

/// Marks that are neither 1 nor 0 are no starts, whichever they are.
#[test]
fn trivial_invalid_and_unreached_starts_are_not_counted() {
    let plain = marked(["1101", "0111", "1001"]);
    let spread = marked(["t1-1x01", "t0-1x11", "t1-0x01"]);
    let [one, other] = &marked(["0100", "0011000"]);
    let (plain, spread) = (all(&plain), all(&spread));
    assert_eq!(seeds_interval(&plain), seeds_interval(&spread));
    assert_eq!(runs_interval(&plain), runs_interval(&spread));
    assert_eq!(
        paired_difference(&plain, &[one]),
        paired_difference(&spread, &[other])
    );
    assert_eq!(seeds_interval(&spread[..1]), wilson(3, 4));
}

#[test]
fn intervals_of_repeated_starts_are_wilsons_for_as_many_coins() {
    for (solved, expected) in worked().runs {
        near_ends(runs_interval(&all(&solved)), expected, 1e-9);
    }
}
