//! Drivers that others are measured by.

use serde::{Deserialize, Serialize};

/// Stub.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ReferenceDriver {
    /// Stub.
    #[serde(rename = "RSS")]
    Rss,
}
