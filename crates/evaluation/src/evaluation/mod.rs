//! Evaluations: egos × adversaries × test starts → rows, tables and gates.

mod ado_effect;
mod baseline_table;
mod blocking_rules;
mod break_even;
mod composed;
mod ego_evaluation;
mod error;
mod evaluation_plan;
mod gate_decision;
pub mod harden;
mod points;
mod regression_gate;
pub mod reuse;
mod run_report;
mod search_table;
mod sweep;
mod table;

pub use crate::surrogate::AdaptedTo;
pub use crate::testbench::Sampling;
pub use crate::theorems::TheoremsError;
pub use ado_effect::{AdoEffect, AdoFinding, ado_effects};
pub use baseline_table::{BaselineTable, untrained};
pub use break_even::{BreakEven, PerStart, break_even};
pub use error::EvaluationError;
pub use evaluation_plan::Evaluation;
pub use gate_decision::{DecidedGate, Gate, GateContact, GateEgo, GateOn, NotRun};
pub use gate_decision::{gate_page, gate_table, gates_verdict};
pub use points::PointOutcome;
pub use points::{PointResult, PointsRequest, PointsTable, VariedPoint, points};
pub use reuse::{LEAST_REACHABLE, Relation, ReusedOn, Summary, summarise};
pub use run_report::{GivenRows, ReportRequest};
pub use search_table::{SearchCampaign, SearchTable};
pub use search_table::{counterexamples_for, policy_for};
pub use sweep::{Sweep, SweepError};
pub use table::EvaluationTable;
pub use table::TheoremsChecked;
