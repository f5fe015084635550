//! The exact solver against every sequence of actions, played on the test bench.

use brakecheck::rulebook::Verdict;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Episode, Replay, Testbench, play};
use brakecheck::world::Scenario;
use brakecheck_experiment::grid_solver::game_graph::{Depth, GameGraph};
use brakecheck_experiment::grid_solver::position_policy::{NoOptimalPolicy, PositionPolicy};
use brakecheck_scene::scene::grid::{Position, position_of};

use super::{captures, cells, exact, soonest};

const JUMP: &str = include_str!("../../worlds/grid_jump.ron");
const SHIPPED_RULE: &str = r#"Rule(name: "unit", stl: "always[0, T] (speed_inf <= 1.5)")"#;
const GAMMA: f64 = 0.8;

/// A small grid whose ado steps by one or two cells along x, up, or stays.
#[derive(Clone, Copy)]
struct Small {
    spec: &'static str,
    rules: &'static str,
    judge: &'static str,
    reward: &'static str,
    steps: usize,
    /// Least Manhattan distance of a start.
    apart: i32,
}

const SMALL: Small = Small {
    spec: "always[0, T] (d_man >= 1)",
    rules: SHIPPED_RULE,
    judge: "UntilViolation",
    reward: "Tanh()",
    steps: 4,
    apart: 1,
};

impl Small {
    fn world(&self) -> Scenario {
        let (first, last) = ("map: (size: 4", "    starts: AllPairs");
        let head = &JUMP[..JUMP.find(first).expect("a map")];
        assert!(JUMP.contains(last));
        let all = (0..81).map(|i| ((i % 3, i / 3 % 3), (i / 9 % 3, i / 27)));
        let apart = |((a, b), (c, d)): &((i32, i32), (i32, i32))| {
            (a - c).abs() + (b - d).abs() >= self.apart
        };
        let starts: Vec<_> = all.filter(apart).collect();
        let Small {
            spec,
            rules,
            judge,
            reward,
            steps,
            ..
        } = self;
        let text = format!(
            "{head}map: (size: 3), horizon: Steps({steps}), judge: {judge}, \
             ego: Flees(step: 1, at_wall: FirstInMap), \
             ado: (moves: [(-1, 0), (1, 0), (2, 0), (0, 1), (0, 0)], neutral: 4, \
             observe: [\"away.x\", \"away.y\", \"ego.left\", \"ego.down\", \"time_left\"], \
             rulebook: [{rules}]), starts: Pairs({starts:?}), ego_spec: \"{spec}\", \
             reward: {reward}, learner: Ppo(decisions: 100, discount: {GAMMA:?}))"
        );
        Scenario::parse("small.ron", &text).unwrap_or_else(|error| panic!("{error}"))
    }
}

fn paid(scenario: &Scenario, run: &Episode) -> f64 {
    let reward = scenario.rulebook().reward_of(&run.verdict).expect("valid");
    GAMMA.powi(run.actions.len().saturating_sub(1) as i32) * reward
}

/// The largest γ^T R_T of all sequences, and the number of decisions to the soonest success.
fn best_played(scenario: &Scenario, bench: &mut Testbench, start: &Start) -> (f64, Option<usize>) {
    let (actions, steps) = (bench.spaces().actions, bench.clock().decisions());
    let (mut most, mut soonest) = (f64::NEG_INFINITY, None);
    for code in 0..actions.pow(steps as u32) {
        let sequence: Vec<usize> = (0..steps)
            .map(|step| code / actions.pow(step as u32) % actions)
            .collect();
        let run = play(
            bench,
            start,
            0,
            &mut Replay::holding(&sequence),
            Aftermath::Skip,
        );
        most = most.max(paid(scenario, &run));
        if run.verdict.is_success() {
            let decisions = run.actions.len();
            soonest = Some(soonest.map_or(decisions, |least: usize| least.min(decisions)));
        }
    }
    (most, soonest)
}

/// Rules, specifications, judges and rewards that the solver must know.
fn variants() -> Vec<Small> {
    let two = r#"Rule(name: "right half", stl: "always[1, T] (ado.x <= 1.5)"), Rule(name: "unit", stl: "always[0, T] (speed_inf <= 1.5)")"#;
    let temporal = r#"Rule(name: "goes up", stl: "eventually[0, 2] (ado.y >= 1.5)")"#;
    let until = r#"Rule(name: "waits", stl: "(speed_inf <= 0.5) unless (d_man <= 2.5)")"#;
    let past = r#"Rule(name: "jumps first", stl: "always[1, T] (speed_inf <= 1.5 or historically (d_man >= 1.5))")"#;
    let timed =
        r#"Rule(name: "late jumps", stl: "always[0, T] (speed_inf <= 1.5 or time_left <= 1.5)")"#;
    let ranked = r#"Rule(name: "a", stl: "always[1, 2] (ado.x <= 1.5)"), Rule(name: "b", stl: "always[2, T] (ado.x >= 0.5)"), Rule(name: "c", stl: "always[0, T] (speed_inf <= 0.5)")"#;
    let rules = [SHIPPED_RULE, two, temporal, until, past, timed, ranked];
    let mut all: Vec<Small> = rules.map(|rules| Small { rules, ..SMALL }).into();
    for judge in ["UntilViolation", "WholeRun"] {
        for (spec, apart) in [
            ("always[0, T] (d_man >= 2)", 2),
            ("not eventually[0, 3] (d_man <= 1.5)", 2),
            ("eventually[0, T] (d_man >= 2.5)", 1),
            ("always[0, T] (d_man >= 0.5)", 1),
        ] {
            all.push(Small {
                spec,
                apart,
                judge,
                steps: 3,
                ..SMALL
            });
        }
        for rules in [two, ranked, temporal] {
            all.push(Small {
                rules,
                judge,
                steps: 3,
                ..SMALL
            });
        }
        for reward in [
            "Plain(rho_max: 50.0)",
            "Plain(rho_max: 1.2)",
            "Tanh(jump: 0.0, scale: 2.0, foul_span: 0.5)",
        ] {
            all.push(Small {
                rules: ranked,
                reward,
                judge,
                steps: 3,
                ..SMALL
            });
        }
    }
    all
}

#[test]
fn no_sequence_of_actions_is_paid_more_than_the_solver_says() {
    let mut decided = [0; 3];
    for small in variants() {
        let world = small.world();
        let arena = cells(&world).world().spec().arena;
        let (table, first) = (exact(&world, GAMMA), soonest(&world));
        let mut bench = world.bench();
        let starts = world.starts().expect("a list");
        for start in starts.iter().step_by(5) {
            let both = position_of(start, &arena);
            let at = format!(
                "{both:?} of {}, {}, {}, {}",
                small.spec, small.rules, small.judge, small.reward
            );
            let (most, decisions) = best_played(&world, &mut bench, start);
            let value = table.at(both).expect("a start");
            assert!(
                (value - most).abs() < 1e-12,
                "{value} is not {most} at {at}"
            );
            let actions = table.actions(both);
            let mut ado = Replay::holding(&actions);
            let run = play(&mut bench, start, 0, &mut ado, Aftermath::Skip);
            assert!((paid(&world, &run) - value).abs() < 1e-12, "greedy at {at}");
            // The merged states lose margins, and neither verdicts nor times.
            let sooner = first.actions(both);
            let run = play(
                &mut bench,
                start,
                0,
                &mut Replay::holding(&sooner),
                Aftermath::Skip,
            );
            let taken = run.verdict.is_success().then_some(run.actions.len());
            assert_eq!(taken, decisions, "soonest at {at}");
            assert_eq!(sooner.len(), run.actions.len(), "{at}");
            let positive = first.at(both).expect("a start") > 0.0;
            assert_eq!(positive, decisions.is_some(), "{at}");
            decided[match run.verdict {
                Verdict::Counterexample { .. } => 0,
                Verdict::Foul { .. } => 1,
                _ => 2,
            }] += 1;
        }
    }
    // Some starts leave the ado no lawful action, and some no success.
    assert!(decided.iter().all(|count| *count > 20), "{decided:?}");
}

#[test]
fn the_optimal_policy_plays_what_was_solved_or_is_refused() {
    let mut refused = 0;
    for small in variants() {
        let world = cells(&small.world()).fully_observed();
        match PositionPolicy::optimal(cells(&world).world(), world.rulebook()) {
            Ok(policy) => {
                let best = soonest(&world).successes();
                assert_eq!(captures(&world, &policy), best, "{}", small.rules);
            }
            // Positions and time do not tell what the ado did before.
            Err(error) => {
                assert!(matches!(error, NoOptimalPolicy::Indistinct(_)), "{error}");
                refused += 1;
            }
        }
    }
    assert!(refused < 8, "{refused} of {}", variants().len());
}

#[test]
fn the_shipped_ado_that_can_jump_is_solved_without_jumps() {
    let world = Scenario::shipped("grid_jump")
        .expect("shipped")
        .expect("sound");
    let lawful = soonest(&world);
    assert_eq!(
        (lawful.successes(), lawful.graph().starts().count()),
        (204, 240)
    );
    let seen = cells(&world).fully_observed();
    let policy = PositionPolicy::optimal(cells(&seen).world(), seen.rulebook()).expect("solved");
    let starts = seen.starts().expect("a list");
    let runs = starts
        .iter()
        .map(|start| super::episode(&seen, start, &policy));
    let fouls = runs.filter(|run| run.verdict.is_foul()).count();
    assert_eq!((captures(&seen, &policy), fouls), (204, 0));
}

#[test]
fn an_observation_that_hides_the_best_action_is_refused() {
    let text = JUMP.replace(
        "[\"away.x\", \"away.y\", \"ego.left\", \"ego.down\", \"time_left\"]",
        "[\"away.x\", \"time_left\"]",
    );
    let world = Scenario::parse("blind.ron", &text).expect("sound");
    let policy = PositionPolicy::optimal(cells(&world).world(), world.rulebook());
    assert!(matches!(policy, Err(NoOptimalPolicy::Indistinct(_))));
}

#[test]
fn a_game_without_a_list_of_starts_that_is_too_large_is_refused_before_it_is_explored() {
    let text = JUMP
        .replace("map: (size: 4", "map: (size: 100")
        .replace("AllPairs", "Uniform")
        .split("    reuse:")
        .next()
        .expect("a world")
        .to_owned()
        + ")";
    let world = Scenario::parse("large.ron", &text).unwrap_or_else(|error| panic!("{error}"));
    let admitted = GameGraph::admits(cells(&world).world(), world.rulebook());
    let error = admitted.expect_err("10⁸ starts").to_string();
    assert!(error.contains("more than 60000000 transitions"), "{error}");
    // Of 60⁴ pairs of fine cells with five actions, a third is no start.
    let fine = text
        .replace("map: (size: 100, refine: 1)", "map: (size: 2, refine: 30)")
        .replace("(0, 2), (0, -2), (-2, 0), (2, 0), ", "")
        .replace("neutral: 8", "neutral: 4");
    let fine = Scenario::parse("fine.ron", &fine).unwrap_or_else(|error| panic!("{error}"));
    let (grid, actions) = (cells(&fine), 5);
    assert_eq!(GameGraph::admits(grid.world(), fine.rulebook()), Ok(()));
    assert_eq!(grid.world().spec().moves.len(), actions);
    assert!(grid.world().spec().arena.cells().pow(2) * actions > 60_000_000);
    let unknown = Position {
        ego: cells(&world).world().spec().arena.cell(0),
        ado: cells(&world).world().spec().arena.cell(1),
    };
    let small = SMALL.world();
    let graph = GameGraph::explore_from(
        cells(&small).world(),
        small.rulebook(),
        Depth::Sign,
        [].into_iter(),
    )
    .expect("small");
    assert_eq!(
        brakecheck_experiment::grid_solver::values::ValueTable::soonest(graph).at(unknown),
        None
    );
}
