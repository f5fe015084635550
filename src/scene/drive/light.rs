//! Traffic lights in motion.

use super::actions::Turn;
use super::spec::{Light, LightDrive};
use crate::ego::Phase;

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
