//! Traffic lights: a phase, and what turns it.

use serde::{Deserialize, Serialize};

use super::actions::{Actions, Turn};
use super::trained::TrainedAdo;
use crate::ego::Phase;

/// A traffic light with its stop line across all lanes.
#[derive(Clone, Debug)]
pub struct Light {
    /// Name in signals.
    pub name: String,
    /// The stop line, along the road.
    pub line_m: f64,
    /// What it shows at first.
    pub phase: Phase,
    /// What turns it.
    pub drive: LightDrive,
}

/// What turns a light.
#[derive(Clone, Debug)]
pub enum LightDrive {
    /// Phases, each from its time on.
    Schedule(Schedule),
    /// A learning adversary.
    Ado {
        /// What it may choose from.
        actions: Actions,
        /// The action that leaves things alone.
        neutral: usize,
    },
    /// An ado trained elsewhere, frozen.
    Trained(TrainedAdo),
}

/// Phases, each from its time on: `[(at_s, phase), …]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Schedule(pub Vec<(f64, Phase)>);

impl Schedule {
    /// What it shows at a time; `first` before its first entry.
    fn at(&self, time_s: f64, first: Phase) -> Phase {
        let begun = self.0.iter();
        let begun = begun.take_while(|(at_s, _)| *at_s <= time_s + 1e-9);
        begun.last().map_or(first, |(_, phase)| *phase)
    }
}

/// A light in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shown {
    pub phase: Phase,
    /// The sample at which the phase began.
    pub since: usize,
}

impl Shown {
    /// As an episode begins.
    pub fn first(light: &Light) -> Shown {
        let phase = match &light.drive {
            LightDrive::Schedule(schedule) => schedule.at(0.0, light.phase),
            LightDrive::Ado { .. } | LightDrive::Trained(_) => light.phase,
        };
        Shown { phase, since: 0 }
    }

    /// Moves a scheduled light on to a time.
    pub fn keep_time(&mut self, light: &Light, time_s: f64, sample: usize) {
        if let LightDrive::Schedule(schedule) = &light.drive {
            self.show(schedule.at(time_s, light.phase), sample);
        }
    }

    /// What an ado's light does.
    pub fn turn(&mut self, turn: Turn, sample: usize) {
        if turn == Turn::Advance {
            self.show(self.phase.next(), sample);
        }
    }

    fn show(&mut self, phase: Phase, sample: usize) {
        if phase != self.phase {
            *self = Shown {
                phase,
                since: sample,
            };
        }
    }
}
