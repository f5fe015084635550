//! Ego protocol 1: what is said on both pipes, line by line.
//!
//! The document is `docs/ego-protocol.md`; both sides ignore keys they do not
//! know, so that later versions can add some.

use serde::{Deserialize, Serialize};

use super::super::{Briefing, Percept};

/// The version spoken here.
pub const PROTOCOL: u32 = 1;
/// Where the protocol is written down.
pub const DOCUMENT: &str = "docs/ego-protocol.md";

/// What brakecheck says.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Say {
    /// Who is there?
    Hello(Greeting),
    /// Farewell: please end.
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

/// A question with a number, which the answer repeats.
#[derive(Serialize)]
pub(super) struct Numbered<T> {
    pub id: u64,
    #[serde(flatten)]
    pub question: T,
}

/// An episode begins.
#[derive(Serialize)]
pub(super) struct AskReset<'a> {
    pub reset: Reset<'a>,
}

#[derive(Serialize)]
pub(super) struct Reset<'a> {
    pub seed: u64,
    #[serde(flatten)]
    pub briefing: &'a Briefing,
}

/// A sample has come.
#[derive(Serialize)]
pub(super) struct AskStep<'a> {
    pub step: &'a Percept,
}

/// What a program says of itself.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Hello {
    /// The version of the protocol that it speaks.
    pub protocol: u32,
    /// What it calls itself.
    #[serde(default)]
    pub name: String,
    /// What it can do beyond the least; `snapshot` is reserved.
    #[serde(default)]
    pub capabilities: Vec<String>,
    /// Only brakecheck says this: whoever does repeats what it hears.
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
    pub accel_mps2: Option<f64>,
    #[serde(default)]
    pub lateral_mps: f64,
    #[serde(default)]
    pub error: Option<String>,
}
