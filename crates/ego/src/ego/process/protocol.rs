//! Ego protocol 1: messages on both pipes, line by line.
//!
//! Defined in `docs/reference/ego-protocol.md`. Both sides ignore unknown keys, so that
//! later versions can add some.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::super::{Briefing, Percept};
use super::declared::DeclaredParameter;

/// Version of the protocol.
pub(crate) const PROTOCOL: u32 = 1;
/// Document that defines the protocol.
pub const DOCUMENT: &str = "docs/reference/ego-protocol.md";

/// Message of brakecheck without an episode.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum EgoMessage {
    /// Greeting, which the program answers with its own.
    Hello(Greeting),
    /// Farewell, which asks the program to end.
    Close(Empty),
}

#[derive(Serialize)]
pub(super) struct Greeting {
    pub protocol: u32,
    pub program: &'static str,
}

/// `{}`.
#[derive(Serialize)]
pub(super) struct Empty {}

/// A question with a number that the answer repeats.
#[derive(Serialize)]
pub(super) struct Numbered<T> {
    pub id: u64,
    #[serde(flatten)]
    pub question: T,
}

/// Begin of an episode.
#[derive(Serialize)]
pub(super) struct AskReset<'a> {
    pub reset: Reset<'a>,
}

#[derive(Serialize)]
pub(super) struct Reset<'a> {
    pub seed: u64,
    #[serde(flatten)]
    pub briefing: &'a Briefing,
    /// Values of all declared parameters.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<&'a str, f64>,
}

/// A sample of an episode.
#[derive(Serialize)]
pub(super) struct AskStep<'a> {
    pub step: &'a Percept,
}

/// Self-description of a program.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Hello {
    /// Version of the protocol that it uses.
    pub protocol: u32,
    /// Name of the program.
    #[serde(default)]
    pub name: String,
    /// Optional capabilities. `snapshot` is reserved.
    #[serde(default)]
    pub capabilities: Vec<String>,
    /// Parameters that `reset` may set.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<DeclaredParameter>,
    /// Key that only brakecheck sends. An echo reveals a program that repeats.
    #[serde(default, skip_serializing)]
    pub(super) program: Option<serde_json::Value>,
}

#[derive(Deserialize)]
pub(super) struct HelloAnswer {
    pub hello: Hello,
}

#[derive(Deserialize)]
pub(super) struct ReadyAnswer {
    pub id: u64,
    #[serde(default)]
    pub ready: bool,
    #[serde(default)]
    pub error: Option<String>,
}

#[derive(Deserialize)]
pub(super) struct StepAnswer {
    pub id: u64,
    #[serde(default)]
    // Optional here, so that a missing key gets a message of its own.
    pub accel_mps2: Option<f64>,
    #[serde(default)]
    pub lateral_mps: f64,
    #[serde(default)]
    pub error: Option<String>,
}
