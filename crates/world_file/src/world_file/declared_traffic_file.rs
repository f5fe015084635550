//! Declared traffic as a RON file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::default_field::is_default;
use crate::ron_file::Ordered;

/// Traffic as you declare it: laws of the starts and of the ados' actions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Traffic", deny_unknown_fields)]
pub struct DeclaredTrafficFile {
    /// Origin of the laws, which is printed with every number.
    pub source: String,
    /// Number of encounters like a run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure: Option<EncounterRate>,
    /// Model of recorded traffic for `Fitted` laws: `motorway`, or a file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Laws by axis of X_init. The other axes are uniform.
    #[serde(default, skip_serializing_if = "is_default")]
    pub starts: Ordered<StartLawFile>,
    /// Laws by ado.
    pub ados: Ordered<AdoLawFile>,
}

/// Number of encounters, by which a risk per run becomes a rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum EncounterRate {
    /// Encounters per hour.
    PerHour(f64),
    /// Encounters per 1,000 km.
    Per1000Km(f64),
}

impl EncounterRate {
    /// Returns the encounters per unit.
    pub fn encounters(self) -> f64 {
        match self {
            EncounterRate::PerHour(n) | EncounterRate::Per1000Km(n) => n,
        }
    }

    /// Returns the unit in words.
    pub fn unit(self) -> &'static str {
        match self {
            EncounterRate::PerHour(_) => "per hour",
            EncounterRate::Per1000Km(_) => "per 1,000 km",
        }
    }
}

/// Law of an axis: a draw, multiplied by `times`, plus `plus`.
///
/// Both are expressions of other axes, such as `"ado.speed"` for a closing speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
// Every variant repeats factor and summand, because serde cannot flatten a struct into a
// type that denies unknown fields.
pub enum StartLawFile {
    /// Shares of bins.
    Histogram {
        /// Edges of the bins, in rising order.
        edges: Vec<f64>,
        /// Weight of each bin.
        weights: Vec<f64>,
        /// Factor of the draw, an expression.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        times: Option<String>,
        /// Summand of the draw, an expression.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        plus: Option<String>,
    },
    /// Normal distribution, cut to a range.
    Normal {
        /// Mean of the distribution.
        mean: f64,
        /// Standard deviation of the distribution.
        sd: f64,
        /// Range of the draws.
        within: (f64, f64),
        /// Factor of the draw, an expression.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        times: Option<String>,
        /// Summand of the draw, an expression.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        plus: Option<String>,
    },
    /// Lognormal distribution, cut to a range.
    LogNormal {
        /// Median of the distribution.
        median: f64,
        /// Standard deviation of the logarithm.
        sigma: f64,
        /// Range of the draws.
        within: (f64, f64),
        /// Factor of the draw, an expression.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        times: Option<String>,
        /// Summand of the draw, an expression.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        plus: Option<String>,
    },
    /// Uniform distribution.
    Uniform {
        /// Range of the draws.
        within: (f64, f64),
        /// Factor of the draw, an expression.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        times: Option<String>,
        /// Summand of the draw, an expression.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        plus: Option<String>,
    },
}

impl StartLawFile {
    /// Returns factor and summand.
    pub fn relation(&self) -> [(&'static str, &Option<String>); 2] {
        let (times, plus) = match self {
            StartLawFile::Histogram { times, plus, .. }
            | StartLawFile::Normal { times, plus, .. }
            | StartLawFile::LogNormal { times, plus, .. }
            | StartLawFile::Uniform { times, plus, .. } => (times, plus),
        };
        // The names of the fields are places of problems in the file.
        [("times", times), ("plus", plus)]
    }
}

/// Law of an ado's actions at every decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum AdoLawFile {
    /// The next action depends on the last one, and on signals.
    Markov(MarkovFile),
    /// Accelerations follow the model of recorded traffic.
    Fitted(FittedFile),
}

/// Markov law. The action before the first decision is the neutral one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MarkovFile {
    /// Probability of repeating each action.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stay: Option<Vec<f64>>,
    /// Weights of the other actions if the last one is not repeated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leave: Option<Vec<f64>>,
    /// Weights of the next action, a row per last action, instead of both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transitions: Option<Vec<Vec<f64>>>,
    /// Events that end the last action.
    #[serde(default, skip_serializing_if = "is_default")]
    pub onsets: Ordered<OnsetFile>,
}

/// Event with a rate that depends on signals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OnsetFile {
    /// Expression of signals. A value below 0, or an undefined one, is no event.
    pub rate_per_s: String,
    /// Weights of the next action, by label.
    pub to: Ordered<f64>,
}

/// Law by a model of recorded traffic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedFile {
    /// Law of the lateral moves, in a set of accelerations and lateral moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lateral: Option<MarkovFile>,
}
