//! Derived signals of a world file.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::ron_file::short_or_long;

/// Derived signal: an expression, or `Signal(expr: "…", unit: "m", about: "…", …)`.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum SignalFile {
    /// Expression of signals above it.
    Expression(String),
    /// Expression with its unit, its meaning and its range.
    Described(DescribedSignal),
}

/// Expression with its unit, its meaning and its range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Signal", deny_unknown_fields)]
pub struct DescribedSignal {
    /// Expression of signals above it.
    pub expr: String,
    /// Unit. Default: that of the expression.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Meaning in a sentence. Default: the expression.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<String>,
    /// Usual least and greatest value, which scale observations. Default: by the unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<(f64, f64)>,
}

impl SignalFile {
    /// Returns the expression.
    pub fn expr(&self) -> &str {
        match self {
            SignalFile::Expression(expr) => expr,
            SignalFile::Described(signal) => &signal.expr,
        }
    }

    /// Returns the description, `None` for an expression alone.
    pub fn described(&self) -> Option<&DescribedSignal> {
        match self {
            SignalFile::Expression(_) => None,
            SignalFile::Described(signal) => Some(signal),
        }
    }
}

impl From<String> for SignalFile {
    fn from(expr: String) -> SignalFile {
        SignalFile::Expression(expr)
    }
}

impl From<DescribedSignal> for SignalFile {
    fn from(signal: DescribedSignal) -> SignalFile {
        SignalFile::Described(signal)
    }
}

// Derived as an untagged enum, it would lose the reason of a mistake in `Signal(…)`.
impl<'de> Deserialize<'de> for SignalFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<SignalFile, D::Error> {
        let forms = "an expression such as \"ado.x - ego.x\" or Signal(expr: \"…\", …)";
        short_or_long::<D, String, DescribedSignal, SignalFile>(deserializer, forms)
    }
}
