//! Faults: the ego or the physics failed, which is nobody's success.

use serde::{Deserialize, Serialize};

/// Largest acceleration that is believed, of either sign.
///
/// Tyres on dry asphalt give about 10 m/s²; twice that is no command but a
/// mistake, such as another unit or a controller that diverged.
pub const PLAUSIBLE_ACCEL_MPS2: f64 = 20.0;
/// Largest speed across the road that is believed, of either sign.
pub const PLAUSIBLE_LATERAL_MPS: f64 = 20.0;

/// What kind of fault; tables, JSON and JUnit use its word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// A program could not be started, or nobody consented to start it.
    CannotStart,
    /// A program ended, or closed its output, before it was told to.
    Ended,
    /// A program neither read nor answered in time.
    Timeout,
    /// A program answered something that is not the protocol.
    Protocol,
    /// A command beyond what any car can do.
    Implausible,
    /// A command that is no finite number.
    NotFinite,
    /// The controller reported an error of its own.
    Error,
    /// A state left the bounds within which the plant is sound.
    Physics,
}

impl FaultKind {
    /// The word used in tables and files.
    pub fn word(self) -> &'static str {
        match self {
            FaultKind::CannotStart => "cannot_start",
            FaultKind::Ended => "ended",
            FaultKind::Timeout => "timeout",
            FaultKind::Protocol => "protocol",
            FaultKind::Implausible => "implausible",
            FaultKind::NotFinite => "not_finite",
            FaultKind::Error => "error",
            FaultKind::Physics => "physics",
        }
    }
}

/// The ego or the physics failed: the episode is neither success nor held.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{message}")]
pub struct Fault {
    /// What kind.
    pub kind: FaultKind,
    /// What happened, in one line.
    pub message: String,
    /// The last of what the program wrote to stderr; empty where it wrote none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub stderr: String,
}

impl Fault {
    /// A fault of a kind, without stderr.
    pub fn new(kind: FaultKind, message: impl Into<String>) -> Fault {
        Fault {
            kind,
            message: message.into(),
            stderr: String::new(),
        }
    }

    /// What a controller reports of itself.
    pub fn error(message: impl Into<String>) -> Fault {
        Fault::new(FaultKind::Error, message)
    }

    /// The same with the end of a program's stderr.
    #[must_use]
    pub fn with_stderr(self, stderr: String) -> Fault {
        Fault { stderr, ..self }
    }
}
