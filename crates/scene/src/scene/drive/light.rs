//! Traffic lights: their phases and the drives that change them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::actions::{Actions, PhaseAction};
use super::trained::TrainedAdo;
use crate::ego::Phase;

/// A traffic light with its stop line across all lanes of a road.
#[derive(Clone, Debug)]
pub struct Light {
    /// Name in signals.
    pub name: String,
    /// Index of its road: 0 is the world's own, named ones follow in order.
    pub road: usize,
    /// Position of the stop line along that road.
    pub line_m: f64,
    /// Initial phase.
    pub phase: Phase,
    /// Source of its phase changes.
    pub drive: LightDrive,
}

/// Source of the phase changes of a light.
#[derive(Clone, Debug)]
pub enum LightDrive {
    /// A fixed schedule.
    Schedule(Schedule),
    /// A learning adversary.
    Ado {
        /// Action set.
        actions: Actions,
        /// Action that changes nothing.
        neutral: usize,
    },
    /// An ado that was trained in a different world, frozen.
    Trained(TrainedAdo),
}

/// Phases with their start times: `[(at_s, phase), …]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Schedule(pub Vec<(f64, Phase)>);

impl Schedule {
    /// Returns the phase at a time, `first` before the first entry.
    fn at(&self, time_s: f64, first: Phase) -> Phase {
        let entries = self.0.iter();
        // Times of samples are products and may lie just below the written
        // value.
        let begun = entries.take_while(|(at_s, _)| *at_s <= time_s + 1e-9);
        begun.last().map_or(first, |(_, phase)| *phase)
    }
}

/// Current phase of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LightState {
    pub phase: Phase,
    /// The sample at which the phase began.
    pub since: usize,
    /// Whether a story has set it, which ends its schedule.
    is_set_by_story: bool,
}

impl LightState {
    /// Returns the phase at the start of an episode.
    pub(super) fn first(light: &Light) -> LightState {
        let phase = match &light.drive {
            LightDrive::Schedule(schedule) => schedule.at(0.0, light.phase),
            LightDrive::Ado { .. } | LightDrive::Trained(_) => light.phase,
        };
        LightState {
            phase,
            since: 0,
            is_set_by_story: false,
        }
    }

    /// Updates a scheduled light to a time.
    pub(super) fn keep_time(&mut self, light: &Light, time_s: f64, sample: usize) {
        if let LightDrive::Schedule(schedule) = &light.drive
            && !self.is_set_by_story
        {
            self.show(schedule.at(time_s, light.phase), sample);
        }
    }

    /// Applies the action of an ado's light.
    pub(super) fn turn(&mut self, turn: PhaseAction, sample: usize) {
        if turn == PhaseAction::Advance {
            self.show(self.phase.next(), sample);
        }
    }

    /// Shows a phase from now on, whatever its schedule states.
    pub(super) fn set(&mut self, phase: Phase, sample: usize) {
        self.is_set_by_story = true;
        self.show(phase, sample);
    }

    fn show(&mut self, phase: Phase, sample: usize) {
        // `since` is the start of the phase, so showing the same phase again
        // keeps it.
        if phase != self.phase {
            *self = LightState {
                phase,
                since: sample,
                ..*self
            };
        }
    }
}
