//! Trained ados as traffic: a frozen policy, and what it knows of its own world.
//!
//! A policy knows the signals, scales and actions of the world it was trained
//! in. Elsewhere others play the parts it knows: `names` says who, and its
//! signals are worked out from them, derived ones and constants of its own
//! world included. Whether and how it acts in a world is a matter of that world.

use std::sync::Arc;

use indexmap::IndexMap;

use super::actions::Actions;
use super::names::AgentNames;
use crate::rl::Policy;
use crate::scene::{Clock, Derived, Observed};
use crate::stl::Constants;

/// A trained ado and what it knows.
#[derive(Clone)]
pub struct TrainedAdo {
    /// The world it was trained in.
    pub home: Arc<TrainingWorld>,
    /// Its name there.
    pub part: String,
    /// What it may choose from.
    pub actions: Actions,
    /// Time constant with which its acceleration follows; 0 is none.
    pub lag_s: f64,
    /// How it chooses.
    pub policy: Arc<dyn Policy>,
    /// Who plays whose part: names at home to names here.
    pub names: IndexMap<String, String>,
}

impl std::fmt::Debug for TrainedAdo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Trained({} of {})", self.part, self.home.world)
    }
}

/// What an ado knows of the world it was trained in.
#[derive(Clone, Debug)]
pub struct TrainingWorld {
    /// Its name.
    pub world: String,
    /// The clocks.
    pub clock: Clock,
    /// Who was in it.
    pub names: AgentNames,
    /// Signals derived from the others, in order.
    pub derived: Vec<Derived>,
    /// Constants that derived signals may use.
    pub constants: Constants,
    /// The ado's observation.
    pub observe: Vec<Observed>,
}
