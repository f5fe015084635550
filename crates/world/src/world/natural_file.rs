//! Traffic of a world's ados for serde: a model, and a limit.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, MapAccess, Visitor};

/// Name of the shipped traffic model.
pub(super) const SHIPPED: &str = "motorway";

/// Limit on the ados of a world: `natural: (per_1000_km: 3.0, traffic: "roads.ron")`.
#[derive(Deserialize)]
#[serde(rename = "Natural", deny_unknown_fields)]
pub(super) struct NaturalFile {
    /// Least rate of an ado's events per 1,000 km. Without it, ados are only compared.
    #[serde(default)]
    pub(super) per_1000_km: Option<f64>,
    #[serde(default)]
    pub(super) traffic: TrafficFile,
}

/// Traffic model: `"motorway"`, a file, or the content that was found there.
pub(super) enum TrafficFile {
    Named(String),
    Kept(KeptTraffic),
}

/// Traffic model in the text of a world that was loaded before.
#[derive(Deserialize)]
#[serde(rename = "Kept", deny_unknown_fields)]
pub(super) struct KeptTraffic {
    /// File of its origin.
    pub(super) from: String,
    /// Model, verbatim.
    pub(super) model: String,
}

impl Default for TrafficFile {
    fn default() -> TrafficFile {
        TrafficFile::Named(SHIPPED.to_owned())
    }
}

impl<'de> Deserialize<'de> for TrafficFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<TrafficFile, D::Error> {
        struct TrafficVisitor;
        impl<'de> Visitor<'de> for TrafficVisitor {
            type Value = TrafficFile;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "`\"motorway\"`, a file of `log --fit` or Kept(…)")
            }

            fn visit_str<E: de::Error>(self, v: &str) -> Result<TrafficFile, E> {
                Ok(TrafficFile::Named(v.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<TrafficFile, A::Error> {
                let kept = KeptTraffic::deserialize(de::value::MapAccessDeserializer::new(map));
                kept.map(TrafficFile::Kept)
            }
        }
        // A name is a string and a model a struct, and only this method accepts both.
        deserializer.deserialize_any(TrafficVisitor)
    }
}
