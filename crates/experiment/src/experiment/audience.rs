//! Viewer of work in progress.

use crate::run_dir::{Calibration, Progress};
use crate::testbench::Episode;
use crate::world::Scenario;

/// Episode worth seeing.
#[derive(Clone, Copy)]
pub struct ShownEpisode<'a> {
    /// World with the ego that was played.
    pub scenario: &'a Scenario,
    /// Episode to show.
    pub episode: &'a Episode,
    /// Sentence below the verdict: the ado, and the reason to show the episode.
    pub caption: &'a str,
    /// Numbers of its first and last training decision, if it is one of a training.
    pub decisions: Option<(u64, u64)>,
}

/// Viewer of work in progress, which receives episodes and learning curves.
///
/// No result depends on it. Its functions are called from any thread and never block.
pub trait Audience: Sync {
    /// Returns whether an episode is shown now, and takes its place: `episode` must follow.
    ///
    /// It is called before an episode is recorded, which costs time.
    fn is_ready(&self) -> bool;

    /// Shows an episode after those before it.
    fn episode(&self, shown: &ShownEpisode<'_>);

    /// Shows a report of a learner.
    fn progress(&self, progress: &Progress);

    /// Shows a calibration after so many decisions.
    fn calibration(&self, decisions: u64, calibration: &Calibration);
}
