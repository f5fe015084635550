//! How training went: `progress.jsonl`, a line per report of the learner.

use serde::{Deserialize, Serialize};

use super::{Row, RunDir, RunError, io_error};

pub(super) const FILE: &str = "progress.jsonl";

/// One line of `progress.jsonl`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Decisions taken so far.
    pub decisions: u64,
    /// Episodes finished so far.
    pub episodes: u64,
    /// Episodes that the shares below are over.
    pub window: u64,
    /// Episodes dropped so far for faults of the ego or the physics.
    pub aborted: u64,
    /// Share of episodes that the ado solved, exploration included.
    pub solved_share: f64,
    /// Mean return.
    pub mean_return: f64,
    /// Share of exploratory actions now.
    pub exploration: f32,
}

impl RunDir {
    /// Adds lines to `progress.jsonl`; they count once a checkpoint or the policy
    /// is saved.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn append_progress(&mut self, lines: &str) -> Result<(), RunError> {
        self.progress.append(lines)
    }

    /// What training recorded so far; lines that are cut short are left out.
    ///
    /// # Errors
    /// The disk refuses. A run that recorded nothing yet gives nothing.
    pub fn progress(&self) -> Result<Vec<Progress>, RunError> {
        let text = self.read_if_there(FILE)?;
        let lines = text.lines();
        Ok(lines
            .filter_map(|line| serde_json::from_str(line).ok())
            .collect())
    }

    /// The rows of the closing evaluation; none while there was no such.
    ///
    /// # Errors
    /// The disk refuses, or the file holds something else.
    pub fn report(&self) -> Result<Vec<Row>, RunError> {
        let text = self.read_if_there("report.json")?;
        if text.is_empty() {
            return Ok(Vec::new());
        }
        serde_json::from_str(&text).map_err(|error| RunError::Damaged {
            path: self.path().join("report.json"),
            why: error.to_string(),
        })
    }

    fn read_if_there(&self, name: &str) -> Result<String, RunError> {
        let path = self.path().join(name);
        match std::fs::read_to_string(&path) {
            Ok(text) => Ok(text),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
            Err(error) => Err(io_error("reading", &path)(error)),
        }
    }
}
