//! How a campaign reports and is asked to stop.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::scene::Start;
use crate::testbench::{Actor, Aftermath, Episode, FaultLog, Testbench, play};

/// What a campaign says on its way, for people; no result depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remark<'a> {
    /// What is done now; counts begin anew.
    Phase {
        /// What it is.
        what: &'a str,
        /// Which step of the command it is, and of how many, if that is known.
        step: Option<(usize, usize)>,
    },
    /// What is known of the present phase; counts go on.
    Detail(&'a str),
    /// Something that is worth a line.
    Line(&'a str),
}

/// Where in a command some work is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepPlace {
    /// Nobody counted the steps.
    #[default]
    Unnumbered,
    /// One of the steps, counted from 1.
    Step {
        /// Which.
        at: usize,
        /// Of how many.
        of: usize,
    },
    /// Inside of other work, which alone says what is done.
    Inside,
}

/// How a campaign reports and is asked to stop; it never changes a result.
pub struct Watch<'a> {
    /// Called when `done` of `total` units of work are finished, from any thread.
    pub progress: &'a (dyn Fn(u64, u64) + Sync),
    /// Called with what a person may want to read.
    pub remarks: &'a (dyn Fn(Remark<'_>) + Sync),
    /// Set from outside to stop early; what was computed is kept.
    pub stop: &'a AtomicBool,
    /// Is told of every episode, and gives up on an ego that does not run.
    pub faults: FaultLog,
    /// Which step of a command is watched.
    pub place: StepPlace,
}

impl<'a> Watch<'a> {
    /// Reports to `progress` and stops when `stop` is set or the ego is given up.
    pub fn new(progress: &'a (dyn Fn(u64, u64) + Sync), stop: &'a AtomicBool) -> Watch<'a> {
        Watch {
            progress,
            remarks: &|_| {},
            stop,
            faults: FaultLog::default(),
            place: StepPlace::Unnumbered,
        }
    }

    /// Reports to nobody, and is stopped by nobody.
    pub fn unwatched() -> Watch<'static> {
        static GO_ON: AtomicBool = AtomicBool::new(false);
        Watch::new(&|_, _| {}, &GO_ON)
    }

    /// The same without phases and progress: for work that is part of some other.
    pub fn quiet(&self) -> Watch<'a> {
        Watch {
            progress: &|_, _| {},
            ..self.at(StepPlace::Inside)
        }
    }

    /// The same for the first of so many steps.
    pub fn first_of(&self, of: usize) -> Watch<'a> {
        self.at(StepPlace::Step { at: 1, of })
    }

    /// The same for a step so many behind this one; unnumbered if this one is.
    pub fn later(&self, by: usize) -> Watch<'a> {
        self.at(match self.place {
            StepPlace::Step { at, of } => StepPlace::Step { at: at + by, of },
            other => other,
        })
    }

    /// The same for steps that nobody counted.
    pub fn unnumbered(&self) -> Watch<'a> {
        self.at(match self.place {
            StepPlace::Step { .. } => StepPlace::Unnumbered,
            other => other,
        })
    }

    fn at(&self, place: StepPlace) -> Watch<'a> {
        Watch {
            faults: self.faults.clone(),
            place,
            ..*self
        }
    }

    /// Whether there is no point in going on: somebody asked to stop, or the
    /// ego does not run.
    pub fn stopped(&self) -> bool {
        self.interrupted() || self.faults.has_given_up()
    }

    /// Whether somebody asked to stop.
    pub fn interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Says what is done now; what is counted then begins anew.
    pub fn phase(&self, what: &str) {
        let step = match self.place {
            StepPlace::Inside => return,
            StepPlace::Unnumbered => None,
            StepPlace::Step { at, of } => Some((at, of)),
        };
        (self.remarks)(Remark::Phase { what, step });
    }

    /// Says what is known of the present phase.
    pub fn detail(&self, what: &str) {
        if self.place != StepPlace::Inside {
            (self.remarks)(Remark::Detail(what));
        }
    }

    /// Says something that is worth a line.
    pub fn note(&self, line: &str) {
        (self.remarks)(Remark::Line(line));
    }

    /// Plays an episode and tells the log of faults about it.
    ///
    /// `index` is the position of its start, by which a fault is reported.
    pub fn play(
        &self,
        bench: &mut Testbench,
        (start, noise): (&Start, u64),
        index: usize,
        actor: &mut dyn Actor,
        aftermath: Aftermath,
    ) -> Episode {
        let episode = play(bench, start, noise, actor, aftermath);
        self.faults.note(index as u64, episode.fault.as_ref());
        episode
    }
}
