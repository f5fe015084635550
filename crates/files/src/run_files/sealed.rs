//! Seals of a run directory: the manifest's own hash, and those of the files in it.

use std::io;
use std::path::Path;

use serde::Deserialize;

use super::append_log::{Grown, verified};
use super::disk::{io_error, read_text};
use super::{
    BANK, COUNTEREXAMPLES, FORMAT, FROM, KNOWN, MANIFEST, POLICY, POPULATION, PROGRESS, RunError,
    TIMING, WORLD,
};
use crate::content_hash::{self, sha256};
use crate::ron_file::file_bytes;

/// Retired word for the training opponents.
const CONDITIONAL: &str = "conditional";

/// Fields that decide whether this version can use a run.
#[derive(Deserialize)]
struct Layout {
    format: u32,
    #[serde(default)]
    against: Option<String>,
}

/// Processor time beside the manifest, with a seal of its own.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredTiming {
    cpu_s: f64,
    seal: String,
}

/// Hashes of a run's files, as its manifest has them.
#[derive(Clone, Debug, Deserialize)]
pub struct SealedFiles {
    /// SHA-256 of the world file.
    pub world_sha256: String,
    /// SHA-256 of the policy that the training was fine-tuned from.
    #[serde(default)]
    pub from_sha256: Option<String>,
    /// SHA-256 of the episodes of other trainings.
    #[serde(default)]
    pub bank_sha256: Option<String>,
    /// SHA-256 of the failures whose rarity the training rewards.
    #[serde(default)]
    pub known_sha256: Option<String>,
    /// SHA-256 of the policy, once training has finished.
    pub policy_sha256: Option<String>,
    /// Valid part of `progress.jsonl`.
    #[serde(default)]
    pub progress: Grown,
    /// Valid part of `counterexamples.jsonl`, if the training stores any.
    #[serde(default)]
    pub counterexamples: Option<SealedCounterexamples>,
}

/// Valid part of `counterexamples.jsonl`.
#[derive(Clone, Debug, Deserialize)]
pub struct SealedCounterexamples {
    /// Number of valid bytes.
    pub bytes: u64,
    /// SHA-256 of these bytes. `None` until the first checkpoint.
    #[serde(default)]
    pub sha256: Option<String>,
}

/// Seal of a manifest, and the fields that its other files depend on.
#[derive(Deserialize)]
struct Seal {
    sha256: String,
    #[serde(default)]
    checkpoint: Option<serde::de::IgnoredAny>,
}

impl SealedFiles {
    /// Reads the manifest of a run directory, and verifies it with every file in it.
    ///
    /// # Errors
    ///
    /// Returns an error if the directory contains no run, or a file is damaged.
    pub fn open(run: &Path) -> Result<SealedFiles, RunError> {
        let text = manifest_text(run)?;
        let damaged = |why: String| RunError::Damaged {
            path: run.join(MANIFEST),
            why,
        };
        let invalid = |error: serde_json::Error| damaged(error.to_string());
        let seal: Seal = serde_json::from_str(&text).map_err(invalid)?;
        let files: SealedFiles = serde_json::from_str(&text).map_err(invalid)?;
        // Before the files, because their hashes are those of this text.
        content_hash::check(&text, &seal.sha256).map_err(damaged)?;
        let is_due = seal.checkpoint.is_some() || files.policy_sha256.is_some();
        timing_s(run, is_due)?;
        files.verify(run)?;
        Ok(files)
    }

    /// Verifies every file with a hash in the manifest.
    ///
    /// Results that are computed later then rest on the written data. The
    /// checkpoint is verified when training continues, since another process
    /// may be replacing it.
    ///
    /// # Errors
    ///
    /// Returns an error if a file is missing or damaged.
    pub fn verify(&self, run: &Path) -> Result<(), RunError> {
        read_verified(run, WORLD, Some(&self.world_sha256))?;
        if let Some(from) = &self.from_sha256 {
            read_verified(run, FROM, Some(from))?;
        }
        if let Some(bank) = &self.bank_sha256 {
            read_verified(run, BANK, Some(bank))?;
        }
        // A copy of a trained ado needs no failures of its training.
        if let (Some(known), true) = (&self.known_sha256, run.join(KNOWN).exists()) {
            read_verified(run, KNOWN, Some(known))?;
        }
        if let Some(policy) = &self.policy_sha256 {
            read_verified(run, POLICY, Some(policy))?;
        }
        let stored = self.counterexamples.as_ref().map(|stored| Grown {
            bytes: stored.bytes,
            sha256: stored.sha256.clone().unwrap_or_default(),
        });
        let files = [
            (PROGRESS, Some(self.progress.clone())),
            (COUNTEREXAMPLES, stored),
        ];
        for (name, known) in files {
            let path = run.join(name);
            // A copy of a trained ado has neither file.
            if let (Some(known), true) = (known, path.exists()) {
                verified(&path, &known, self.policy_sha256.is_some())?;
            }
        }
        Ok(())
    }

    /// Returns the bytes of the policy. `None` while training goes on.
    ///
    /// # Errors
    ///
    /// Returns an error if the file is missing or damaged.
    pub fn policy_bytes(&self, run: &Path) -> Result<Option<Vec<u8>>, RunError> {
        let hash = self.policy_sha256.as_deref();
        hash.map(|hash| read_verified(run, POLICY, Some(hash)))
            .transpose()
    }
}

/// Returns the text of a run's manifest, in a layout that this version can use.
///
/// # Errors
///
/// Returns an error if the directory contains no run of this layout.
pub fn manifest_text(run: &Path) -> Result<String, RunError> {
    let not_a_run = |why: String| RunError::NotARun {
        path: run.into(),
        why,
    };
    if !run.is_dir() {
        let why = if run.exists() {
            "it is a file"
        } else {
            "there is no such directory"
        };
        return Err(not_a_run(why.to_owned()));
    }
    let file = run.join(MANIFEST);
    // Before the general message, which would not name the members.
    if !file.is_file() && run.join(POPULATION).is_file() {
        return Err(RunError::Population { path: run.into() });
    }
    if !file.is_file() {
        return Err(not_a_run(format!("it has no `{MANIFEST}`")));
    }
    let text = read_text(&file)?;
    let damaged = |why: String| RunError::Damaged { path: file, why };
    // The version comes first, because another layout may lack any field.
    let Layout { format, against } = match serde_json::from_str(&text) {
        Ok(layout) => layout,
        Err(error) => return Err(damaged(error.to_string())),
    };
    // Any other version, since a newer layout may give a field another
    // meaning.
    if format != FORMAT {
        return Err(damaged(format!("format {format} is not {FORMAT}")));
    }
    if against.as_deref() == Some(CONDITIONAL) {
        return Err(RunError::Conditional { path: run.into() });
    }
    Ok(text)
}

/// Returns the processor time from the file beside the manifest.
///
/// It is 0 before the first checkpoint. With `is_due` the file must exist.
///
/// # Errors
///
/// Returns an error if the file is missing or damaged.
pub fn timing_s(run: &Path, is_due: bool) -> Result<f64, RunError> {
    let path = &run.join(TIMING);
    let damaged = |why: String| RunError::Damaged {
        path: path.into(),
        why,
    };
    if !path.is_file() {
        // It is written before every checkpoint and before the policy.
        return if is_due {
            Err(RunError::Damaged {
                path: path.into(),
                why: "it is missing".to_owned(),
            })
        } else {
            Ok(0.0)
        };
    }
    let text = read_text(path)?;
    let read: StoredTiming =
        serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
    content_hash::check(&text, &read.seal).map_err(damaged)?;
    Ok(read.cpu_s)
}

/// Returns the bytes of a run's file, which must have the expected hash, if any.
///
/// # Errors
///
/// Returns an error if the file is missing or damaged.
pub fn read_verified(run: &Path, name: &str, expected: Option<&str>) -> Result<Vec<u8>, RunError> {
    let path = run.join(name);
    let bytes = file_bytes(&path).map_err(|source| match source.kind() {
        // The manifest is there, so it is a run that lost a file.
        io::ErrorKind::NotFound => RunError::Damaged {
            path: path.clone(),
            why: "it is missing".to_owned(),
        },
        _ => io_error("reading", &path)(source),
    })?;
    let found = sha256(&bytes);
    match expected {
        Some(expected) if expected != found => Err(RunError::Damaged {
            path,
            why: format!("SHA-256 is {found}, the manifest says {expected}"),
        }),
        _ => Ok(bytes),
    }
}
