//! Theorems 1 to 3 on a grid world for a trained ado.

use serde::Serialize;

use super::TheoremsError;
use super::bisimilar::{Theorem3, bisimulations, theorem_3};
use super::nearby::{Approximation, Theorem1, Theorem2, theorem_1, theorem_2};
use crate::grid_solver::exact::Game;
use crate::grid_solver::values::ValueTable;
use crate::rl::Policy;
use crate::world::{GridScenario, Scenario};

/// α of the stopping rule of value iteration in Theorem 2.
const ALPHA: f64 = 0.01;
/// Smallest τ of the shipped rules.
///
/// A unit move keeps `speed_inf <= 1.5` with this margin.
const TAU: f64 = 0.5;

/// Results of all checks on a grid.
#[derive(Clone, Debug, Serialize)]
pub struct GridTheorems {
    /// Theorem 1, with V* from backward induction.
    pub theorem_1: Theorem1,
    /// Sweeps of value iteration up to the stopping rule.
    pub sweeps: usize,
    /// Theorem 2 for value iteration, truncated.
    pub theorem_2: Theorem2,
    /// Theorem 2 for the values of the trained ado.
    pub theorem_2_learned: Theorem2,
    /// Definition 5 and Theorem 3, by changed grid and ε.
    pub theorem_3: Vec<Theorem3>,
    /// Changed grids of another size, which cannot be compared.
    pub not_comparable: Vec<String>,
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
    let truth = optimal_values(scenario);
    let reward = scenario.rulebook().reward;
    let lawful = |rho: f64| reward.lawful(rho);
    let (iterated, sweeps) = ValueTable::iterated(truth.game(), truth.discount(), lawful, ALPHA);
    // The stopping rule certifies its α, and the learned values have no such certificate.
    let by_sweeps = Approximation {
        values: &iterated,
        certified: Some(ALPHA),
        policy: None,
    };
    // The learned values are read from the policy at the states of the exact table.
    let learned = truth.learned(scenario.world(), policy);
    let learned = Approximation {
        values: &learned,
        certified: None,
        policy: Some(policy),
    };
    let (mut rows, mut not_comparable) = (Vec::new(), Vec::new());
    for (name, changed) in changed {
        // A change keeps the kind of the world.
        let changed = changed.grid();
        let relations = changed.and_then(|changed| bisimulations(scenario, changed, TAU));
        let (Some(changed), Some(relations)) = (changed, relations) else {
            not_comparable.push(name.clone());
            continue;
        };
        let relations = relations.iter();
        rows.extend(relations.map(|it| theorem_3(scenario, (name, changed), policy, it)));
    }
    Ok(GridTheorems {
        theorem_1: theorem_1(scenario, policy, &truth)?,
        sweeps,
        theorem_2: theorem_2(scenario, &truth, &by_sweeps)?,
        theorem_2_learned: theorem_2(scenario, &truth, &learned)?,
        theorem_3: rows,
        not_comparable,
    })
}

/// Returns V* of a grid world under the discount of its learner.
pub fn optimal_values(scenario: GridScenario<'_>) -> ValueTable {
    let reward = scenario.rulebook().reward;
    let lawful = |rho: f64| reward.lawful(rho);
    let discount = scenario.learner().discount();
    ValueTable::exact(&Game::of(scenario.world()), discount, lawful)
}

impl GridTheorems {
    /// Returns whether a theorem failed, which is a bug of this program.
    pub fn is_refuted(&self) -> bool {
        let second = [&self.theorem_2, &self.theorem_2_learned];
        self.theorem_1.is_refuted()
            || second.iter().any(|checked| checked.outcome.is_refuted())
            || self.theorem_3.iter().any(|row| row.outcome.is_refuted())
    }
}
