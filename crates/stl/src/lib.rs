#![doc = include_str!("../README.md")]
//!
//! # Where to begin
//!
//! A text is read into a [`Formula`], bound to the signals of a
//! [`Schema`](trace::Schema) and to named constants as a [`Monitor`], and then
//! turns traces into numbers. Everything that can be wrong with a formula is
//! wrong before there is a [`Monitor`]; evaluating one on a trace of its
//! schema cannot fail, and a NaN never gets as far as a verdict: traces and
//! online monitors refuse one, and a comparison that has none counts for the
//! worst.
//!
//! Architecture Invariant: knows no car, no reward, no file and no clock.

mod apply;
mod bind;
mod error;
mod explain;
mod formula;
mod interval;
mod kernel;
mod leaf;
mod monitor;
mod number;
mod offline;
mod online;
mod parse;
mod program;
mod range;
mod samples;
mod secondary;
mod settings;
mod syntax;
mod token;
pub mod trace;
mod undefined;

pub use bind::BoundExpr;
pub use error::StlError;
pub use explain::{Explanation, ExplanationStep, Reason};
pub use formula::{Expr, Formula};
pub use interval::Interval;
pub use monitor::Monitor;
pub use offline::Scratch;
pub use online::OnlineMonitor;
pub use samples::{ColumnsError, Samples};
pub use settings::{Constants, Limits, Names, Settings, TraceEnd, Until};
