//! Ados of grid worlds that follow a rule: the exact solution, and the chaser.

use super::error::AdversaryError;
use super::rollout::Ado;
use crate::experiment::EgoUnderTest;
use crate::scene::grid::exact::{PositionPolicy, chase};
use crate::world::Scenario;

/// Ados of grid worlds that nobody trained: they see both positions.
#[derive(Clone, Copy)]
pub(crate) enum ByRule {
    /// The best one.
    Optimal,
    /// A step towards the ego along the larger axis.
    Chaser,
}

impl ByRule {
    pub(crate) fn ado(self, policy: &PositionPolicy) -> Ado<'_> {
        match self {
            ByRule::Optimal => Ado::Rule(policy, "optimal", "backward induction"),
            ByRule::Chaser => Ado::Rule(policy, "chaser", "along the larger axis"),
        }
    }

    /// The fully observed world and the rule's policy in it.
    pub(crate) fn policy(
        self,
        ego: &EgoUnderTest,
    ) -> Result<(Scenario, PositionPolicy), AdversaryError> {
        let not_a_grid = || AdversaryError::NotAGrid {
            world: ego.scenario().name.clone(),
        };
        let whole = ego.scenario().fully_observed().ok_or_else(not_a_grid)?;
        let grid = whole.grid().ok_or_else(not_a_grid)?;
        let policy = match self {
            ByRule::Chaser => {
                let moves = &grid.spec().moves;
                PositionPolicy::new(grid, |both| (chase(both, moves), 0.0))
            }
            ByRule::Optimal => {
                let reward = whole.rulebook().reward;
                PositionPolicy::optimal(grid, |rho| reward.lawful(rho))
            }
        };
        Ok((whole, policy?))
    }
}
