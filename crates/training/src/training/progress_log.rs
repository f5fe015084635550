//! Counts of the episodes of a training, and the lines of `progress.jsonl`.

use super::stopping_rule::StoppingRule;
use crate::rl::{Learner, LearnerReport};
use crate::run_dir::{Done, Manifest, Progress, Window};
use crate::testbench::Spent;

/// Counter of episodes, which writes progress lines.
#[derive(Default)]
pub(super) struct ProgressLog {
    /// Lines that are not written yet.
    pub(super) lines: String,
    episodes: u64,
    pub(super) aborted: u64,
    /// Episodes since the last line.
    window: Window,
    /// Episodes per line.
    report_episodes: u64,
}

impl ProgressLog {
    /// Continues the counts of a run, with a line per `report_episodes`.
    pub(super) fn of(run: &Manifest, report_episodes: u64) -> ProgressLog {
        ProgressLog {
            episodes: run.episodes,
            // The window goes on, so that lines end at the same
            // episodes as without a stop.
            window: run.window,
            report_episodes,
            ..ProgressLog::default()
        }
    }

    /// Notes an episode, and returns at times the line of the recent ones.
    pub(super) fn note(&mut self, progress: &LearnerReport) -> Option<Progress> {
        self.aborted = progress.aborted;
        self.episodes = progress.episodes;
        let window = &mut self.window;
        window.episodes += 1;
        window.returns += f64::from(progress.episode_return);
        // Under Definition 4, exactly the successes have a return above 0.
        window.solved += u64::from(progress.episode_return > 0.0);
        window.losses += progress.losses.sum;
        window.updates += progress.losses.updates;
        if window.episodes < self.report_episodes {
            return None;
        }
        let line = Progress {
            decisions: progress.decisions,
            episodes: progress.episodes,
            window: window.episodes,
            aborted: progress.aborted,
            solved_share: window.solved as f64 / window.episodes as f64,
            mean_return: window.returns / window.episodes as f64,
            exploration: progress.exploration,
            mean_loss: (window.updates > 0).then(|| window.losses / window.updates as f64),
        };
        // Invariant: a line of numbers is always written.
        if let Ok(text) = serde_json::to_string(&line) {
            self.lines.push_str(&text);
            self.lines.push('\n');
        }
        self.window = Window::default();
        Some(line)
    }

    /// Returns the progress of a training for its manifest.
    pub(super) fn done(
        &self,
        learner: &dyn Learner,
        stopping: &StoppingRule<'_>,
        spent: Spent,
        cpu_s: f64,
    ) -> Done {
        Done {
            decisions_asked: stopping.requested,
            decisions: learner.decisions(),
            episodes: self.episodes,
            physics_steps: spent.physics_steps,
            cpu_s,
            window: self.window,
            calibration: stopping.calibration,
            ended: stopping.ended,
        }
    }
}
