//! Campaigns in resumable pieces: planned, run and merged.
//!
//! A campaign plays worlds × egos × ados × starts. [`Plan::make`] cuts it into pieces.
//! Each piece is a function of the plan alone and writes a single file. It may run
//! anywhere, any number of times ([`PlanDir::run_piece`], [`PlanDir::run_partition`]).
//! [`PlanDir::merge`] trusts no engine. It reads every piece and checks it against the plan
//! and its own hash. The merged bytes do not depend on cut, order or machines.
//! `docs/guide/campaigns.md` is the guide.
//!
//! Architecture Invariant: a row holds nothing of the machine, the time or the cut of the
//! campaign.

mod cell_map;
mod check;
mod cost_pilot;
mod coverage;
mod dir;
mod error;
mod estimate;
mod file;
mod merge;
mod page;
mod partition;
mod piece;
mod plan;
mod play;
mod points;
mod regulation_boundary;
mod row;
mod run;
mod summary;
mod training;
mod trivial_blocks;
mod unit_counts;
mod unit_gate;
mod workflow_files;

pub use cost_pilot::PIECE_S;
pub use cost_pilot::{Cut, PlanCost};
pub use coverage::CampaignCoverage;
pub use dir::{PieceDone, PlanDir};
pub use error::CampaignError;
pub use merge::Merged;
pub use page::COLUMNS;
pub use partition::{Partition, PartitionError};
pub use plan::Plan;
pub use run::Ran;
pub use summary::SummaryRow;
pub use unit_gate::UnitGate;
