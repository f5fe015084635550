#![doc = include_str!("../README.md")]
//!
//! # First steps
//!
//! Parse a text into a [`Formula`] and bind it to the signals of a
//! [`Schema`](trace::Schema) and to named constants. The result is a [`Monitor`],
//! which turns traces into numbers. Every error in a formula is reported before a
//! [`Monitor`] exists. The evaluation on a trace of its schema cannot fail. A NaN
//! never reaches a verdict: traces and online monitors refuse it, and a
//! comparison with an undefined value counts as the worst case.
//!
//! Architecture Invariant: knows no car, no reward, no file and no clock.

#![warn(
    clippy::dbg_macro,
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::todo,
    clippy::unimplemented,
    clippy::unwrap_used
)]
#![cfg_attr(
    test,
    allow(clippy::disallowed_methods, clippy::expect_used, clippy::unwrap_used)
)]

mod apply;
mod bind;
mod dense;
mod error;
mod explain;
mod formula;
mod instant;
mod interval;
mod leaf;
mod monitor;
mod number;
mod offline;
mod online;
mod parse;
mod parts;
mod program;
mod range;
mod rename;
mod running;
mod samples;
pub mod sampling;
mod secondary;
mod settings;
mod sliding;
mod syntax;
pub mod table;
mod time_name;
mod token;
pub mod trace;
mod trace_operators;
mod undefined;

pub use bind::BoundExpr;
pub use dense::{DenseError, DenseRowError, DenseTrace, Interpolation};
pub use error::StlError;
pub use explain::{Explanation, ExplanationStep, Reason};
pub use formula::{Expr, Formula};
pub use interval::Interval;
pub use monitor::Monitor;
pub use offline::Scratch;
pub use online::{OnlineMonitor, StreamMonitor};
pub use parts::FormulaPart;
pub use running::{RunningMonitor, SampleColumns};
pub use samples::{ColumnsError, Samples};
pub use settings::{Constants, Limits, Names, Settings, TraceEnd, Until};
