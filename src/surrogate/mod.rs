//! An ado for an ego nobody here wrote: a learned surrogate of that ego, in
//! which every start is planned, and one real run that confirms the plan.
//!
//! No ado that was trained on some controllers carried over to one of another
//! structure: with a memory, told what is nearest, or as one of many, it solved
//! about half of what can be solved. What works is to record some runs of the
//! ego, to fit a network to what it did next ([`fit`]), and to look for the ado's
//! actions in a model of the world with that network as the ego ([`plan`]). Two
//! thirds of the runs are planned themselves, so the network sees what plans
//! lead to. Every counterexample is a run of the real ego: a surrogate that is
//! wrong can miss, but it can claim nothing false.
//!
//! What an ego does beyond a threshold, a network rounds off: its emergency brake is
//! looked for first ([`braking`]).
//!
//! The trained policy is one of the strategies that a plan has to beat, and what
//! acts where none is found.

mod adapted_policy;
mod brake_detection;
mod dataset;
mod earlier_attempts;
mod emergency_brake;
mod features;
mod fine_tune;
mod fit;
mod fitted_model;
mod learn;
mod model;
mod model_fit;
mod model_inputs;
mod model_library;
mod motion;
mod open_loop_policy;
mod plan;
mod planning_budget;
mod plant;
#[cfg(test)]
mod recorded_ego;
mod regression;
mod robust_score;
mod strategy;
mod surrogate_sim;
mod surrogate_store;

pub use adapted_policy::{AdaptedRow, AdaptedTo};
pub use emergency_brake::{BrakedFor, EmergencyBrake};
pub use fitted_model::Likeness;
pub use learn::{Acts, LearnEgoRequest, LearnedEgo, LearnedFrom, SurrogateError, learn_ego};
pub use open_loop_policy::TriedActions;
pub(crate) use surrogate_store::learned;
