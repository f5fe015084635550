//! Risk: the probability that an ego fails, in traffic that you declare.
//!
//! A [`RiskTraffic`] has a law of the starts and a law of the ados' actions. A
//! [`RiskRequest`] estimates the probability that a run violates ψ_ego. Natural runs are
//! counted if they hold enough failures. Otherwise a search finds kinds of failure, V, the
//! probability of a failure, is learned from runs, and runs are drawn from a mixture of
//! natural traffic and traffic tilted by V. Weights make the estimate unbiased whatever V
//! is. Checks refuse estimates that rest on too little, and bounds hold whatever the
//! proposals missed.
//!
//! Architecture Invariant: no result depends on V or on modes except by its variance.

mod action_law;
mod batch;
mod checks;
mod counted_rounds;
mod decisions;
mod estimation;
mod known;
mod law_binding;
mod learning;
mod limits;
mod lower_bound;
mod manoeuvre;
mod mixture;
mod natural_counts;
mod natural_runs;
mod natural_traces;
mod pool;
mod record;
mod report;
mod report_text;
mod request;
mod result;
mod run;
mod run_faults;
mod run_file;
mod script_search;
mod start_law;
mod start_tree;
#[cfg(test)]
mod tests;
mod traffic;
mod traffic_crashes;
mod training_world;
#[cfg(test)]
mod two_modes;
mod value_network;

pub use crate::world::EncounterRate;
pub use checks::{Checks, Refusal};
pub use limits::RiskLimits;
pub use natural_traces::NaturalRun;
pub use pool::RiskEstimate;
pub use record::KnownFailure;
pub use report::{EgoRisk, ModeRisk, RiskBounds, RiskCost, RiskReadings, RiskReport};
pub use request::{RiskRequest, RiskSettings};
pub use run_faults::RunFaults;
pub use traffic::{RiskTraffic, RiskTrafficError};
pub use traffic_crashes::{TrafficCrash, TrafficCrashes};
pub use training_world::TrafficTrainingError;
