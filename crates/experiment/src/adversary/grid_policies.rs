//! Ados of grid worlds that follow a rule: the exact solution, and the chaser.

use super::ado::Ado;
use super::error::AdversaryError;
use crate::experiment::EgoUnderTest;
use crate::grid_solver::exact::chase;
use crate::grid_solver::game_graph::GameGraph;
use crate::grid_solver::position_policy::{NoOptimalPolicy, PositionPolicy};
use crate::run_dir::AdversaryId;
use crate::world::Scenario;

/// Untrained ados of grid worlds, which observe both positions.
#[derive(Clone, Copy)]
pub enum GridPolicy {
    /// Exact solution.
    Optimal,
    /// Step towards the ego along the larger axis.
    Chaser,
}

impl GridPolicy {
    /// Checks that the optimal ado of a world can be made, before anything is played.
    ///
    /// # Errors
    /// The world is no grid, or its formulas are not functions of the game's states.
    pub fn admits_optimal(scenario: &Scenario) -> Result<(), AdversaryError> {
        let grid = scenario.require_grid()?;
        let admitted = GameGraph::admits(grid.world(), scenario.rulebook());
        admitted.map_err(|source| not_optimal(scenario, source.into()))
    }

    /// Returns the policy of an adversary. `None`: it is another adversary.
    pub fn of(id: &AdversaryId) -> Option<GridPolicy> {
        let mut all = [GridPolicy::Optimal, GridPolicy::Chaser].into_iter();
        all.find(|policy| policy.id() == *id)
    }

    /// Returns the identity in rows.
    pub fn id(self) -> AdversaryId {
        self.name().into()
    }

    fn name(self) -> &'static str {
        match self {
            GridPolicy::Optimal => "optimal",
            GridPolicy::Chaser => "chaser",
        }
    }

    /// Returns the ado that plays a policy.
    pub fn ado(self, policy: &PositionPolicy) -> Ado<'_> {
        let method = match self {
            GridPolicy::Optimal => "backward induction",
            GridPolicy::Chaser => "along the larger axis",
        };
        Ado::Rule(policy, self.name(), method)
    }

    /// Returns the ego in the fully observed world, and the rule's policy there.
    pub fn policy(
        self,
        ego: &EgoUnderTest,
    ) -> Result<(EgoUnderTest, PositionPolicy), AdversaryError> {
        // Both rules need positions that a world may hide from its ado.
        let whole = ego.scenario().require_grid()?.fully_observed();
        let grid = whole.require_grid()?.world();
        let policy = match self {
            GridPolicy::Chaser => {
                let moves = &grid.spec().moves;
                // The chaser predicts no reward, and nothing reads its values.
                PositionPolicy::new(grid, |both| (chase(both, moves), 0.0))?
            }
            GridPolicy::Optimal => {
                let policy = PositionPolicy::optimal(grid, whole.rulebook());
                policy.map_err(|source| not_optimal(&whole, source))?
            }
        };
        Ok((ego.in_world(whole), policy))
    }
}

fn not_optimal(scenario: &Scenario, source: NoOptimalPolicy) -> AdversaryError {
    AdversaryError::NoOptimalPolicy {
        world: scenario.name().to_owned(),
        source,
    }
}
