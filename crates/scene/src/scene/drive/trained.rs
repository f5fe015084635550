//! Trained ados as traffic: a frozen policy and the data of its training world.
//!
//! A policy knows the signals, scales and actions of its training world. In a
//! different world, `names` maps each of its parts to an agent. Its signals are
//! computed from those agents, including derived signals and constants of the
//! training world. The new world decides whether and how it can act there.

use std::sync::Arc;

use indexmap::IndexMap;

use super::actions::Actions;
use super::names::AgentNames;
use crate::rl::Policy;
use crate::scene::{Clock, Derived, Observed};
use crate::stl::Constants;

/// A trained ado with the data it needs.
#[derive(Clone)]
pub struct TrainedAdo {
    /// The training world.
    pub home: Arc<TrainingWorld>,
    /// Its name in that world.
    pub part: String,
    /// Action set.
    pub actions: Actions,
    /// Time constant of its acceleration, 0 for none.
    pub lag_s: f64,
    /// Policy.
    pub policy: Arc<dyn Policy>,
    /// Mapping of parts: names in the training world to names here.
    pub names: IndexMap<String, String>,
    /// Action without effect.
    pub neutral: usize,
    /// Temperature at which its actions are drawn. `None`: the best action.
    pub temperature: Option<f64>,
    /// True if its rules are judged here, so that it is an adversary.
    pub judged: bool,
    /// True if it plays its action without effect throughout.
    pub idle: bool,
}

impl std::fmt::Debug for TrainedAdo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Trained({} of {})", self.part, self.home.world)
    }
}

/// Data of a training world that its ado needs elsewhere.
#[derive(Clone, Debug)]
pub struct TrainingWorld {
    /// Name of the world.
    pub world: String,
    /// The clocks.
    pub clock: Clock,
    /// Names of its agents.
    pub names: AgentNames,
    /// Signals derived from the others, in order.
    pub derived: Vec<Derived>,
    /// Constants that derived signals may use.
    pub constants: Constants,
    /// The ado's observation.
    pub observe: Vec<Observed>,
}
