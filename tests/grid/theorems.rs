//! Theorems 1 and 2, checked against the exact V*.

use brakecheck::campaign::{TheoremsError, nearby_starts, optimal_values};
use brakecheck::rl::Control;
use brakecheck::scenario::{GridChange, Scenario};
use brakecheck::scene::grid::Horizon;
use brakecheck::seed::Purpose;
use brakecheck::testbench::Gym;

use super::{A, B, changed, world};

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
            // V* is what its continuation, played and judged, is paid.
            let values = optimal_values(&changed(&world(wall), change)).expect("solved");
            let mut pairs = 0;
            for here in values.iter().filter(|value| 0.0 < **value) {
                for paid in &values {
                    let delta = (here - paid).abs() + 1e-9;
                    if delta < here + 1.0 {
                        pairs += 1;
                        assert!(here - delta <= *paid, "{wall:?}: {here} {paid}");
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
    let config = &scenario.learners()["q"];
    let mut learner = config.build(scenario.world().spaces(), 1);
    let mut gym = Gym::new(scenario.bench(), Purpose::Train, 1);
    learner.train(&mut gym, &mut |_| Control::Continue);
    let nearby = nearby_starts(&scenario, &*learner.policy()).expect("solved");
    println!("α = {:.3}", nearby.alpha);
    assert!(
        nearby.alpha < 0.6,
        "γ < 1 discounts by at most the steps to the capture: {}",
        nearby.alpha
    );
    assert_eq!((nearby.starts, nearby.counterexamples), (240, 240));
    assert_eq!((nearby.pairs, nearby.misses), (240 * 240, 0));
    assert!(0 < nearby.pairs_of_2, "the theorem is not vacuous");
    assert_eq!(nearby.misses_of_2, 0);
}

#[test]
fn a_specification_that_the_solver_does_not_know_is_refused() {
    let text = include_str!("../../worlds/grid_hard.ron");
    let other = text.replace("(d_man >= 1)", "(d_man >= 0.5)");
    assert_ne!(text, other);
    let scenario = Scenario::parse("other.ron", &other).expect("a world");
    let error = optimal_values(&scenario).expect_err("not the solved one");
    assert!(matches!(error, TheoremsError::NotSolved { .. }), "{error}");
}
