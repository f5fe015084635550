//! Run in a world file: a reference, or its content.

use std::fmt;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;
use serde::de::{self, Deserializer, MapAccess, Visitor};

use crate::ron_file::Ordered;
use crate::world::runs::{NamedRun, RunRefused, WorldOrigin, refused};

/// Whether the rules of a trained ado count in the world in which it acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub(in crate::world) enum RulesFile {
    /// It is traffic, and its rules are not judged.
    #[default]
    Unjudged,
    /// Its rules belong to the rulebook, as those of any ado.
    Judged,
}

#[derive(Deserialize)]
#[serde(rename = "Trained", deny_unknown_fields)]
pub(in crate::world) struct TrainedFile {
    pub(in crate::world) run: RunFile,
    /// Ado of the run, if it has several.
    #[serde(default)]
    pub(in crate::world) part: Option<String>,
    #[serde(default)]
    pub(in crate::world) names: Ordered<String>,
    #[serde(default)]
    pub(in crate::world) rules: RulesFile,
    /// Temperature at which its actions are drawn, instead of the best action.
    #[serde(default)]
    pub(in crate::world) temperature: Option<f64>,
}

/// Run: `"runs/acc"`, or the content that was found there.
pub(in crate::world) enum RunFile {
    Directory(String),
    Kept(KeptRun),
}

/// Run in the text of a world that was loaded before.
#[derive(Deserialize)]
#[serde(rename = "Kept", deny_unknown_fields)]
pub(in crate::world) struct KeptRun {
    /// Directory of its origin.
    from: String,
    /// World, verbatim.
    world: String,
    /// Policy: a safetensors file in base64.
    policy: String,
}

impl<'de> Deserialize<'de> for RunFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<RunFile, D::Error> {
        struct RunVisitor;
        impl<'de> Visitor<'de> for RunVisitor {
            type Value = RunFile;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a run directory such as \"runs/acc\" or Kept(…)")
            }

            fn visit_str<E: de::Error>(self, v: &str) -> Result<RunFile, E> {
                Ok(RunFile::Directory(v.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<RunFile, A::Error> {
                KeptRun::deserialize(de::value::MapAccessDeserializer::new(map)).map(RunFile::Kept)
            }
        }
        deserializer.deserialize_any(RunVisitor)
    }
}

/// Run that was read.
pub(super) struct LoadedRun {
    pub(super) from: String,
    /// Identity. `None` for a run in the text.
    pub(super) identity: Option<String>,
    pub(super) world: String,
    pub(super) policy: Vec<u8>,
}

impl LoadedRun {
    /// Returns the name of its world's file.
    pub(super) fn world_name(&self) -> String {
        format!("{}/world.ron", self.from)
    }
}

/// Returns the run that a world file refers to or contains.
pub(super) fn opened(run: &RunFile, origin: WorldOrigin<'_>) -> Result<LoadedRun, RunRefused> {
    match run {
        RunFile::Directory(name) => {
            let NamedRun {
                identity,
                world,
                policy,
            } = origin.runs.find(name, origin.file)?;
            Ok(LoadedRun {
                from: name.clone(),
                identity: Some(identity),
                world,
                policy,
            })
        }
        RunFile::Kept(kept) => from_text(kept),
    }
}

fn from_text(kept: &KeptRun) -> Result<LoadedRun, RunRefused> {
    let policy = STANDARD.decode(&kept.policy).map_err(|error| {
        refused(
            format!("the policy kept from `{}` is damaged: {error}", kept.from),
            "write `run: \"RUN\"` with a run directory instead",
        )
    })?;
    Ok(LoadedRun {
        from: kept.from.clone(),
        identity: None,
        world: kept.world.clone(),
        policy,
    })
}
