//! Counterexamples of a training that a falsifier would have kept.
//!
//! `counterexamples.jsonl` grows with the training. The manifest states the
//! number of valid lines, so a resumed training continues the file byte for
//! byte.

use serde::{Deserialize, Serialize};

use super::{Grown, RunDir, RunError};
use crate::run_files::COUNTEREXAMPLES;
use crate::run_files::append_log::verified;
use crate::scene::{Axis, Start};
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Success, start_of};

/// Greatest number of counterexamples of a training that a run directory keeps.
///
/// A line has 100 to 250 bytes, so the file stays below 15 MB. Later
/// counterexamples are counted in the manifest.
pub(crate) const MAX_STORED: u64 = 50_000;

/// Number of counterexamples of a training, in the manifest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StoredCount {
    /// Lines of `counterexamples.jsonl`.
    pub kept: u64,
    /// Counterexamples found after the file was full.
    pub dropped: u64,
    /// Valid bytes of `counterexamples.jsonl`.
    pub bytes: u64,
    /// SHA-256 of these bytes. `None` until the first checkpoint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

impl StoredCount {
    pub(super) fn grown(&self) -> Grown {
        Grown {
            bytes: self.bytes,
            sha256: self.sha256.clone().unwrap_or_default(),
        }
    }

    pub(super) fn note(&mut self, grown: Grown) {
        self.bytes = grown.bytes;
        self.sha256 = Some(grown.sha256);
    }
}

/// Stored counterexamples of a run, for look-up by start.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    counterexamples: Vec<Success>,
    /// Reciprocal width of each axis of X_init.
    per_width: Vec<f64>,
}

impl Stored {
    /// Returns counterexamples whose starts lie in the box of `axes`.
    pub fn new(counterexamples: Vec<Success>, axes: &[Axis]) -> Stored {
        // A constant axis has no width, and all its differences are 0.
        let width = |axis: &Axis| (axis.hi - axis.lo).max(f64::MIN_POSITIVE);
        Stored {
            counterexamples,
            per_width: axes.iter().map(|axis| 1.0 / width(axis)).collect(),
        }
    }

    /// Returns all counterexamples in the order of the training.
    pub fn all(&self) -> &[Success] {
        &self.counterexamples
    }

    /// Returns the `count` nearest to a start, nearest first.
    ///
    /// Equal distances are in the order of the training. Distances are
    /// Euclidean, with each axis scaled by the width of its range.
    pub fn nearest(&self, start: &Start, count: usize) -> Vec<&Success> {
        let distance = |other: &Start| -> f64 {
            let pairs = start.0.iter().zip(&other.0).zip(&self.per_width);
            pairs.map(|((a, b), w)| ((a - b) * w).powi(2)).sum()
        };
        let all = self.counterexamples.iter().enumerate();
        let mut ranked: Vec<(f64, usize)> = all
            .map(|(position, stored)| (distance(&stored.start), position))
            .collect();
        // The position breaks ties, so the result does not depend on the
        // selection's algorithm.
        let nearer = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let count = count.min(ranked.len());
        if count > 0 && count < ranked.len() {
            // A selection before the sort, since `count` is small and the file
            // may have 50 000 lines.
            ranked.select_nth_unstable_by(count - 1, nearer);
        }
        ranked.truncate(count);
        ranked.sort_by(nearer);
        let positions = ranked.into_iter().map(|(_, position)| position);
        positions.map(|at| &self.counterexamples[at]).collect()
    }
}

impl RunDir {
    /// Appends the successes of a stretch of training, as far as there is room.
    ///
    /// They are valid once a checkpoint or the policy is saved.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses.
    pub fn append_counterexamples(&mut self, successes: &[Success]) -> Result<(), RunError> {
        // An empty list makes the entry as well, because `None` stands for a training
        // that stores nothing.
        let count = self.manifest.counterexamples.get_or_insert(StoredCount {
            kept: 0,
            dropped: 0,
            bytes: 0,
            sha256: None,
        });
        let room = MAX_STORED.saturating_sub(count.kept) as usize;
        let kept = &successes[..room.min(successes.len())];
        count.kept += kept.len() as u64;
        count.dropped += (successes.len() - kept.len()) as u64;
        let path = self.path.join(COUNTEREXAMPLES);
        let mut text = String::new();
        for success in kept {
            let line = serde_json::to_string(success).map_err(|error| RunError::Damaged {
                path: path.clone(),
                why: error.to_string(),
            })?;
            text.push_str(&line);
            text.push('\n');
        }
        self.counterexamples.append(&text)
    }

    /// Returns the counterexamples of the training.
    ///
    /// # Errors
    ///
    /// Returns an error if the training stored none or has not finished, or the file is damaged.
    pub fn counterexamples(&self) -> Result<Stored, RunError> {
        if self.manifest.is_finished() {
            self.counterexamples_so_far()
        } else {
            Err(self.unfinished())
        }
    }

    /// Returns the counterexamples up to the last checkpoint of a training, finished or not.
    ///
    /// # Errors
    ///
    /// Returns an error if the training stored none, or the file is damaged.
    pub fn counterexamples_so_far(&self) -> Result<Stored, RunError> {
        let path = self.path.join(COUNTEREXAMPLES);
        let Some(count) = &self.manifest.counterexamples else {
            let path = self.path.clone();
            return Err(RunError::NothingStored { path });
        };
        let bytes = verified(&path, &count.grown(), self.manifest.is_finished())?;
        let damaged = |line: usize, why: String| RunError::Damaged {
            path: path.clone(),
            why: format!("line {}: {why}", line + 1),
        };
        let scenario = self.scenario()?;
        let bench = scenario.bench();
        let spaces = bench.spaces();
        let bank = self.bank()?;
        let mut all = Vec::with_capacity(count.kept as usize);
        for (i, line) in String::from_utf8_lossy(&bytes).lines().enumerate() {
            let mut success: Success =
                serde_json::from_str(line).map_err(|error| damaged(i, error.to_string()))?;
            if let Some(action) = success.actions.iter().find(|&&a| spaces.actions <= a) {
                return Err(damaged(i, format!("action {action} of {}", spaces.actions)));
            }
            // JSON may lose the last bit of a number. The key restores it
            // exactly.
            (success.start, _) = start_of(&bench, self.train_key(success.index), &bank);
            all.push(success);
        }
        Ok(Stored::new(all, bench.axes()))
    }

    /// Returns the seed of the noise behind each stored counterexample, in their order.
    ///
    /// # Errors
    ///
    /// Returns an error if the bank of the training is missing or damaged.
    pub fn noise_of(&self, stored: &Stored) -> Result<Vec<u64>, RunError> {
        let (scenario, bank) = (self.scenario()?, self.bank()?);
        let bench = scenario.bench();
        let noise = |success: &Success| {
            let (_, noise) = start_of(&bench, self.train_key(success.index), &bank);
            noise
        };
        Ok(stored.all().iter().map(noise).collect())
    }

    fn train_key(&self, index: u64) -> StartKey {
        StartKey {
            purpose: Purpose::Train,
            seed: self.manifest.seed,
            index,
        }
    }
}
