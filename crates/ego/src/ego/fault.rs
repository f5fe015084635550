//! Faults of the ego or of the physics, which count as success of neither side.

use serde::{Deserialize, Serialize};

/// Largest plausible acceleration, of either sign.
///
/// Tyres on dry asphalt give about 10 m/s². Twice that value indicates a
/// mistake, such as a wrong unit or a controller that diverged.
pub(crate) const PLAUSIBLE_ACCEL_MPS2: f64 = 20.0;
/// Largest plausible speed across the road, of either sign.
pub(crate) const PLAUSIBLE_LATERAL_MPS: f64 = 20.0;

/// Kind of a fault, with the word that tables, JSON and JUnit use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// A program could not be started, or its start was not allowed.
    CannotStart,
    /// A program ended, or closed its output, before it was asked to.
    Ended,
    /// A program neither read nor answered in time.
    Timeout,
    /// A program gave an answer that violates the protocol.
    Protocol,
    /// A command beyond the limits of any car.
    Implausible,
    /// A command that is not a finite number.
    NotFinite,
    /// The controller reported an error of its own.
    Error,
    /// A state left the bounds within which the plant is sound.
    Physics,
    /// Commands depend on earlier episodes.
    KeptState,
    /// Commands depend on draws that do not derive from the seed of `reset`.
    Random,
    /// Commands depend on the time of a clock.
    Clock,
}

impl FaultKind {
    /// Returns whether the ego ran, and its commands depend on more than the episode.
    pub fn is_unrepeatable(self) -> bool {
        matches!(
            self,
            FaultKind::KeptState | FaultKind::Random | FaultKind::Clock
        )
    }

    /// Returns the word used in tables and files.
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
            FaultKind::KeptState => "kept_state",
            FaultKind::Random => "random",
            FaultKind::Clock => "clock",
        }
    }
}

/// Fault of the ego or the physics, which makes the episode invalid.
///
/// The episode counts neither as success nor as held.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{message}")]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Description in a line.
    pub message: String,
    /// Last part of the program's stderr, or empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub stderr: String,
}

impl Fault {
    /// Creates a fault of a kind, without stderr.
    pub fn new(kind: FaultKind, message: impl Into<String>) -> Fault {
        Fault {
            kind,
            message: message.into(),
            stderr: String::new(),
        }
    }

    /// Creates the fault for an error that a controller reports.
    pub fn error(message: impl Into<String>) -> Fault {
        Fault::new(FaultKind::Error, message)
    }

    /// Returns the same fault with the last part of a program's stderr.
    #[must_use]
    pub fn with_stderr(self, stderr: String) -> Fault {
        Fault { stderr, ..self }
    }
}
