//! Progress of a training: `progress.jsonl`, with a line per report of the learner.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{Row, RunDir, RunError};
use crate::content_hash;
use crate::ron_file::file_text;
use crate::run_files::PROGRESS;
use crate::run_files::append_log::verified;
use crate::run_files::disk::io_error;

const REPORT: &str = "report.json";

/// Content of `report.json`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ReportFile<'a> {
    /// First field, so that no name in a row is mistaken for it.
    seal: String,
    rows: Cow<'a, [Row]>,
}

/// Line of `progress.jsonl`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Decisions taken so far.
    pub decisions: u64,
    /// Episodes finished so far.
    pub episodes: u64,
    /// Number of episodes that the shares below cover.
    pub window: u64,
    /// Episodes dropped so far for faults of the ego or the physics.
    pub aborted: u64,
    /// Share of episodes that the ado solved, including exploration.
    pub solved_share: f64,
    /// Mean return.
    pub mean_return: f64,
    /// Current share of exploratory actions.
    pub exploration: f32,
    /// Mean loss of the learner's updates. `None`: it made no update.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_loss: Option<f64>,
}

impl RunDir {
    /// Appends lines to `progress.jsonl`.
    ///
    /// They are valid once a checkpoint or the policy is saved.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses.
    pub fn append_progress(&mut self, lines: &str) -> Result<(), RunError> {
        self.progress.append(lines)
    }

    /// Returns the progress up to the last checkpoint.
    ///
    /// It is empty for a run without any progress yet.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses, or the file differs from the
    /// manifest.
    pub fn progress(&self) -> Result<Vec<Progress>, RunError> {
        let manifest = self.manifest();
        let path = self.path().join(PROGRESS);
        // While a training runs, lines beyond the last checkpoint are usual. Later they
        // are damage.
        let bytes = verified(&path, &manifest.progress, manifest.is_finished())?;
        // The hash was verified, so these are the very bytes that were written.
        let text = String::from_utf8_lossy(&bytes);
        let lines = text.lines().map(serde_json::from_str);
        lines
            .collect::<Result<_, _>>()
            .map_err(|error| RunError::Damaged {
                path,
                why: error.to_string(),
            })
    }

    /// Stores the rows of the closing evaluation.
    ///
    /// They have a seal of their own, because they contain processor times.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses.
    pub fn save_report(&self, rows: &[Row]) -> Result<(), RunError> {
        let report = ReportFile {
            rows: Cow::Borrowed(rows),
            seal: content_hash::BLANK.to_owned(),
        };
        let text = serde_json::to_string_pretty(&report).map_err(|error| RunError::Damaged {
            path: self.path().join(REPORT),
            why: error.to_string(),
        })?;
        self.write(REPORT, content_hash::seal(&text).as_bytes())
    }

    /// Returns the rows of the closing evaluation, if any.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses, the seal is broken, or the content
    /// is invalid.
    pub fn report(&self) -> Result<Vec<Row>, RunError> {
        let text = self.read_if_there(REPORT)?;
        // A report is written as a whole, so an empty text means that there is none.
        if text.is_empty() {
            return Ok(Vec::new());
        }
        let damaged = |why: String| RunError::Damaged {
            path: self.path().join(REPORT),
            why,
        };
        let report: ReportFile<'_> =
            serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
        // The text names its own seal, so it is parsed before it is checked.
        content_hash::check(&text, &report.seal).map_err(damaged)?;
        Ok(report.rows.into_owned())
    }

    fn read_if_there(&self, name: &str) -> Result<String, RunError> {
        let path = self.path().join(name);
        match file_text(&path) {
            Ok(text) => Ok(text),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
            Err(error) => Err(io_error("reading", &path)(error)),
        }
    }
}
