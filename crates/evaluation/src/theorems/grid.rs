//! Theorems 1 to 3 on a grid world for a trained ado.

use serde::Serialize;

use super::TheoremsError;
use super::bisimilar::{Theorem3, bisimulations, theorem_3};
use super::nearby::{Approximation, Theorem1, Theorem2, theorem_1, theorem_2};
use super::plays::not_solved;
use crate::grid_solver::game_graph::{Depth, GameGraph};
use crate::grid_solver::values::{ValueTable, rewards};
use crate::rl::Policy;
use crate::stl::Monitor;
use crate::world::{GridScenario, Scenario};

/// α of Theorem 2, half for the stopping rule of value iteration and half for rounding.
const ALPHA: f64 = 0.01;
/// Smallest τ of the shipped rules.
///
/// A unit move keeps `speed_inf <= 1.5` with this margin.
const TAU: f64 = 0.5;

/// Signals that a bisimulation compares.
const COVERED: [&str; 6] = ["ego.x", "ego.y", "ado.x", "ado.y", "d_man", "speed_inf"];

/// Results of all checks on a grid.
#[derive(Clone, Debug, Serialize)]
pub struct GridTheorems {
    /// Theorem 1, with V* from backward induction.
    pub theorem_1: Theorem1,
    /// Sweeps of value iteration up to the stopping rule.
    pub sweeps: usize,
    /// Theorem 2 for value iteration, truncated and rounded.
    pub theorem_2: Theorem2,
    /// Theorem 2 for the values of the trained ado.
    pub theorem_2_learned: Theorem2,
    /// Definition 5 and Theorem 3, by changed grid and ε.
    pub theorem_3: Vec<Theorem3>,
    /// Changed grids that cannot be compared: of another size, or with formulas on other
    /// signals than those of the distance.
    pub not_comparable: Vec<String>,
    /// Comparable changed grids on which no relation was checked, by a bug.
    pub unchecked: Vec<String>,
}

/// Checks Theorems 1 to 3 for the trained ado `policy`.
///
/// # Errors
/// Returns an error if the world has an unsupported specification.
pub fn grid_theorems(
    scenario: GridScenario<'_>,
    policy: &dyn Policy,
    changed: &[(String, Scenario)],
) -> Result<GridTheorems, TheoremsError> {
    let truth = optimal_values(scenario)?;
    let (graph, reward) = (truth.graph().clone(), rewards(scenario.rulebook()));
    let (iterated, sweeps) = ValueTable::iterated(graph, truth.discount(), reward, ALPHA / 2.0);
    // K sweeps are exact, so V_k is V* unless it is rounded, and α would be 0.
    let rounded = iterated.replaced(|_, _, value| (value / ALPHA).round() * ALPHA);
    // The stopping rule and the rounding certify their α, and the learned values have no
    // such certificate.
    let by_sweeps = Approximation {
        values: &rounded,
        certified: Some(ALPHA),
        policy: None,
    };
    // The learned values are read from the policy at the states of the exact table.
    let values = truth.learned(scenario.world(), policy);
    let learned = Approximation {
        values: &values,
        certified: None,
        policy: Some(policy),
    };
    let (mut rows, mut not_comparable, mut unchecked) = (Vec::new(), Vec::new(), Vec::new());
    for (name, changed) in changed {
        // A change keeps the kind of the world.
        let changed = changed.grid().filter(|changed| is_covered(*changed));
        let relations = changed.and_then(|changed| bisimulations(scenario, changed, TAU));
        let (Some(changed), Some(relations)) = (changed, relations) else {
            not_comparable.push(name.clone());
            // Refusal of one change must not hide the results of the others.
            continue;
        };
        if relations.is_empty() {
            // Equal grids have equal states, so no relation at all checks nothing.
            unchecked.push(name.clone());
        }
        for relation in &relations {
            rows.push(theorem_3(scenario, name, changed, policy, relation)?);
        }
    }
    Ok(GridTheorems {
        theorem_1: theorem_1(scenario, policy, &truth)?,
        sweeps,
        theorem_2: theorem_2(scenario, &truth, &by_sweeps)?,
        theorem_2_learned: theorem_2(scenario, &truth, &learned)?,
        theorem_3: rows,
        not_comparable,
        unchecked,
    })
}

/// Returns V* of a grid world with its rules, under the discount of its learner.
///
/// # Errors
/// The world cannot be solved.
pub fn optimal_values(scenario: GridScenario<'_>) -> Result<ValueTable, TheoremsError> {
    let graph = GameGraph::explore(scenario.world(), scenario.rulebook(), Depth::Exact)
        .map_err(|error| not_solved(&scenario, error.to_string()))?;
    let discount = scenario.learner().discount();
    Ok(ValueTable::exact(
        graph,
        discount,
        rewards(scenario.rulebook()),
    ))
}

/// Returns whether the distance of Theorem 3 covers every signal of the formulas.
fn is_covered(scenario: GridScenario<'_>) -> bool {
    let rulebook = scenario.rulebook();
    let rules = rulebook.rules.iter().map(|rule| &rule.monitor);
    let signals = scenario.world().schema().signals();
    let mut read = rules.chain([&rulebook.spec]).flat_map(Monitor::signals);
    read.all(|signal| COVERED.contains(&signals[signal].name.as_str()))
}

/// Checks that the theorems on grids apply to a world, before anything is played.
///
/// A driving world is not checked here.
///
/// # Errors
/// The world has no list of starts, or its formulas are not functions of the game's
/// states.
pub fn admits_theorems(scenario: &Scenario) -> Result<(), TheoremsError> {
    // Only on a grid do the theorems need an exact solution.
    let Some(grid) = scenario.grid() else {
        return Ok(());
    };
    // The proofs compare pairs of starts, so these must be a list.
    if scenario.starts().is_none() {
        return Err(not_solved(scenario, "it has no list of starts".to_owned()));
    }
    let admitted = GameGraph::admits(grid.world(), scenario.rulebook());
    admitted.map_err(|error| not_solved(scenario, error.to_string()))
}

impl GridTheorems {
    /// Returns whether a theorem failed or was not checked, which is a bug of this program.
    pub fn is_refuted(&self) -> bool {
        let second = [&self.theorem_2, &self.theorem_2_learned];
        self.theorem_1.is_refuted()
            || !self.unchecked.is_empty()
            || second.iter().any(|checked| checked.outcome.is_refuted())
            || self.theorem_3.iter().any(|row| row.outcome.is_refuted())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ado that always does the same.
    struct Always;

    impl Policy for Always {
        fn act(&self, _: &[f32]) -> usize {
            0
        }

        fn value(&self, _: &[f32]) -> f32 {
            0.0
        }
    }

    #[test]
    fn every_refuted_part_and_every_unchecked_grid_refutes_the_whole() {
        let text = include_str!("../../../../worlds/grid.ron");
        let world = Scenario::parse("grid.ron", text).expect("sound");
        let sound = grid_theorems(world.grid().expect("a grid"), &Always, &[]).expect("solved");
        assert!(!sound.is_refuted());
        let refuted = || crate::theorems::TheoremOutcome::Refuted { why: String::new() };
        let with = |change: fn(&mut GridTheorems)| {
            let mut all = sound.clone();
            change(&mut all);
            all.is_refuted()
        };
        // No relation at all is a grid that nothing was checked on.
        assert!(with(|it| it.unchecked.push("finer".to_owned())));
        assert!(!with(|it| it.not_comparable.push("larger".to_owned())));
        let mut all = sound.clone();
        all.theorem_1.rows[3].outcome = refuted();
        assert!(all.is_refuted());
        for at in 0..2 {
            let mut all = sound.clone();
            let second = [&mut all.theorem_2, &mut all.theorem_2_learned];
            second.into_iter().nth(at).expect("two").outcome = refuted();
            assert!(all.is_refuted());
        }
        // An ado that misses a bound is no bug.
        let mut all = sound.clone();
        all.theorem_1.rows[0].outcome_of_learned = refuted();
        assert!(!all.is_refuted());
    }

    #[test]
    fn worlds_that_the_theorems_do_not_fit_are_refused_before_anything_is_played() {
        let text = include_str!("../../../../worlds/grid_jump.ron");
        let refusal = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            let world = Scenario::parse("other.ron", &text.replace(from, to)).expect("sound");
            let refusal = admits_theorems(&world).err();
            refusal.map(|error| error.to_string())
        };
        assert_eq!(refusal("size: 4", "size: 4"), None);
        let drawn = refusal("starts: AllPairs", "starts: Uniform").expect("no list");
        assert!(drawn.contains("no list of starts"), "{drawn}");
        let rule = "always[0, T] (speed_inf <= 1.5)";
        let nested = "always[0, T] (eventually[0, 2] (ado.x >= 0))";
        let nested = refusal(rule, nested).expect("no state");
        assert!(nested.contains("cannot be judged from a state"), "{nested}");
        let road = include_str!("../../../../worlds/acc.ron");
        let road = Scenario::parse("acc.ron", road).expect("sound");
        assert_eq!(admits_theorems(&road), Ok(()));
    }

    #[test]
    fn formulas_on_other_signals_are_not_compared() {
        let text = include_str!("../../../../worlds/grid.ron");
        let covered = |from: &str, to: &str| {
            let world = Scenario::parse("grid.ron", &text.replace(from, to)).expect("sound");
            is_covered(world.grid().expect("a grid"))
        };
        assert!(covered("", ""));
        assert!(!covered(
            "(speed_inf <= 1.5)",
            "(speed_inf <= 1.5 or time_left <= 1)"
        ));
    }

    #[test]
    fn relations_are_those_of_all_distances_below_tau() {
        use crate::world::GridChange;

        let text = include_str!("../../../../worlds/grid.ron");
        let world = Scenario::parse("grid.ron", text).expect("sound");
        let epsilons = |refine: u32, change: GridChange| {
            let change = GridChange {
                refine: Some(refine),
                ego_step: Some(2 * refine),
                ..change
            };
            let other = world.with(&change.into()).expect("fits");
            let [one, two] = [&world, &other].map(|it| it.grid().expect("a grid"));
            let relations = bisimulations(one, two, TAU)?;
            Some(
                relations
                    .iter()
                    .map(|it| it.epsilon())
                    .collect::<Vec<f64>>(),
            )
        };
        let plain = GridChange::default;
        // A distance of τ itself promises nothing.
        // Centres of halves of a cell are a quarter of it from its middle.
        assert_eq!(epsilons(2, plain()), Some(vec![0.0, 0.25]));
        assert_eq!(epsilons(3, plain()), Some(vec![0.0, 1.0 / 3.0]));
        let larger = GridChange {
            size: Some(5),
            ..plain()
        };
        assert_eq!(epsilons(1, larger), None);
        let longer = GridChange {
            horizon: Some(crate::world::Horizon::Steps(5)),
            ..plain()
        };
        assert_eq!(epsilons(1, longer), None);
    }
}
