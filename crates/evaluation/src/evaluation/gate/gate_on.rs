//! Reasons that close a gate.

use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

/// Reason that closes a gate.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    VariantArray,
    EnumString,
    IntoStaticStr,
    EnumMessage,
)]
#[strum(serialize_all = "kebab-case")]
pub enum GateOn {
    /// Newly failing starts, unless the crash is shown to be unavoidable.
    #[default]
    UnlessUnavoidable,
    /// Newly failing starts that CC_LATCHED or FSM would have avoided.
    Preventable,
    /// All newly failing starts.
    Any,
    /// No newly failing start.
    Never,
    /// In addition, failures of both egos with Δv up by more than 20 %.
    Severity,
}
