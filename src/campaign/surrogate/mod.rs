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
pub use learn::{Acts, LearnEgoRequest, LearnedEgo, LearnedFrom, SurrogateError, learn_ego};
pub use likeness::Likeness;
pub(super) use stored::learned;
