//! Names that a formula may use, and the settings of its reading.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::formula::Formula;

/// Named numbers. `T`, the horizon in seconds, is a constant like any other.
pub type Constants = IndexMap<String, f64>;

/// Names that a formula may use besides signals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Names {
    /// Named numbers, for comparisons and for bounds (there in seconds).
    pub constants: Constants,
    /// Named formulas. A formula may use another, but not itself.
    pub formulas: IndexMap<String, Formula>,
}

/// Requirement on φ in `φ until ψ` at the sample where ψ holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Until {
    /// φ on [t, t'): ψ may replace φ.
    #[default]
    HalfOpen,
    /// φ on [t, t']: both hold at t'.
    Closed,
}

/// Continuation behind the end of a trace.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum TraceEnd {
    /// No samples: windows are cut at the last sample.
    #[default]
    Truncate,
    /// The last sample, held for ever.
    Hold,
    /// Unknown samples: a bounded window beyond the end counts as the worst case.
    ///
    /// An unbounded window still ends with the trace.
    Strict,
}

/// Settings of the reading of a formula.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Reading of until, release, unless and since.
    pub until: Until,
    /// Reading of windows that leave the trace.
    pub end: TraceEnd,
    /// Clamp of every robustness to ±`rho_max`, `None` for no clamp.
    pub rho_max: Option<f64>,
    /// Limits on the size of a formula.
    pub limits: Limits,
}

/// Limits on the size of a formula, checked when binding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Greatest number of samples that a formula may look ahead or back.
    pub horizon_samples: usize,
    /// Greatest number of operators after named formulas are expanded.
    pub operators: usize,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits {
            // More than a day at 100 Hz. A held trace grows by it, 80 MB for an
            // operator.
            horizon_samples: 10_000_000,
            operators: 10_000,
        }
    }
}
