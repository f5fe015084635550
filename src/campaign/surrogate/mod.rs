//! Ado for an unknown ego: plans in a learned surrogate, confirmed by real runs.
//!
//! Ados trained on some controllers did not transfer to a controller of another structure.
//! With memory, with the nearest known structure as an input, or trained on many
//! structures, they solved about half of the solvable starts.
//! This module records some runs of the ego and fits a network to its motion ([`fit`]).
//! It then searches the ado's actions in a model of the world with the network in the
//! ego's place ([`plan`]).
//! Two thirds of the runs are themselves planned, so the network sees the situations that
//! plans lead to.
//! Every counterexample is a run of the real ego. A wrong surrogate can miss failures but
//! cannot claim false ones.
//!
//! A network rounds off reactions beyond a threshold, so the emergency brake is fitted
//! first ([`braking`]).
//!
//! The trained policy is a strategy that every plan has to beat. It acts where no plan is
//! found.

mod acting;
mod again;
mod bench;
mod brake;
mod braking;
mod care;
mod features;
mod fit;
mod fixed;
mod kinds;
mod learn;
mod likeness;
mod likening;
mod model;
mod motion;
mod plan;
mod plant;
mod reading;
mod record;
#[cfg(test)]
mod recorded;
mod regression;
mod stored;
mod strategy;
mod trained_on;
mod trial;

pub use acting::{AdaptedRow, AdaptedTo};
pub use brake::{BrakedFor, EmergencyBrake};
pub use fixed::TriedActions;
pub use learn::{
    Acts, LEAST_RUNS, LearnEgoRequest, LearnedEgo, LearnedFrom, SurrogateError, learn_ego,
};
pub use likeness::Likeness;
pub(super) use stored::learned;
