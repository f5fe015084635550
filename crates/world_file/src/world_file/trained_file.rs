//! Trained ado in a world file, with its run: a reference, or its content.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use super::default_field::is_default;
use crate::ron_file::{Ordered, short_or_long};

/// Whether the rules of a trained ado count in the world in which it acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum RulesFile {
    /// It is traffic, and its rules are not judged.
    #[default]
    Unjudged,
    /// Its rules belong to the rulebook, as those of any ado.
    Judged,
}

/// Ado that was trained in another world, frozen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Trained", deny_unknown_fields)]
pub struct TrainedFile {
    /// Run directory of the ado, or the content that was found there.
    pub run: RunFile,
    /// Ado of the run, if it has several. Default: the only one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Names of this world by names of the run's world. Default: equal names.
    #[serde(default, skip_serializing_if = "is_default")]
    pub names: Ordered<String>,
    /// Whether its rules count in this world. Default: `Unjudged`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rules: RulesFile,
    /// Temperature at which its actions are drawn. Default: always the best action.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<f64>,
}

/// Run: `"runs/acc"`, or the content that was found there.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum RunFile {
    /// Run directory.
    Directory(String),
    /// Content of a run directory.
    Kept(KeptRun),
}

/// Run in the text of a world that was loaded before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Kept", deny_unknown_fields)]
// A kept model is written `Kept(…)` as well, and a schema needs another name.
#[schemars(rename = "KeptRun")]
pub struct KeptRun {
    /// Directory of its origin.
    pub from: String,
    /// World, verbatim.
    pub world: String,
    /// Policy: a safetensors file in base64.
    pub policy: String,
}

impl From<String> for RunFile {
    fn from(directory: String) -> RunFile {
        RunFile::Directory(directory)
    }
}

impl From<KeptRun> for RunFile {
    fn from(kept: KeptRun) -> RunFile {
        RunFile::Kept(kept)
    }
}

// Derived as an untagged enum, it would lose the reason of a mistake in `Kept(…)`.
impl<'de> Deserialize<'de> for RunFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<RunFile, D::Error> {
        let forms = "a run directory such as \"runs/acc\" or Kept(…)";
        short_or_long::<D, String, KeptRun, RunFile>(deserializer, forms)
    }
}
