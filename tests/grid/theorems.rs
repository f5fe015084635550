//! Theorems 1 and 2, played from every start, and the faults that they notice.

use brakecheck::evaluation::TheoremsError;
use brakecheck::rl::{Control, LearnerRng, Policy};
use brakecheck::seed::Purpose;
use brakecheck::testbench::Gym;
use brakecheck::world::{AtWall, Horizon};
use brakecheck::world::{GridChange, Scenario};
use brakecheck_evaluation::theorems::{
    Approximation, Theorem1, Theorem2, TheoremOutcome, grid_theorems, optimal_values, theorem_1,
    theorem_2,
};
use brakecheck_scene::grid_solver::exact::{Game, PositionPolicy};
use brakecheck_scene::grid_solver::values::ValueTable;

use super::{A, B, cells, changed, world};

/// A shipped world of n = 4 with another γ and K = `per_size` n.
fn grid(wall: AtWall, discount: f64, per_size: u32, judge: &str) -> Scenario {
    let text = match wall {
        AtWall::Stays => include_str!("../../worlds/grid.ron"),
        AtWall::FirstInMap => include_str!("../../worlds/grid_hard.ron"),
    };
    let text = text
        .replace("discount: 0.8", &format!("discount: {discount:?}"))
        .replace("judge: UntilViolation", &format!("judge: {judge}"));
    let scenario = Scenario::parse("grid.ron", &text).unwrap_or_else(|error| panic!("{error}"));
    let horizon = Some(Horizon::PerSize(per_size));
    changed(
        &scenario,
        GridChange {
            horizon,
            ..GridChange::default()
        },
    )
}

/// The best ado, with V* of the starts as its values.
pub(super) fn converged(scenario: &Scenario) -> PositionPolicy {
    let best = Game::of(cells(scenario).world()).solve();
    let table = optimal_values(cells(scenario));
    let seen = cells(scenario).fully_observed();
    let policy = PositionPolicy::new(cells(&seen).world(), |both| {
        (best.act(both), table.at(both))
    });
    policy.unwrap_or_else(|error| panic!("{error}"))
}

/// An ado that has decided `decisions` times.
pub(super) fn trained(scenario: &Scenario, name: &str, decisions: u64) -> Box<dyn Policy> {
    let learner = match name {
        "ppo" => scenario.learner(),
        other => &scenario.learners()[other],
    };
    let learner = learner.clone().with_decisions(decisions).expect("fits");
    let mut learner = learner.build(scenario.world().spaces(), 1);
    let mut gym = Gym::new(scenario.bench(), Purpose::Train, 1);
    learner.train(&mut gym, &mut |_| Control::Continue);
    learner.policy()
}

/// The values of every number of steps left, among the pairs in random order.
fn shuffled(table: &ValueTable) -> ValueTable {
    let mut dice = LearnerRng::new(1);
    let mut layers = vec![Vec::new(); table.game().steps as usize + 1];
    let _ = table.replaced(|left, _, value| {
        layers[left as usize].push(value);
        value
    });
    layers.iter_mut().for_each(|layer| dice.shuffle(layer));
    table.replaced(|left, _, value| layers[left as usize].pop().unwrap_or(value))
}

fn no_learned_outcome_holds(checked: &Theorem1) {
    for row in &checked.rows {
        assert_ne!(row.outcome_of_learned, TheoremOutcome::Holds, "{row:?}");
    }
}

#[test]
fn theorem_1_holds_by_play_for_both_walls_horizons_and_judges() {
    for wall in [A, B] {
        for per_size in [1, 2] {
            for judge in ["UntilViolation", "WholeRun"] {
                let scenario = grid(wall, 0.8, per_size, judge);
                let seen = cells(&scenario).fully_observed();
                let policy = converged(&scenario);
                let table = optimal_values(cells(&seen));
                let checked = theorem_1(cells(&seen), &policy, &table).expect("solved");
                let at = format!("{wall:?}, K = {per_size}n, {judge}: {checked:?}");
                assert!(checked.residual < 1e-12 && checked.unpaid < 1e-12, "{at}");
                assert_eq!(checked.found, checked.found_optimally, "{at}");
                let row = &checked.rows[0];
                assert_eq!(row.outcome, TheoremOutcome::Holds, "{at}");
                assert_eq!(row.outcome_of_learned, TheoremOutcome::Holds, "{at}");
                for row in &checked.rows {
                    assert_eq!(row.optimal.holds, row.pairs, "{at}");
                }
            }
        }
    }
}

/// The printed bound takes one T for all starts. With a capture at T = 0 and none
/// within K = n, it promises what even the optimal continuation does not do.
#[test]
fn the_printed_bound_of_theorem_1_needs_one_t_for_all_starts() {
    let printed = |discount: f64| {
        let scenario = grid(A, discount, 1, "UntilViolation");
        let seen = cells(&scenario).fully_observed();
        let table = optimal_values(cells(&seen));
        let checked = theorem_1(cells(&seen), &converged(&scenario), &table).expect("solved");
        assert!(!checked.is_refuted(), "{checked:?}");
        let missed = checked
            .rows
            .iter()
            .map(|row| row.pairs - row.optimal.printed);
        missed.sum::<u64>()
    };
    assert_eq!(printed(1.0), 0, "γ = 1: γ^T is the same everywhere");
    assert!(0 < printed(0.8));
}

#[test]
fn theorem_1_says_nothing_of_an_untrained_ado() {
    let scenario = world(B);
    let table = optimal_values(cells(&scenario));
    let untrained = trained(&scenario, "ppo", 50);
    let checked = theorem_1(cells(&scenario), &*untrained, &table).expect("solved");
    no_learned_outcome_holds(&checked);
    let all = grid_theorems(cells(&scenario), &*untrained, &[]).expect("solved");
    let outcome = &all.theorem_2_learned.outcome;
    assert!(
        matches!(outcome, TheoremOutcome::PremiseNotMet { .. }),
        "{outcome:?}"
    );
}

#[test]
fn theorem_1_fails_with_a_wrong_discount_or_with_shuffled_or_equal_values() {
    let scenario = grid(B, 0.8, 2, "UntilViolation");
    let seen = cells(&scenario).fully_observed();
    let policy = converged(&scenario);
    let truth = optimal_values(cells(&seen));
    let reward = scenario.rulebook().reward;
    let other = |discount| ValueTable::exact(truth.game(), discount, |rho| reward.lawful(rho));
    let faults = [
        ("γ = 0.5", other(0.5)),
        ("γ = 0.95", other(0.95)),
        ("γ = 1", other(1.0)),
        ("shuffled", shuffled(&truth)),
        (
            "all equal: every start is near",
            truth.replaced(|_, _, _| 0.5),
        ),
    ];
    for (fault, table) in faults {
        let checked = theorem_1(cells(&seen), &policy, &table).expect("solved");
        assert!(checked.is_refuted(), "{fault}: {checked:?}");
        no_learned_outcome_holds(&checked);
    }
}

/// A wrong γ or shuffled values are seen in what is played alone, too.
#[test]
fn planted_values_are_not_what_their_greedy_policy_is_paid() {
    let seen = cells(&grid(B, 0.8, 2, "UntilViolation")).fully_observed();
    let policy = converged(&seen);
    let truth = optimal_values(cells(&seen));
    let reward = seen.rulebook().reward;
    let slower = ValueTable::exact(truth.game(), 0.95, |rho| reward.lawful(rho));
    for table in [slower, shuffled(&truth)] {
        let checked = theorem_1(cells(&seen), &policy, &table).expect("solved");
        assert!(0.1 < checked.unpaid, "{checked:?}");
    }
}

/// Value iteration on n = 5 that the stopping rule ends before it is exact.
fn truncated() -> (Scenario, ValueTable, ValueTable, f64) {
    let change = GridChange {
        size: Some(5),
        ..GridChange::default()
    };
    let scenario = changed(&grid(B, 0.5, 2, "UntilViolation"), change);
    let truth = optimal_values(cells(&scenario));
    let reward = scenario.rulebook().reward;
    let alpha = 0.1;
    let lawful = |rho: f64| reward.lawful(rho);
    let (values, sweeps) = ValueTable::iterated(truth.game(), 0.5, lawful, alpha);
    assert!(sweeps < truth.game().steps as usize, "{sweeps} sweeps");
    (scenario, truth, values, alpha)
}

fn certified(scenario: &Scenario, truth: &ValueTable, values: &ValueTable, alpha: f64) -> Theorem2 {
    let approximation = Approximation {
        values,
        certified: Some(alpha),
        policy: None,
    };
    theorem_2(cells(scenario), truth, &approximation).expect("solved")
}

#[test]
fn theorem_2_holds_by_play_for_truncated_value_iteration() {
    let (scenario, truth, values, alpha) = truncated();
    let checked = certified(&scenario, &truth, &values, alpha);
    assert!(0.0 < checked.alpha && checked.alpha <= alpha, "{checked:?}");
    assert_eq!(checked.outcome, TheoremOutcome::Holds, "{checked:?}");
    assert!(checked.rows.iter().any(|row| 0 < row.promising));
}

#[test]
fn theorem_2_holds_for_the_values_of_a_converged_ado() {
    let scenario = cells(&grid(B, 0.8, 2, "UntilViolation")).fully_observed();
    let policy = converged(&scenario);
    let truth = optimal_values(cells(&scenario));
    let learned = truth.learned(cells(&scenario).world(), &policy);
    let approximation = Approximation {
        values: &learned,
        certified: None,
        policy: Some(&policy),
    };
    let checked = theorem_2(cells(&scenario), &truth, &approximation).expect("solved");
    assert_eq!(checked.outcome, TheoremOutcome::Holds, "{checked:?}");
}

#[test]
fn theorem_2_fails_with_a_wrong_discount_or_with_shuffled_values() {
    let (scenario, truth, values, alpha) = truncated();
    let reward = scenario.rulebook().reward;
    let lawful = |rho: f64| reward.lawful(rho);
    let (other, _) = ValueTable::iterated(truth.game(), 0.8, lawful, alpha);
    for (fault, values) in [("γ = 0.8", other), ("shuffled", shuffled(&values))] {
        let checked = certified(&scenario, &truth, &values, alpha);
        assert!(checked.outcome.is_refuted(), "{fault}: {checked:?}");
        // Without the certificate α is measured, and promises nothing.
        let measured = Approximation {
            values: &values,
            certified: None,
            policy: None,
        };
        let checked = theorem_2(cells(&scenario), &truth, &measured).expect("solved");
        let promised: u64 = checked.rows.iter().map(|row| row.misses).sum();
        assert_eq!(promised, 0, "{fault}: {checked:?}");
        assert_ne!(checked.outcome, TheoremOutcome::Holds, "{fault}");
    }
}

/// The greedy policy of V_k, one-step lookahead in the model, loses no more than
/// 2α (γ + … + γ^(K−1)), whatever V_k is.
#[test]
fn the_greedy_bound_of_theorem_2_holds_for_disturbed_values() {
    let scenario = grid(B, 0.6, 2, "UntilViolation");
    let truth = optimal_values(cells(&scenario));
    for (seed, size) in (0..).zip([0.01, 0.03, 0.1, 0.3]) {
        let mut dice = LearnerRng::new(seed);
        let noisy = truth.replaced(|_, _, value| value + size * (2.0 * dice.unit() - 1.0));
        let measured = Approximation {
            values: &noisy,
            certified: None,
            policy: None,
        };
        let checked = theorem_2(cells(&scenario), &truth, &measured).expect("solved");
        assert!(!checked.outcome.is_refuted(), "{checked:?}");
        assert!(checked.lost <= checked.loss, "{checked:?}");
        assert!(size < 0.3 || 0.0 < checked.lost, "{checked:?}");
    }
}

#[test]
fn a_specification_that_the_solver_does_not_know_is_refused() {
    let text = include_str!("../../worlds/grid_hard.ron");
    let other = text.replace("(d_man >= 1)", "(d_man >= 0.5)");
    assert_ne!(text, other);
    let scenario = Scenario::parse("other.ron", &other).expect("a world");
    let table = optimal_values(cells(&scenario));
    let error = theorem_1(cells(&scenario), &*trained(&scenario, "ppo", 50), &table);
    let error = error.expect_err("not the solved one");
    assert!(matches!(error, TheoremsError::NotSolved { .. }), "{error}");
}
