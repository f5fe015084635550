//! Manifest of a population.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::content_hash;
use crate::run_dir::{POPULATION, RunError};
use crate::run_files::append_log::Grown;
use crate::run_files::disk::read_text;
use crate::scene::Dynamics;

/// Version of the layout. Other versions are refused.
pub(super) const FORMAT: u32 = 1;

/// Process that made a population, with its settings.
///
/// A population is resumed under the same settings only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum PopulationOrigin {
    /// Training of members that fail the ego in different cells.
    Distinct {
        /// Simulations of each search of the archive.
        simulations: u64,
    },
    /// Alternating best responses of egos and ados.
    League {
        /// Rounds after the first ado.
        rounds: usize,
        /// Starts of the payoffs.
        #[serde(default = "payoff_starts")]
        payoff_starts: usize,
        /// Starts of the search for a response of the ego.
        #[serde(default = "response_starts")]
        response_starts: usize,
    },
}

/// Usual starts of the payoffs of a league, and of the search for a response of the ego.
pub(super) const PAYOFF_STARTS: usize = 100;
pub(super) const RESPONSE_STARTS: usize = 40;

// Leagues that recorded neither number had the usual ones.
fn payoff_starts() -> usize {
    PAYOFF_STARTS
}

fn response_starts() -> usize {
    RESPONSE_STARTS
}

impl PopulationOrigin {
    /// Returns the name of the growing file.
    pub(super) fn curve_file(&self) -> &'static str {
        match self {
            PopulationOrigin::Distinct { .. } => "coverage.jsonl",
            PopulationOrigin::League { .. } => "league.jsonl",
        }
    }
}

/// Finished member of a population.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PopulationMember {
    /// SHA-256 of the member's `manifest.json`, which covers its other files.
    pub manifest_sha256: String,
}

/// Archive of failures that a population has filled.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArchiveSummary {
    /// Occupied cells.
    pub cells: usize,
    /// Failures counted in these cells.
    pub failures: u64,
    /// Simulations spent on the archive, including those that label failures.
    pub simulations: u64,
    /// File of the archive in the directory.
    pub file: String,
    /// SHA-256 of the file.
    pub sha256: String,
}

/// Properties of a population, and the hashes of its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PopulationManifest {
    /// Version of the layout.
    pub(super) format: u32,
    /// SHA-256 of the file with zeros in its place.
    pub(super) sha256: String,
    /// Version of the program.
    pub(super) brakecheck: String,
    /// Name of the world.
    pub world: String,
    /// SHA-256 of the world file.
    pub(super) world_sha256: String,
    /// Plant of the trainings.
    pub plant: Dynamics,
    /// Seed of the population.
    pub seed: u64,
    /// Process that made the population.
    pub origin: PopulationOrigin,
    /// Number of members requested.
    pub requested: usize,
    /// Finished members, in order.
    pub members: Vec<PopulationMember>,
    /// Archive of failures. `None` if the process has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub archive: Option<ArchiveSummary>,
    /// Valid part of `coverage.jsonl`, or of a league's `league.jsonl`.
    #[serde(default, skip_serializing_if = "Grown::is_nothing")]
    pub(super) coverage: Grown,
    /// Whether the process has ended.
    pub finished: bool,
}

impl PopulationManifest {
    /// Reads and verifies the manifest of a population.
    ///
    /// # Errors
    /// It is missing, damaged, or of another format.
    pub(super) fn read(path: &Path) -> Result<PopulationManifest, RunError> {
        let file = path.join(POPULATION);
        // A directory of another kind is not a damaged population.
        if !file.is_file() {
            return Err(RunError::NotARun {
                path: path.into(),
                why: format!("it has no `{POPULATION}`"),
            });
        }
        let damaged = |why: String| RunError::Damaged {
            path: file.clone(),
            why,
        };
        let text = read_text(&file)?;
        let manifest: PopulationManifest =
            serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
        // Checked before the hash, because another format may seal its text differently.
        if manifest.format != FORMAT {
            return Err(damaged(format!(
                "format {} is not {FORMAT}",
                manifest.format
            )));
        }
        content_hash::check(&text, &manifest.sha256).map_err(damaged)?;
        Ok(manifest)
    }

    /// Returns the text of its file, with the hash.
    pub(super) fn sealed(&self) -> Result<String, serde_json::Error> {
        let blank = PopulationManifest {
            sha256: content_hash::BLANK.to_owned(),
            ..self.clone()
        };
        // The field comes before all texts that could contain as many zeros.
        serde_json::to_string_pretty(&blank).map(|text| content_hash::seal(&text))
    }
}
