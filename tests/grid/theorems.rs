//! Theorems 1 and 2, played from every start, and the faults that they notice.

use brakecheck::evaluation::TheoremsError;
use brakecheck::rl::{Control, LearnerRng, Policy};
use brakecheck::seed::Purpose;
use brakecheck::testbench::{Aftermath, Gym, Replay, play};
use brakecheck::world::{AtWall, Horizon};
use brakecheck::world::{GridChange, Scenario};
use brakecheck_evaluation::theorems::{
    Approximation, Theorem1, Theorem2, TheoremOutcome, grid_theorems, optimal_values, theorem_1,
    theorem_2,
};
use brakecheck_experiment::grid_solver::game_graph::{Depth, GameGraph};
use brakecheck_experiment::grid_solver::position_policy::PositionPolicy;
use brakecheck_experiment::grid_solver::values::{ValueTable, rewards};
use brakecheck_scene::scene::grid::position_of;

use super::{A, B, cells, changed, episode, exact, soonest, world};

/// A shipped world of n = 4 with another γ and K = `per_size` n.
fn grid(wall: AtWall, discount: f64, per_size: u32, judge: &str) -> Scenario {
    let text = (match wall {
        AtWall::Stays => include_str!("../../worlds/grid.ron"),
        AtWall::FirstInMap => include_str!("../../worlds/grid_hard.ron"),
    })
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

pub(super) fn values(scenario: &Scenario) -> ValueTable {
    optimal_values(cells(scenario)).unwrap_or_else(|error| panic!("{error}"))
}

/// The best ado, with V* of the starts as its values.
pub(super) fn converged(scenario: &Scenario) -> PositionPolicy {
    let (best, table) = (soonest(scenario), values(scenario));
    let seen = cells(scenario).fully_observed();
    let policy = PositionPolicy::new(cells(&seen).world(), |both| {
        let first = best.actions(both).first().copied().unwrap_or(0);
        (first, table.at(both).expect("a start"))
    });
    policy.unwrap_or_else(|error| panic!("{error}"))
}

/// An ado that has decided `decisions` times.
pub(super) fn trained(scenario: &Scenario, name: &str, decisions: u64) -> Box<dyn Policy> {
    let mut learner = (match name {
        "ppo" => scenario.learner(),
        other => &scenario.learners()[other],
    })
    .clone()
    .with_decisions(decisions)
    .expect("fits")
    .build(scenario.world().spaces(), 1);
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
                let table = values(&seen);
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
        let table = values(&seen);
        let checked = theorem_1(cells(&seen), &converged(&scenario), &table).expect("solved");
        assert!(!checked.is_refuted(), "{checked:?}");
        let missed = checked
            .rows
            .iter()
            .map(|row| row.pairs - row.optimal.printed);
        missed.sum::<u64>()
    };
    assert_eq!(printed(1.0), 0, "γ = 1: γ^T is the same everywhere");
    assert!(printed(0.8) > 0);
}

#[test]
fn theorem_1_says_nothing_of_an_untrained_ado() {
    let scenario = world(B);
    let table = values(&scenario);
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
    let truth = values(&seen);
    let other = |discount| exact(&seen, discount);
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
    let truth = values(&seen);
    let slower = exact(&seen, 0.95);
    for table in [slower, shuffled(&truth)] {
        let checked = theorem_1(cells(&seen), &policy, &table).expect("solved");
        assert!(checked.unpaid > 0.1, "{checked:?}");
    }
}

/// Value iteration on n = 5 that the stopping rule ends before it is exact.
fn truncated() -> (Scenario, ValueTable, ValueTable, f64) {
    let change = GridChange {
        size: Some(5),
        ..GridChange::default()
    };
    let scenario = changed(&grid(B, 0.5, 2, "UntilViolation"), change);
    let truth = values(&scenario);
    let (graph, alpha) = (truth.graph().clone(), 0.1);
    let (values, sweeps) = ValueTable::iterated(graph, 0.5, rewards(scenario.rulebook()), alpha);
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
    assert!(checked.alpha > 0.0 && checked.alpha <= alpha, "{checked:?}");
    assert_eq!(checked.outcome, TheoremOutcome::Holds, "{checked:?}");
    assert!(checked.rows.iter().any(|row| row.promising > 0));
}

#[test]
fn theorem_2_holds_for_the_values_of_a_converged_ado() {
    let scenario = cells(&grid(B, 0.8, 2, "UntilViolation")).fully_observed();
    let policy = converged(&scenario);
    let truth = values(&scenario);
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
    let graph = truth.graph().clone();
    let (other, _) = ValueTable::iterated(graph, 0.8, rewards(scenario.rulebook()), alpha);
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
    let truth = values(&scenario);
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
        assert!(size < 0.3 || checked.lost > 0.0, "{checked:?}");
    }
}

#[test]
fn a_formula_that_is_no_function_of_the_states_is_refused_by_name() {
    let text = include_str!("../../worlds/grid_jump.ron");
    let nested = "always[0, T] (eventually[0, 2] (ado.x >= 0))";
    let other = text.replace("always[0, T] (speed_inf <= 1.5)", nested);
    assert_ne!(text, other);
    let scenario = Scenario::parse("other.ron", &other).expect("a world");
    let error = optimal_values(cells(&scenario)).expect_err("not solvable");
    assert!(matches!(error, TheoremsError::NotSolved { .. }), "{error}");
    let named = "the rule `moves one cell at a time` cannot be judged from a state";
    assert!(error.to_string().contains(named), "{error}");
    let drawn = text.replace("starts: AllPairs", "starts: Uniform");
    let scenario = Scenario::parse("drawn.ron", &drawn).expect("a world");
    let (policy, table) = (converged(&scenario), values(&scenario));
    let error = theorem_1(cells(&scenario), &policy, &table).expect_err("no list");
    assert!(error.to_string().contains("no list of starts"), "{error}");
}

/// A world whose ado can jump, with the reward, the judge and γ = 0.8.
fn jumping(reward: &str, judge: &str) -> Scenario {
    let text = include_str!("../../worlds/grid_jump.ron");
    let tanh = "Tanh(rho_max: 50.0, scale: 10.0, jump: 0.5)";
    let text = text
        .replace(tanh, reward)
        .replace("judge: UntilViolation", &format!("judge: {judge}"));
    Scenario::parse("jump.ron", &text).unwrap_or_else(|error| panic!("{error}"))
}

/// The constraint half of Theorem 1: a jump would capture sooner and from more starts.
#[test]
fn theorem_1_holds_where_a_rule_forbids_the_best_moves() {
    for reward in [
        "Tanh()",
        "Tanh(jump: 0.0, scale: 2.0)",
        "Plain(rho_max: 50.0)",
    ] {
        for judge in ["UntilViolation", "WholeRun"] {
            let scenario = cells(&jumping(reward, judge)).fully_observed();
            let (policy, table) = (converged(&scenario), values(&scenario));
            let checked = theorem_1(cells(&scenario), &policy, &table).expect("solved");
            let at = format!("{reward}, {judge}: {checked:?}");
            assert!(checked.residual < 1e-12 && checked.unpaid < 1e-9, "{at}");
            assert_eq!((checked.found, checked.found_optimally), (204, 204), "{at}");
            assert_eq!(checked.rows[0].outcome, TheoremOutcome::Holds, "{at}");
            for row in &checked.rows {
                assert!(!row.outcome.is_refuted() && row.pairs > 0, "{at}");
                assert_eq!(row.optimal.holds, row.pairs, "{at}");
            }
        }
    }
}

/// An ado that is solved without its rules plays jumps, which Theorem 1 notices.
#[test]
fn theorem_1_fails_with_values_that_ignore_the_rules() {
    for (reward, judge) in [
        ("Tanh()", "UntilViolation"),
        ("Plain(rho_max: 50.0)", "WholeRun"),
    ] {
        let scenario = cells(&jumping(reward, judge)).fully_observed();
        let mut lawless = scenario.rulebook().clone();
        lawless.rules.clear();
        let graph = GameGraph::explore(cells(&scenario).world(), &lawless, Depth::Exact);
        let table = ValueTable::exact(graph.expect("solvable"), 0.8, rewards(&lawless));
        assert!(table.successes() > 204);
        let checked = theorem_1(cells(&scenario), &converged(&scenario), &table).expect("solved");
        assert!(checked.is_refuted(), "{checked:?}");
    }
}

/// The premise subtracts the mildest penalty: −1 under `Tanh`, and −ρ_max under `Plain`.
#[test]
fn the_premise_of_theorem_1_knows_the_penalty_of_the_reward() {
    for (reward, penalty) in [
        ("Tanh()", 1.0),
        ("Plain(rho_max: 50.0)", 50.0),
        ("Plain(rho_max: 1.2)", 1.2),
    ] {
        let scenario = cells(&jumping(reward, "UntilViolation")).fully_observed();
        let (policy, table) = (converged(&scenario), values(&scenario));
        let checked = theorem_1(cells(&scenario), &policy, &table).expect("solved");
        // Values above 0 are those of counterexamples: γ^T g(τ), with γ^T.
        let found: Vec<(f64, f64)> = table
            .graph()
            .starts()
            .map(|both| {
                let decisions = table.actions(both).len() as i32;
                (table.at(both).expect("a start"), 0.8f64.powi(decisions - 1))
            })
            .filter(|(value, _)| *value > 0.0)
            .collect();
        for row in &checked.rows {
            let json = serde_json::to_value(row).expect("numbers");
            let premise = |(value, weight): &&(f64, f64)| row.delta < value + penalty * weight;
            let in_premise = found.iter().filter(premise);
            assert_eq!(json["meets"], in_premise.count(), "{reward}, {row:?}");
        }
        assert_eq!(found.len(), 204);
    }
}

/// A rule that can only be broken at the end costs less than one at an early T.
#[test]
fn a_late_rule_violation_is_a_missing_premise_of_theorem_1_and_no_bug() {
    let text = include_str!("../../worlds/grid_jump.ron");
    let rules = "always[0, T] (speed_inf <= 1.5)\"), Rule(name: \"ends early\", stl: \"always[4, 4] (ado.y >= 5)";
    let text = text.replace("always[0, T] (speed_inf <= 1.5)", rules);
    let scenario =
        cells(&Scenario::parse("late.ron", &text).unwrap_or_else(|error| panic!("{error}")))
            .fully_observed();
    let (policy, table) = (converged(&scenario), values(&scenario));
    let checked = theorem_1(cells(&scenario), &policy, &table).expect("solved");
    assert!(
        !checked.is_refuted() && checked.unpaid < 1e-12,
        "{checked:?}"
    );
    let late: Vec<u64> = checked.rows.iter().map(|row| row.late).collect();
    assert_eq!(late[..2], [0, 0], "no foul is that near: {checked:?}");
    let widest = &checked.rows[3];
    assert!(widest.late > 0, "{checked:?}");
    assert_eq!(widest.optimal.holds + widest.late, widest.pairs);
    let TheoremOutcome::PremiseNotMet { why } = &widest.outcome else {
        panic!("{widest:?}");
    };
    assert!(why.contains("needs one T"), "{why}");
}

/// γ^T, R_T, whether the rules are kept and whether the ego fails, of every start.
fn played(scenario: &Scenario, policy: &dyn Policy) -> Vec<(f64, f64, bool, bool)> {
    let starts = scenario.starts().expect("a list");
    let gamma = scenario.learner().discount();
    let runs = starts.iter().map(|start| {
        let run = episode(scenario, start, policy);
        let reward = scenario.rulebook().reward_of(&run.verdict).expect("valid");
        let weight = gamma.powi(run.actions.len() as i32 - 1);
        (
            weight,
            reward,
            !run.verdict.is_foul(),
            run.verdict.is_success(),
        )
    });
    runs.collect()
}

/// Every count of both theorems, counted again from their definitions.
#[test]
fn the_counts_of_theorems_1_and_2_are_those_of_their_definitions() {
    let scenario = cells(&jumping("Tanh()", "UntilViolation")).fully_observed();
    let policy = trained(&scenario, "ppo", 4_000);
    let truth = values(&scenario);
    let arena = cells(&scenario).world().spec().arena;
    let all = scenario.starts().expect("a list");
    let of = |table: &ValueTable| -> Vec<f64> {
        let values = all.iter().map(|start| table.at(position_of(start, &arena)));
        values.map(|value| value.expect("a start")).collect()
    };
    let runs = played(&scenario, &*policy);
    let found = runs.iter().filter(|run| run.3).count();
    assert!(
        (20..200).contains(&found),
        "{found}: neither untrained nor converged"
    );
    let gamma = 0.8;
    let held = f64::powi(gamma, 3) * scenario.rulebook().reward.lawful(0.0);
    let paid = |i: usize| runs[i].0 * runs[i].1;
    let near = |values: &[f64], i: usize, j: usize| (values[i] - values[j]).abs();

    let checked = theorem_1(cells(&scenario), &*policy, &truth).expect("solved");
    assert_eq!(checked.found, found);
    let (best, mut missed) = (of(&truth), false);
    for row in &checked.rows {
        let json = serde_json::to_value(row).expect("numbers");
        let mut want = [0u64; 6];
        for here in 0..all.len() {
            let optimal = runs[here].3 && (paid(here) - best[here]).abs() < 1e-9;
            if !optimal || row.delta >= runs[here].0 * (runs[here].1 + 1.0) {
                continue;
            }
            want[0] += 1;
            want[1] += u64::from(held < best[here] - row.delta);
            for there in (0..all.len()).filter(|j| near(&best, here, *j) < row.delta) {
                let run = runs[there];
                want[2] += 1;
                let least = best[here] - row.delta - 1e-9;
                want[3] += u64::from(run.2 && least <= paid(there));
                let printed = runs[here].1 - row.delta / runs[here].0 - 1e-9;
                want[4] += u64::from(run.2 && printed <= run.1);
                want[5] += u64::from(run.3);
            }
        }
        let learned = &json["learned"];
        let have = [
            &json["meets"],
            &json["promising"],
            &json["pairs"],
            &learned["holds"],
            &learned["printed"],
            &learned["counterexamples"],
        ];
        assert_eq!(
            have.map(|count| count.as_u64().expect("a count")),
            want,
            "δ = {}",
            row.delta
        );
        assert!(want[2] > 0 && want[5] < want[2], "{want:?}");
        missed |= want[3] < want[2];
    }

    assert!(missed, "the trained ado reaches every bound");

    let learned = truth.learned(cells(&scenario).world(), &*policy);
    let approximation = Approximation {
        values: &learned,
        certified: None,
        policy: Some(&*policy),
    };
    let checked = theorem_2(cells(&scenario), &truth, &approximation).expect("solved");
    assert_eq!(checked.found, found);
    let ours = of(&learned);
    let off = ours
        .iter()
        .zip(&best)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!((checked.alpha_of_starts - off).abs() < 1e-12 && checked.alpha >= off);
    let later: f64 = (1..4).map(|t| f64::powi(gamma, t)).sum();
    assert!((checked.loss - 2.0 * checked.alpha_ahead * later).abs() < 1e-12);
    let greedy: Vec<f64> = all
        .iter()
        .map(|start| {
            let actions = learned.actions(position_of(start, &arena));
            let mut ado = Replay::holding(&actions);
            let run = play(&mut scenario.bench(), start, 0, &mut ado, Aftermath::Skip);
            let reward = scenario.rulebook().reward_of(&run.verdict).expect("valid");
            f64::powi(gamma, run.actions.len() as i32 - 1) * reward
        })
        .collect();
    let lost = best.iter().zip(&greedy).map(|(best, paid)| best - paid);
    assert!((checked.lost - lost.fold(0.0, f64::max)).abs() < 1e-12);
    let held_now = scenario.rulebook().reward.lawful(0.0);
    for row in &checked.rows {
        let json = serde_json::to_value(row).expect("numbers");
        let beta = json["beta"].as_f64().expect("a number");
        let spent = 2.0 * off + beta;
        let mut want = [0u64; 4];
        for here in (0..all.len()).filter(|i| runs[*i].3) {
            let bound = paid(here) - spent - checked.loss;
            let printed = runs[here].1 - spent / runs[here].0;
            for there in (0..all.len()).filter(|j| near(&ours, here, *j) <= beta) {
                let run = runs[there];
                want[0] += 1;
                want[1] += u64::from(held < bound);
                want[2] += u64::from(held_now < printed);
                want[3] += u64::from(!(run.2 && printed - 1e-9 <= run.1));
            }
        }
        let have = ["pairs", "promising", "printed_promising", "printed_misses"]
            .map(|name| json[name].as_u64().expect("a count"));
        assert_eq!(have, want, "β = {beta}");
        assert!(want[0] > 0 && row.misses == 0, "{row:?}");
    }
}

#[test]
fn the_checks_of_a_trained_ado_play_that_ado_and_compare_every_grid() {
    let scenario = cells(&jumping("Tanh()", "UntilViolation")).fully_observed();
    let policy = trained(&scenario, "ppo", 4_000);
    let finer = GridChange {
        refine: Some(3),
        ego_step: Some(6),
        ..GridChange::default()
    };
    let larger = GridChange {
        size: Some(5),
        ..GridChange::default()
    };
    let others = [
        ("finer".to_owned(), changed(&scenario, finer)),
        ("larger".to_owned(), changed(&scenario, larger)),
    ];
    let checked = grid_theorems(cells(&scenario), &*policy, &others).expect("solved");
    let json = serde_json::to_value(&checked).expect("numbers");
    let found = played(&scenario, &*policy)
        .iter()
        .filter(|run| run.3)
        .count();
    let best = soonest(&scenario).successes();
    assert!(found < best, "{found}");
    // Greedy play of its values is another ado.
    assert_eq!(json["theorem_2_learned"]["found"], found);
    assert_eq!(json["theorem_1"]["found"], found);
    assert_eq!(json["theorem_2"]["found"], best);
    // V_k is not V*, so the bound could fail.
    let alpha = json["theorem_2"]["alpha"].as_f64().expect("a number");
    assert!(alpha > 0.0 && alpha <= 0.01, "{alpha}");
    assert_eq!(json["theorem_2"]["outcome"]["is"], "holds");
    // Distances are multiples of 1/3: two of them are below τ = 0.5.
    let rows = json["theorem_3"].as_array().expect("rows");
    let epsilons: Vec<f64> = rows
        .iter()
        .filter_map(|row| row["epsilon"].as_f64())
        .collect();
    assert_eq!(epsilons, [0.0, 1.0 / 3.0]);
    assert_eq!(json["not_comparable"], serde_json::json!(["larger"]));
    assert_eq!(json["unchecked"], serde_json::json!([]));
    assert!(!checked.is_refuted());
}
