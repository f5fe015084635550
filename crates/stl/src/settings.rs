//! What a formula may name, and how it is read.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::formula::Formula;

/// Named numbers; `T`, the horizon in seconds, is one like any other.
pub type Constants = IndexMap<String, f64>;

/// What a formula may name besides signals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Names {
    /// Named numbers, for comparisons and for bounds (there in seconds).
    pub constants: Constants,
    /// Named formulas; one may use another, but not itself.
    pub formulas: IndexMap<String, Formula>,
}

/// Whether `φ until ψ` asks for φ at the sample where ψ holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Until {
    /// φ on [t, t'): ψ may take over from φ.
    #[default]
    HalfOpen,
    /// φ on [t, t']: both hold at t'.
    Closed,
}

/// What lies behind the end of a trace.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum TraceEnd {
    /// Nothing: windows are cut at the last sample.
    #[default]
    Truncate,
    /// The last sample, held for ever.
    Hold,
    /// Nobody knows: a window with a bound beyond the end counts for the worst
    /// that could still come. An unbounded window still ends with the trace.
    Strict,
}

/// How a formula is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// The reading of until, release, unless and since.
    pub until: Until,
    /// The reading of windows that leave the trace.
    pub end: TraceEnd,
    /// Clamps every robustness to ±`rho_max`; `None`: ±inf is possible.
    pub rho_max: Option<f64>,
    /// What is refused because it is too large.
    pub limits: Limits,
}

/// What is refused when binding because it is too large.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// How far a formula may look ahead, or back, in samples.
    pub horizon_samples: usize,
    /// Operators, after named formulas have been put in.
    pub operators: usize,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits {
            horizon_samples: 10_000_000,
            operators: 10_000,
        }
    }
}
