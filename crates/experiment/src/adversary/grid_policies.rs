//! Ados of grid worlds that follow a rule: the exact solution, and the chaser.

use super::ado::Ado;
use super::error::AdversaryError;
use crate::experiment::EgoUnderTest;
use crate::grid_solver::exact::{PositionPolicy, chase};

/// Untrained ados of grid worlds, which observe both positions.
#[derive(Clone, Copy)]
pub enum GridPolicy {
    /// Exact solution.
    Optimal,
    /// Step towards the ego along the larger axis.
    Chaser,
}

impl GridPolicy {
    /// Returns the ado that plays a policy.
    pub fn ado(self, policy: &PositionPolicy) -> Ado<'_> {
        match self {
            GridPolicy::Optimal => Ado::Rule(policy, "optimal", "backward induction"),
            GridPolicy::Chaser => Ado::Rule(policy, "chaser", "along the larger axis"),
        }
    }

    /// Returns the ego in the fully observed world, and the rule's policy there.
    pub fn policy(
        self,
        ego: &EgoUnderTest,
    ) -> Result<(EgoUnderTest, PositionPolicy), AdversaryError> {
        let whole = ego.scenario().require_grid()?.fully_observed();
        let grid = whole.require_grid()?.world();
        let policy = match self {
            GridPolicy::Chaser => {
                let moves = &grid.spec().moves;
                PositionPolicy::new(grid, |both| (chase(both, moves), 0.0))
            }
            GridPolicy::Optimal => {
                let reward = whole.rulebook().reward;
                PositionPolicy::optimal(grid, |rho| reward.lawful(rho))
            }
        };
        Ok((ego.in_world(whole), policy?))
    }
}
