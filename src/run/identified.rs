//! What `identify` found, as a file: parameters of egos seen from outside.

use std::path::{Path, PathBuf};

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::{RunError, write_file};
use crate::scenario::Change;

/// Version of the file; another one is refused.
const FORMAT: u32 = 1;

/// The parameters of some egos of a world, and where they come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentifiedEgos {
    /// Version of the file.
    pub format: u32,
    /// Version of the program that fitted them.
    pub brakecheck: String,
    /// Name of the world.
    pub world: String,
    /// SHA-256 of the world file.
    pub world_sha256: String,
    /// Seed of the recorded runs and of the fits.
    pub seed: u64,
    /// The egos by name.
    pub egos: IndexMap<String, IdentifiedEgo>,
}

/// The parameters of one ego.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentifiedEgo {
    /// A value for every quantity of the family.
    pub parameters: IndexMap<String, f64>,
    /// Standard deviation of each over independent fits.
    pub spread: IndexMap<String, f64>,
    /// Quantities that were fitted but do not show in the runs: nominal.
    pub hidden: Vec<String>,
    /// Whether the parameters explain the ego.
    pub explains: bool,
    /// Root mean square distance from the ego; 1 m/s counts like 1 m.
    pub residual_m: f64,
    /// The same of the nominal ego.
    pub nominal_residual_m: f64,
    /// How much of it the ego's noise alone may make.
    pub noise_m: f64,
    /// The residuals of all independent fits.
    pub refits_m: Vec<f64>,
    /// Runs recorded of the ego.
    pub recorded: u64,
    /// Runs simulated of members of the family.
    pub simulations: u64,
    /// How it differs from the world's own; `None` in files of old.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<Change>,
    /// What the ado is better told, if that was looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adapted: Option<AdaptedEgo>,
}

/// What a conditional ado is best told of an ego, by how it fared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdaptedEgo {
    /// SHA-256 of the policy it was found for.
    pub policy_sha256: String,
    /// What the ado is best told: a value for every quantity of the family.
    pub parameters: IndexMap<String, f64>,
    /// What is worth a further try.
    pub others: Vec<IndexMap<String, f64>>,
    /// Whether these are other parameters than it would be told otherwise.
    pub is_better: bool,
    /// What it would be told otherwise: `identified` or `nominal` parameters.
    pub otherwise: String,
    /// Share of `starts` that the ado solves when it is told `parameters`.
    pub success_rate: f64,
    /// The same when it is told what it would be otherwise.
    pub otherwise_success_rate: f64,
    /// Starts of the last race, by which both were compared.
    pub starts: u64,
    /// Members tried.
    pub tried: usize,
    /// Runs of the ego simulated.
    pub simulations: u64,
    /// Those among them in which the ego failed to run.
    pub invalid: u64,
}

/// A file of identified egos could not be used.
#[derive(Debug, thiserror::Error)]
pub enum IdentifiedError {
    /// It could not be read or written.
    #[error(transparent)]
    Run(#[from] RunError),
    /// It is no such file.
    #[error("`{path}` holds no identified egos: {why}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong in it.
        why: String,
    },
}

impl IdentifiedEgos {
    /// No ego yet, of a run's world.
    pub fn new(world: &str, world_sha256: &str, seed: u64) -> IdentifiedEgos {
        IdentifiedEgos {
            format: FORMAT,
            brakecheck: env!("CARGO_PKG_VERSION").to_owned(),
            world: world.to_owned(),
            world_sha256: world_sha256.to_owned(),
            seed,
            egos: IndexMap::new(),
        }
    }

    /// Reads such a file.
    ///
    /// # Errors
    /// It cannot be read, is none, or a number in it is not finite.
    pub fn load(path: &Path) -> Result<IdentifiedEgos, IdentifiedError> {
        let text = std::fs::read_to_string(path).map_err(|source| RunError::Io {
            verb: "reading",
            path: path.into(),
            source,
        })?;
        let format = |why: String| IdentifiedError::Format {
            path: path.into(),
            why,
        };
        let read: IdentifiedEgos =
            ron::from_str(&text).map_err(|error| format(error.to_string()))?;
        if read.format != FORMAT {
            return Err(format(format!("format {} is not {FORMAT}", read.format)));
        }
        for (name, ego) in &read.egos {
            let adapted = ego.adapted.iter();
            let mut values = adapted
                .flat_map(|adapted| adapted.others.iter().chain([&adapted.parameters]))
                .chain([&ego.parameters])
                .flat_map(|member| member.values());
            if values.any(|value| !value.is_finite()) {
                return Err(format(format!("a value of `{name}` is not finite")));
            }
        }
        Ok(read)
    }

    /// Writes it.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn save(&self, path: &Path) -> Result<(), IdentifiedError> {
        let pretty = ron::ser::PrettyConfig::new().struct_names(true);
        let text = ron::ser::to_string_pretty(self, pretty);
        let text = text.map_err(|error| IdentifiedError::Format {
            path: path.into(),
            why: error.to_string(),
        })?;
        write_file(path, format!("{text}\n").as_bytes())?;
        Ok(())
    }
}
