//! Searches for egos whose smallest change is known.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::super::EgoParameter;
use super::super::candidate::front;
use super::super::losses::DrivingLoss;
use super::*;
use crate::stats::StartOutcome;

const STARTS: usize = 40;
const RUNS: usize = 20;

fn parameter(name: &str) -> EgoParameter {
    EgoParameter {
        name: name.to_owned(),
        lo: 0.0,
        hi: 10.0,
        own: 2.0,
        steps: 7,
    }
}

/// Ego whose failures and braking are functions of its values.
struct Fake<F, B> {
    /// Share of the starts that fail.
    failing: F,
    /// Mean braking, m/s².
    braking: B,
    played: AtomicUsize,
}

impl<F: Fn(&[f64]) -> f64, B: Fn(&[f64]) -> f64> Trial for Fake<F, B> {
    fn play(&self, values: &[f64], slice: &Slice) -> Option<EgoMeasurement> {
        let share = (self.failing)(values);
        self.played.fetch_add(slice.starts.len(), Ordering::Relaxed);
        // Failing starts are spread over the list, as they are in a world.
        let fails = |start: usize| ((7 * start) % STARTS) as f64 + 0.5 < share * STARTS as f64;
        let outcome = |start| {
            if fails(start) {
                StartOutcome::Solved
            } else {
                StartOutcome::Unsolved
            }
        };
        let braking = (self.braking)(values);
        Some(EgoMeasurement {
            outcomes: slice.starts.clone().map(outcome).collect(),
            runs: slice.runs.clone().map(|_| Some(vec![braking])).collect(),
        })
    }
}

/// Result of a search for a fake ego of three parameters.
struct Found {
    all: Vec<EgoCandidate>,
    is_feasible: bool,
    front: Vec<EgoCandidate>,
    played: usize,
}

fn searched(failing: impl Fn(&[f64]) -> f64, braking: impl Fn(&[f64]) -> f64, seed: u64) -> Found {
    searched_in_round(failing, braking, seed, 0)
}

fn searched_in_round(
    failing: impl Fn(&[f64]) -> f64,
    braking: impl Fn(&[f64]) -> f64,
    seed: u64,
    round: usize,
) -> Found {
    let parameters = ["gap_s", "gain", "limit"].map(parameter);
    let losses = &DrivingLoss::usual()[..1];
    let fake = Fake {
        failing,
        braking,
        played: AtomicUsize::new(0),
    };
    let own = fake.play(
        &[2.0; 3],
        &Slice {
            starts: 0..STARTS,
            runs: 0..RUNS,
        },
    );
    let own = own.expect("it plays");
    let conditions = Conditions {
        parameters: &parameters,
        losses,
        own: &own,
        remaining: 0.1,
    };
    let watch = Watch::unwatched();
    let optimizer = Optimizer {
        conditions: &conditions,
        trial: &fake,
        slices: slices(STARTS, RUNS),
        watch: &watch,
        seed,
        round,
        from: None,
    };
    let all = optimizer.search();
    Found {
        is_feasible: all.first().is_some_and(|it| conditions.is_feasible(it)),
        front: front(&conditions, &all),
        played: fake.played.load(Ordering::Relaxed),
        all,
    }
}

/// The ego fails less the longer its gap, and from 5 s on not at all.
fn by_gap(values: &[f64]) -> f64 {
    (0.5 * (5.0 - values[0]) / 3.0).clamp(0.0, 1.0)
}

#[test]
fn the_smallest_change_leaves_parameters_without_effect_alone() {
    for seed in 0..5 {
        let found = searched(by_gap, |_| 1.0, seed);
        let best = &found.all[0].values;
        assert!(found.is_feasible, "{best:?}");
        assert_eq!(best[1..], [2.0, 2.0], "of no effect");
        // Half of the allowed failures are at a gap of 4.85 s.
        assert!((best[0] - 4.85).abs() < 0.15, "{best:?}");
        // The same seed finds the same.
        assert_eq!(searched(by_gap, |_| 1.0, seed).all[0].values, *best);
    }
}

#[test]
fn a_change_of_two_parameters_is_found_where_none_of_one_is_enough() {
    let both = |values: &[f64]| {
        let reached = (values[0] - 2.0).clamp(0.0, 3.0) + (values[2] - 2.0).clamp(0.0, 3.0);
        0.5 * (1.0 - reached / 6.0)
    };
    let found = searched(both, |_| 1.0, 3);
    let best = &found.all[0].values;
    assert!(found.is_feasible, "{best:?}");
    assert_eq!(best[1], 2.0);
    assert!(best[0] > 4.0 && best[2] > 4.0, "{best:?}");
}

#[test]
fn a_change_that_costs_more_than_its_limit_is_no_result() {
    // Each second of gap costs a twentieth more braking, so a gap of 4 s is the most.
    let found = searched(by_gap, |values| 1.0 + 0.05 * (values[0] - 2.0), 1);
    assert!(!found.is_feasible, "{:?}", found.all[0].values);
    // The front then has changes that help, and none beyond the limit.
    assert!(!found.front.is_empty());
    for candidate in &found.front {
        assert!(candidate.values[0] <= 4.0 + 1e-9, "{:?}", candidate.values);
        assert!(candidate.measured.failing() < STARTS / 2);
    }
}

#[test]
fn a_front_has_larger_changes_only_for_fewer_failures_or_less_loss() {
    let found = searched(by_gap, |values| 1.0 + 0.01 * (values[0] - 2.0), 2);
    assert!(found.is_feasible);
    for pair in found.front.windows(2) {
        let failing = pair[1].measured.failing() < pair[0].measured.failing();
        let braking = |it: &EgoCandidate| it.measured.runs[0].as_ref().map(|run| run[0]);
        assert!(failing || braking(&pair[1]) < braking(&pair[0]), "{pair:?}");
    }
}

#[test]
fn most_candidates_are_played_on_the_fewest_starts_only() {
    let found = searched(by_gap, |_| 1.0, 0);
    // 121 candidates, of which a quarter is played on all starts, and those of shrinking.
    let all = 121 * STARTS;
    assert!(found.played < 3 * all / 4, "{} of {all}", found.played);
    assert!(found.all.len() < 70, "{}", found.all.len());
}

#[test]
fn a_stopped_search_returns_what_it_has_and_unknown_is_no_result() {
    let parameters = ["gap_s"].map(parameter);
    let own = EgoMeasurement {
        outcomes: vec![StartOutcome::Solved; 4],
        runs: vec![None; 4],
    };
    let conditions = Conditions {
        parameters: &parameters,
        losses: &[],
        own: &own,
        remaining: 0.1,
    };
    // An ego that did not run has neither failed nor withstood.
    let invalid = EgoCandidate {
        values: vec![5.0],
        measured: EgoMeasurement {
            outcomes: vec![StartOutcome::Invalid; 4],
            runs: vec![None; 4],
        },
        stages: 1,
    };
    assert!(!conditions.is_feasible(&invalid));
    assert_eq!(conditions.cost(&invalid), f64::INFINITY);
    static STOP: AtomicBool = AtomicBool::new(true);
    let watch = Watch::new(&|_, _| {}, &STOP);
    struct Stopped;
    impl Trial for Stopped {
        fn play(&self, _: &[f64], _: &Slice) -> Option<EgoMeasurement> {
            None
        }
    }
    let optimizer = Optimizer {
        conditions: &conditions,
        trial: &Stopped,
        slices: slices(4, 4),
        watch: &watch,
        seed: 0,
        round: 0,
        from: None,
    };
    assert!(optimizer.search().is_empty());
}

#[test]
fn rounds_of_neighbouring_seeds_draw_different_candidates() {
    let drawn = |seed: u64, round: usize| {
        let all = searched_in_round(by_gap, |_| 1.0, seed, round).all;
        all.into_iter().map(|it| it.values).collect::<Vec<_>>()
    };
    assert_eq!(drawn(0, 1), drawn(0, 1));
    assert_ne!(drawn(0, 1), drawn(1, 0));
    assert_ne!(drawn(0, 1), drawn(0, 0));
}

#[test]
fn stages_share_all_starts_and_runs() {
    let all = slices(60, 7);
    let ends = all.iter().map(|it| (it.starts.clone(), it.runs.clone()));
    assert_eq!(
        ends.collect::<Vec<_>>(),
        [(0..15, 0..2), (15..30, 2..4), (30..60, 4..7)]
    );
}
