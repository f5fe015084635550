//! What a falsifier would have kept of a training: its counterexamples.
//!
//! `counterexamples.jsonl` grows with the progress of a training. The manifest
//! says how many of its lines count, so that a resumed training continues it
//! byte for byte.

use std::fs::{self, OpenOptions};
use std::io::Write;

use serde::{Deserialize, Serialize};

use super::{RunDir, RunError, io_error, sha256, write_file};
use crate::scene::{Axis, Start};
use crate::seed::{Purpose, StartKey};
use crate::testbench::Success;

const FILE: &str = "counterexamples.jsonl";

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
    /// SHA-256 of `counterexamples.jsonl`, once training has finished.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
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
        OpenOptions::new()
            .create(true)
            .append(true)
            .open(&path)
            .and_then(|mut file| file.write_all(text.as_bytes()))
            .map_err(io_error("writing", &path))
    }

    /// Cuts `counterexamples.jsonl` back to what the checkpoint knows.
    ///
    /// # Errors
    /// The disk refuses, or lines are missing.
    pub fn trim_counterexamples(&self) -> Result<(), RunError> {
        let path = self.path.join(FILE);
        let known = self.manifest.counterexamples.as_ref();
        let known = known.map_or(0, |count| count.kept) as usize;
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(_) if known == 0 => return Ok(()),
            Err(error) => return Err(io_error("reading", &path)(error)),
        };
        let lines: Vec<&str> = text.split_inclusive('\n').take(known).collect();
        if lines.len() < known {
            return Err(RunError::Damaged {
                path,
                why: format!("it has {} lines, the manifest says {known}", lines.len()),
            });
        }
        write_file(&path, lines.concat().as_bytes())
    }

    /// Notes the hash of `counterexamples.jsonl` for the manifest.
    pub(super) fn seal_counterexamples(&mut self) -> Result<(), RunError> {
        let path = self.path.join(FILE);
        if let Some(count) = &mut self.manifest.counterexamples {
            let bytes = fs::read(&path).map_err(io_error("reading", &path))?;
            count.sha256 = Some(sha256(&bytes));
        }
        Ok(())
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
