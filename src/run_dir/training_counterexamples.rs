//! What a falsifier would have kept of a training: its counterexamples.
//!
//! `counterexamples.jsonl` grows with the progress of a training. The manifest
//! says how many of its lines count, so that a resumed training continues it
//! byte for byte.

use serde::{Deserialize, Serialize};

use super::{Grown, RunDir, RunError};
use crate::scene::{Axis, Start};
use crate::seed::{Purpose, StartKey};
use crate::testbench::Success;

pub(super) const FILE: &str = "counterexamples.jsonl";

/// Counterexamples that a run directory keeps of its training, at most.
///
/// A line is 100 to 250 bytes long, so the file stays below 15 MB. Those that
/// come later are counted in the manifest.
pub const MAX_STORED: u64 = 50_000;

/// How many counterexamples a training brought, in the manifest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredCount {
    /// Lines of `counterexamples.jsonl`.
    pub kept: u64,
    /// Those that came when it was full.
    pub dropped: u64,
    /// Bytes of `counterexamples.jsonl` that count; 0 in runs of old.
    #[serde(default)]
    pub bytes: u64,
    /// SHA-256 of those; in runs of old once training has finished.
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

/// The stored counterexamples of a run, to be looked up by their starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    counterexamples: Vec<Success>,
    /// One per axis of X_init: the reciprocal of its width.
    per_width: Vec<f64>,
}

impl Stored {
    /// Counterexamples whose starts lie in the box of `axes`.
    pub fn new(counterexamples: Vec<Success>, axes: &[Axis]) -> Stored {
        let width = |axis: &Axis| (axis.hi - axis.lo).max(f64::MIN_POSITIVE);
        Stored {
            counterexamples,
            per_width: axes.iter().map(|axis| 1.0 / width(axis)).collect(),
        }
    }

    /// All of them, in the order of the training.
    pub fn all(&self) -> &[Success] {
        &self.counterexamples
    }

    /// The `count` nearest to a start, nearest first, the older of equals.
    ///
    /// Distances are Euclidean, each axis scaled by the width of its range.
    pub fn nearest(&self, start: &Start, count: usize) -> Vec<&Success> {
        let distance = |other: &Start| -> f64 {
            let pairs = start.0.iter().zip(&other.0).zip(&self.per_width);
            pairs.map(|((a, b), w)| ((a - b) * w).powi(2)).sum()
        };
        let all = self.counterexamples.iter().enumerate();
        let mut ranked: Vec<(f64, usize)> = all
            .map(|(position, stored)| (distance(&stored.start), position))
            .collect();
        let nearer = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let count = count.min(ranked.len());
        if 0 < count && count < ranked.len() {
            ranked.select_nth_unstable_by(count - 1, nearer);
        }
        ranked.truncate(count);
        ranked.sort_by(nearer);
        let positions = ranked.into_iter().map(|(_, position)| position);
        positions.map(|at| &self.counterexamples[at]).collect()
    }
}

impl RunDir {
    /// Adds the successes of a stretch of training, as far as there is room.
    ///
    /// What was added counts once a checkpoint or the policy is saved.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn append_counterexamples(&mut self, successes: &[Success]) -> Result<(), RunError> {
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
        let path = self.path.join(FILE);
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

    /// The counterexamples that its training brought.
    ///
    /// # Errors
    /// It was trained by a version that stored none, training has not finished,
    /// or the file is damaged.
    pub fn counterexamples(&self) -> Result<Stored, RunError> {
        let path = self.path.join(FILE);
        if !self.manifest.is_finished() {
            return Err(self.unfinished());
        }
        let Some(count) = &self.manifest.counterexamples else {
            let path = self.path.clone();
            return Err(RunError::NothingStored { path });
        };
        let bytes = self.read_verified(FILE, count.sha256.as_deref())?;
        let damaged = |line: usize, why: String| RunError::Damaged {
            path: path.clone(),
            why: format!("line {}: {why}", line + 1),
        };
        let scenario = self.scenario()?;
        let bench = scenario.bench();
        let spaces = bench.spaces();
        let mut all = Vec::with_capacity(count.kept as usize);
        for (i, line) in String::from_utf8_lossy(&bytes).lines().enumerate() {
            let mut success: Success =
                serde_json::from_str(line).map_err(|error| damaged(i, error.to_string()))?;
            if let Some(action) = success.actions.iter().find(|&&a| spaces.actions <= a) {
                return Err(damaged(i, format!("action {action} of {}", spaces.actions)));
            }
            // JSON may lose the last bit of a number, the key loses nothing.
            success.start = bench.draw(StartKey {
                purpose: Purpose::Train,
                seed: self.manifest.seed,
                index: success.index,
            });
            all.push(success);
        }
        Ok(Stored::new(all, bench.axes()))
    }
}
