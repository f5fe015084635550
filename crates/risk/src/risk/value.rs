//! Probability V of a failure, as it is learned from runs.
//!
//! V(s, a) is the probability that the ego fails after the joint action a in state s, if
//! the ados follow their law from then on. A run gives a target per decision, from its end
//! backwards: the mean of V under the law, in which the value of the action that was taken
//! is replaced by its own target (tree backup, Precup et al. 2000). So a single failure
//! moves the values of all states before it, with their right size.

use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::decisions::ActionValues;
use super::record::RiskRun;
use super::value_network::ValueNetwork;
use super::value_table::TableOfV;

/// Form of V.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    EnumMessage,
    EnumString,
    IntoStaticStr,
    VariantArray,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
#[non_exhaustive]
pub enum ValueKind {
    /// Network over all inputs.
    #[default]
    Network,
    /// Table over the inputs by which failures differ most from other runs.
    Table,
}

/// V with a head per kind of failure.
///
/// Inputs are the ados' observation, their last actions and the remaining decisions.
#[derive(Clone, Debug)]
pub(super) enum Value {
    Network(ValueNetwork),
    Table(TableOfV),
}

impl Value {
    /// Creates a V that expects hardly any failure.
    ///
    /// `sizes` are inputs, heads and joint actions.
    pub(super) fn new(kind: ValueKind, sizes: [usize; 3], seed: u64) -> Value {
        let [inputs, heads, actions] = sizes;
        match kind {
            ValueKind::Network => Value::Network(ValueNetwork::new(inputs, heads, actions, seed)),
            ValueKind::Table => Value::Table(TableOfV::new(heads, actions)),
        }
    }

    /// Returns the number of heads.
    pub(super) fn heads(&self) -> usize {
        match self {
            Value::Network(network) => network.heads(),
            Value::Table(table) => table.heads(),
        }
    }

    /// Returns V of every head and action, `[heads, actions]`.
    pub(super) fn values(&self, input: &[f32]) -> Vec<f64> {
        match self {
            Value::Network(network) => network.values(input),
            Value::Table(table) => table.values(input).to_vec(),
        }
    }

    /// Fits V to runs, each with whether it is a failure of every head.
    pub(super) fn fit(&mut self, runs: &[(&RiskRun, Vec<bool>)], seed: u64) {
        match self {
            Value::Network(network) => network.fit(runs, seed),
            Value::Table(table) => table.fit(runs),
        }
    }
}
