//! Progress of long work, and the request to stop it.

use std::sync::atomic::{AtomicBool, Ordering};

use super::audience::{Audience, ShownEpisode};
use crate::testbench::{Actor, Aftermath, Episode, FaultLog, NoisyStart, Testbench, play};
use crate::world::Scenario;

/// Message about progress, for a person. No result depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remark<'a> {
    /// Beginning of a phase, whose counts start at 0.
    Phase {
        /// Name of the phase.
        what: &'a str,
        /// Number of the step in the command and number of steps, if known.
        step: Option<(usize, usize)>,
    },
    /// Detail of the present phase, whose counts continue.
    Detail(&'a str),
    /// Message on a line of its own.
    Line(&'a str),
}

/// Place of some work in a command.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepPlace {
    /// Steps that are not counted.
    #[default]
    Unnumbered,
    /// Step with its number, from 1.
    Step {
        /// Number of the step.
        at: usize,
        /// Number of steps.
        of: usize,
    },
    /// Part of other work, which alone reports its phases.
    Inside,
}

/// Intervals at which a training writes its progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrainingIntervals {
    /// Episodes per line of `progress.jsonl`.
    pub report_episodes: u64,
    /// Decisions between two checkpoints.
    pub checkpoint_decisions: u64,
}

impl Default for TrainingIntervals {
    fn default() -> TrainingIntervals {
        TrainingIntervals {
            report_episodes: 250,
            checkpoint_decisions: 50_000,
        }
    }
}

/// Observer of long work, which can stop it but never changes a result.
pub struct Watch<'a> {
    /// Called when `done` of `total` units of work are finished, from any thread.
    pub progress: &'a (dyn Fn(u64, u64) + Sync),
    /// Called with messages for a person.
    pub remarks: &'a (dyn Fn(Remark<'_>) + Sync),
    /// Set from outside to stop early. Finished results are kept.
    pub stop: &'a AtomicBool,
    /// Log of the faults of all episodes, which gives up on an ego that does not run.
    pub faults: FaultLog,
    /// Step of the command that is observed.
    pub place: StepPlace,
    /// Viewer of the work, if any.
    pub audience: Option<&'a dyn Audience>,
    /// Intervals at which trainings write their progress.
    pub intervals: TrainingIntervals,
}

impl<'a> Watch<'a> {
    /// Creates a watch that reports to `progress` and stops at `stop` or after a fault.
    pub fn new(progress: &'a (dyn Fn(u64, u64) + Sync), stop: &'a AtomicBool) -> Watch<'a> {
        Watch {
            progress,
            remarks: &|_| {},
            stop,
            faults: FaultLog::default(),
            place: StepPlace::Unnumbered,
            audience: None,
            intervals: TrainingIntervals::default(),
        }
    }

    /// Returns the watch with a viewer of the work.
    pub fn shown_to(&self, audience: Option<&'a dyn Audience>) -> Watch<'a> {
        Watch {
            audience,
            ..self.at(self.place)
        }
    }

    /// Shows the viewer a success, which `episode` plays again if there is room for it.
    pub(crate) fn show_success(
        &self,
        scenario: &Scenario,
        caption: &dyn Fn() -> String,
        episode: impl FnOnce() -> Episode,
    ) {
        // `is_ready` reserves the place of an episode, so nothing may return in between.
        if let Some(audience) = self.audience.filter(|audience| audience.is_ready()) {
            audience.episode(&ShownEpisode {
                scenario,
                episode: &episode(),
                caption: &caption(),
                decisions: None,
            });
        }
    }

    /// Creates a watch without reports and without a stop.
    pub fn unwatched() -> Watch<'static> {
        // A watch borrows its stop, so the flag that is never set must outlive all
        // watches.
        static GO_ON: AtomicBool = AtomicBool::new(false);
        Watch::new(&|_, _| {}, &GO_ON)
    }

    /// Returns the watch without phases, progress and viewer, for a part of other work.
    pub fn quiet(&self) -> Watch<'a> {
        Watch {
            progress: &|_, _| {},
            audience: None,
            // Lines still pass, because some of them are warnings about results.
            ..self.at(StepPlace::Inside)
        }
    }

    /// Returns the watch for the first of a number of steps.
    pub fn first_of(&self, of: usize) -> Watch<'a> {
        self.at(StepPlace::Step { at: 1, of })
    }

    /// Returns the watch for a later step. It is unnumbered if this one is.
    pub fn later(&self, by: usize) -> Watch<'a> {
        self.at(match self.place {
            StepPlace::Step { at, of } => StepPlace::Step { at: at + by, of },
            other => other,
        })
    }

    /// Returns the watch for steps that are not counted.
    pub fn unnumbered(&self) -> Watch<'a> {
        self.at(match self.place {
            StepPlace::Step { .. } => StepPlace::Unnumbered,
            other => other,
        })
    }

    fn at(&self, place: StepPlace) -> Watch<'a> {
        Watch {
            // A clone shares the log, so that all steps give up together.
            faults: self.faults.clone(),
            place,
            ..*self
        }
    }

    /// Returns whether to stop: on request, or because the ego does not run.
    pub fn stopped(&self) -> bool {
        self.interrupted() || self.faults.has_given_up()
    }

    /// Returns whether a stop was requested.
    pub fn interrupted(&self) -> bool {
        // The flag guards no other memory, so it needs no ordering.
        self.stop.load(Ordering::Relaxed)
    }

    /// Begins a phase, whose counts start at 0.
    pub fn phase(&self, what: &str) {
        let step = match self.place {
            StepPlace::Inside => return,
            StepPlace::Unnumbered => None,
            StepPlace::Step { at, of } => Some((at, of)),
        };
        (self.remarks)(Remark::Phase { what, step });
    }

    /// Reports a detail of the present phase.
    pub fn detail(&self, what: &str) {
        if self.place != StepPlace::Inside {
            (self.remarks)(Remark::Detail(what));
        }
    }

    /// Reports a line.
    pub fn note(&self, line: &str) {
        (self.remarks)(Remark::Line(line));
    }

    /// Plays an episode and notes it in the log of faults.
    ///
    /// `index` is the position of its start, by which a fault is reported.
    pub fn play(
        &self,
        bench: &mut Testbench,
        from: NoisyStart<'_>,
        index: usize,
        actor: &mut dyn Actor,
        aftermath: Aftermath,
    ) -> Episode {
        let episode = play(bench, from.start, from.noise, actor, aftermath);
        self.faults.note(index as u64, episode.fault.as_ref());
        episode
    }
}
