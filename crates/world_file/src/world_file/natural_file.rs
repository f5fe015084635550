//! Traffic of a world's ados: a model, and a limit.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use super::default_field::is_default;
use crate::ron_file::short_or_long;

/// Name of the shipped traffic model.
pub const SHIPPED: &str = "motorway";

/// Limit on the ados of a world: `natural: (per_1000_km: 3.0, traffic: "roads.ron")`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Natural", deny_unknown_fields)]
pub struct NaturalFile {
    /// Least rate of an ado's events per 1,000 km. Default: none, ados are only compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub per_1000_km: Option<f64>,
    /// Traffic model: `"motorway"`, or a file of `log --fit`. Default: `"motorway"`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub traffic: TrafficFile,
}

/// Traffic model: `"motorway"`, a file, or the content that was found there.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum TrafficFile {
    /// `"motorway"`, or a file.
    Named(String),
    /// Content of a file.
    Kept(KeptTraffic),
}

/// Traffic model in the text of a world that was loaded before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Kept", deny_unknown_fields)]
// A kept run is written `Kept(…)` as well, and a schema needs another name.
#[schemars(rename = "KeptTraffic")]
pub struct KeptTraffic {
    /// File of its origin.
    pub from: String,
    /// Model, verbatim.
    pub model: String,
}

impl Default for TrafficFile {
    fn default() -> TrafficFile {
        TrafficFile::Named(SHIPPED.to_owned())
    }
}

impl From<String> for TrafficFile {
    fn from(name: String) -> TrafficFile {
        TrafficFile::Named(name)
    }
}

impl From<KeptTraffic> for TrafficFile {
    fn from(kept: KeptTraffic) -> TrafficFile {
        TrafficFile::Kept(kept)
    }
}

// Derived as an untagged enum, it would lose the reason of a mistake in `Kept(…)`.
impl<'de> Deserialize<'de> for TrafficFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<TrafficFile, D::Error> {
        let forms = "`\"motorway\"`, a file of `log --fit` or Kept(…)";
        short_or_long::<D, String, KeptTraffic, TrafficFile>(deserializer, forms)
    }
}
