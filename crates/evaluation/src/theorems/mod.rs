//! Checks of the paper's theorems for users.
//!
//! On a grid V* and the greatest bisimulation are known, so Theorems 1 to 3 are tested by
//! playing ([`grid_theorems`]).
//! On the road Theorem 3 and Lemma 1 predict when a counterexample carries over to a
//! changed ego ([`carry_over`]).

mod bisimilar;
mod compare;
mod forecast;
mod grid;
mod nearby;
mod plays;
mod transfer;

pub use bisimilar::ReplayedOnGrid;
pub use bisimilar::{Theorem3, bisimulations, lifted, theorem_3};
pub use compare::Witness;
pub use forecast::Forecast;
pub use grid::GridTheorems;
pub use grid::admits_theorems;
pub use grid::{grid_theorems, optimal_values};
pub use nearby::Nearby;
pub use nearby::{Approximation, Theorem1, Theorem2, TheoremOutcome, theorem_1, theorem_2};
pub use transfer::CarryOver;
pub use transfer::carry_over;

use crate::experiment::TestStarts;
use crate::rl::Policy;
use crate::world::Scenario;

/// Request to check the theorems.
#[derive(Clone, Copy)]
pub struct TheoremsRequest<'a> {
    /// World with the nominal ego.
    pub nominal: &'a Scenario,
    /// Same world with changed egos or surroundings, by name.
    pub changed: &'a [(String, Scenario)],
    /// Policy of the trained ado.
    pub policy: &'a dyn Policy,
    /// The test starts.
    pub starts: &'a TestStarts,
    /// Share of starts on which the distance may be underestimated.
    pub alpha: f64,
}

/// Reason that a theorem cannot be checked on a world.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TheoremsError {
    /// Equal starts and actions do not give equal episodes.
    #[error(
        "the ego of `{world}` sees through noise, so success is a probability there, and Theorem 3 speaks of single runs"
    )]
    Stochastic {
        /// Name of the world.
        world: String,
    },
    /// Some violations do not count as counterexamples in the world.
    #[error(
        "`{world}` counts some violations only, by how the agents touch, and Theorem 3 speaks of every violation"
    )]
    NotEveryViolation {
        /// Name of the world.
        world: String,
    },
    /// The policy makes the nominal ego fail from no start.
    #[error("no start of `{world}` gives a counterexample to carry over")]
    NoCounterexample {
        /// Name of the world.
        world: String,
    },
    /// The world has no changed egos.
    #[error("`{world}` names no changed ego to carry counterexamples over to")]
    NothingChanged {
        /// Name of the world.
        world: String,
    },
    /// The world has no exact solution.
    #[error("`{world}` has no exact solution: {why}")]
    NotSolved {
        /// Name of the world.
        world: String,
        /// Reason.
        why: String,
    },
}
