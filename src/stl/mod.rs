//! Signal Temporal Logic: what must hold, said once, measured exactly.
//!
//! A text is read into a [`Formula`], bound to the signals of a
//! [`Schema`](crate::trace::Schema) and to named constants as a [`Monitor`],
//! and then turns traces into numbers: the robustness ρ, how far the trace is
//! from changing the verdict. Everything that can be wrong with a formula is
//! wrong before there is a [`Monitor`]; evaluating one on a trace of its
//! schema cannot fail, and a NaN never gets as far as a verdict: traces and
//! online monitors refuse one, and a comparison that has none counts for the
//! worst.
//!
//! The language and its semantics are a table in `docs/stl.md`.
//!
//! Architecture Invariant: knows no car, no reward, no file and no clock.
//!
//! ```
//! use brakecheck::stl::{Constants, Formula, Scratch};
//! use brakecheck::trace::{Schema, Signal, Trace};
//!
//! let schema = Schema::new(0.5, [Signal::real("headway", "m", "front to front")])?;
//! let constants = Constants::from([("d_safe".to_owned(), 4.7), ("T".to_owned(), 1.0)]);
//! let spec: Formula = "always[0, T] (headway >= d_safe)".parse()?;
//! let monitor = spec.bind(&schema, &constants)?;
//!
//! let mut trace = Trace::new(schema.into());
//! let mut online = monitor.online();
//! for headway in [9.0, 6.5, 5.2] {
//!     trace.push(&[headway])?;
//!     println!("{:?}", online.push(&[headway])?);
//! }
//! assert_eq!(monitor.robustness(&trace, &mut Scratch::new()), 0.5);
//! assert!(online.interval().is_final());
//! println!("{}", monitor.explain(&trace));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod apply;
mod bind;
mod error;
mod explain;
mod formula;
mod kernel;
mod leaf;
mod monitor;
mod number;
mod offline;
mod online;
mod parse;
mod program;
mod range;
mod secondary;
mod settings;
mod syntax;
mod token;
mod undefined;

pub use error::StlError;
pub use explain::{Explanation, Reason, Step};
pub use formula::{BoundExpr, Expr, Formula};
pub use monitor::{Interval, Monitor};
pub use offline::Scratch;
pub use online::OnlineMonitor;
pub use settings::{Constants, Limits, Names, Settings, TraceEnd, Until};
