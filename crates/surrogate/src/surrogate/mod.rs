//! Ado for an unknown ego: plans in a learned surrogate, confirmed by real runs.
//!
//! Ados trained on some controllers did not transfer to a controller of another structure.
//! With memory, with the nearest known structure as an input, or trained on many
//! structures, they solved about half of the solvable starts.
//! This module records some runs of the ego and fits a network to its motion (`model`).
//! It then searches the ado's actions in a model of the world with the network in the
//! ego's place (`plan`).
//! Two thirds of the runs are themselves planned, so the network sees the situations that
//! plans lead to.
//! Every counterexample is a run of the real ego. A wrong surrogate can miss failures but
//! cannot claim false ones.
//!
//! A network rounds off reactions beyond a threshold, so the emergency brake is fitted
//! first (`brake_detection`).
//!
//! The trained policy is a strategy that every plan has to beat. It acts where no plan is
//! found.

mod adapted_policy;
mod brake_detection;
mod brake_line;
mod dataset;
mod ego_motion;
mod emergency_brake;
mod features;
mod fine_tune;
mod fitted_model;
mod learn;
mod model;
mod model_driver;
mod model_fit;
mod model_kind;
mod open_loop_actions;
mod plan;
mod planning_budget;
#[cfg(test)]
mod recorded_runs;
mod strategy;
mod surrogate_error;
mod surrogate_fit;
mod surrogate_sim;
mod surrogate_world;

pub use adapted_policy::AdaptedTo;
pub use adapted_policy::learned;
pub use learn::{LEAST_RUNS, LearnEgoRequest, learn_ego};
pub use surrogate_world::SurrogateWorld;
