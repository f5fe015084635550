//! Driver of a model's ego: repeats the recorded motion and then follows the surrogate.

use std::sync::{Arc, Mutex, PoisonError};

use super::ego_motion::MotionSample;
use super::emergency_brake::Situation;
use super::features::ModelInputs;
use super::model::Surrogate;
use super::model_fit::EgoInputs;
use crate::ego::{Briefing, Command, Controller, Fault, Percept};
use crate::scene::drive::ControllerFactory;

/// Largest acceleration of a car, m/s².
const MOST_ACCEL_MPS2: f64 = 15.0;
/// Largest lateral speed of a car, m/s.
const MOST_LATERAL_MPS: f64 = 4.0;

/// Behaviour of a model's driver in the next episode.
#[derive(Clone, Debug, Default)]
pub(super) struct ModelDriverConfig {
    /// Recorded motion of the ego, which is repeated sample by sample.
    pub known: Arc<[MotionSample]>,
    /// Behaviour afterwards. `None`: constant acceleration.
    pub surrogate: Option<Arc<Surrogate>>,
    /// Member of the ensemble. `None`: the mean of all.
    pub member: Option<usize>,
    /// Jerk added to every answer, which makes the ego more or less careful.
    pub bias_mps3: f64,
    /// Record of the percepts of every sample.
    pub inputs: Option<Arc<Mutex<EgoInputs>>>,
}

/// Slot that hands a part to the driver of a model at the start of an episode.
#[derive(Clone, Debug, Default)]
pub(super) struct ModelDriverSlot(Arc<Mutex<ModelDriverConfig>>);

impl ModelDriverSlot {
    pub(super) fn set(&self, config: ModelDriverConfig) {
        // A value that is replaced as a whole is sound even after a panic elsewhere.
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = config;
    }

    fn take(&self) -> ModelDriverConfig {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Returns a factory of drivers that play the parts given here.
    pub(super) fn factory(&self) -> ControllerFactory {
        let driver_slot = self.clone();
        Arc::new(move || {
            Box::new(ModelDriver {
                driver_slot: driver_slot.clone(),
                config: ModelDriverConfig::default(),
                briefing: Briefing::default(),
                model_inputs: ModelInputs::default(),
                row: Vec::new(),
                scaled: Vec::new(),
                sample: 0,
            })
        })
    }
}

/// Driver that repeats the recorded motion and then follows the surrogate.
#[derive(Clone)]
struct ModelDriver {
    driver_slot: ModelDriverSlot,
    config: ModelDriverConfig,
    briefing: Briefing,
    model_inputs: ModelInputs,
    row: Vec<f32>,
    scaled: Vec<f32>,
    sample: usize,
}

impl ModelDriver {
    fn command(&mut self, percept: &Percept) -> Command {
        let own = &percept.own;
        let known = &self.config.known;
        if let (Some(here), Some(next)) = (known.get(self.sample), known.get(self.sample + 1)) {
            // The command starts from the model's own speed, so deviations are corrected.
            return Command {
                accel_mps2: (next.speed_mps - own.speed_mps) / percept.sample_s,
                lateral_mps: (next.lateral_m - here.lateral_m) / percept.sample_s,
            };
        }
        // The yardstick of every surrogate is an ego that keeps its acceleration.
        let Some(surrogate) = &self.config.surrogate else {
            return Command::accelerate(own.accel_mps2);
        };
        let [change_mps2, lateral_mps] =
            surrogate.answer(self.config.member, &self.row, &mut self.scaled);
        let braking_mps2 = surrogate
            .brake
            .and_then(|brake| brake.change_mps2(&Situation::of(percept)));
        // The brake only adds braking, so the harder of both applies.
        let change_mps2 = braking_mps2.map_or(change_mps2, |braking| change_mps2.min(braking));
        let accel_mps2 = own.accel_mps2 + change_mps2 + self.config.bias_mps3 * percept.sample_s;
        // A prediction outside the recorded range would be an extrapolation.
        let [least, most] = surrogate.range_mps2;
        Command {
            accel_mps2: accel_mps2.clamp(least, most),
            lateral_mps,
        }
    }
}

impl Controller for ModelDriver {
    fn brief(&mut self, briefing: &Briefing) {
        self.briefing = briefing.clone();
    }

    fn reset(&mut self, _seed: u64) {
        self.config = self.driver_slot.take();
        self.sample = 0;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        if let Some(inputs) = &self.config.inputs {
            let mut inputs = inputs.lock().unwrap_or_else(PoisonError::into_inner);
            inputs.percepts.push(percept.clone());
            inputs.briefing = self.briefing.clone();
        }
        // The row is read during the recorded motion too, because it holds past frames.
        if let Some(surrogate) = &self.config.surrogate {
            if self.sample == 0 {
                self.model_inputs
                    .begin(&surrogate.nearest, &self.briefing, percept);
            }
            self.model_inputs.read(percept, &mut self.row);
        }
        let Command {
            accel_mps2,
            lateral_mps,
        } = self.command(percept);
        self.sample += 1;
        Ok(Command {
            accel_mps2: accel_mps2.clamp(-MOST_ACCEL_MPS2, MOST_ACCEL_MPS2),
            lateral_mps: lateral_mps.clamp(-MOST_LATERAL_MPS, MOST_LATERAL_MPS),
        })
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Own;
    use crate::surrogate::model::tests::surrogate;

    #[test]
    fn it_brakes_and_accelerates_no_harder_than_was_seen() {
        let percept = Percept {
            sample_s: 0.05,
            own: Own {
                speed_mps: 20.0,
                ..Own::default()
            },
            ..Percept::default()
        };
        // An answer of this size exceeds every limit.
        for unit_mps2 in [1e6, -1e6] {
            let driver_slot = ModelDriverSlot::default();
            driver_slot.set(ModelDriverConfig {
                surrogate: Some(Arc::new(surrogate([-4.0, 2.0], unit_mps2))),
                ..ModelDriverConfig::default()
            });
            let mut driver = driver_slot.factory()();
            driver.reset(0);
            let command = driver.control(&percept).expect("it drives");
            assert!([-4.0, 2.0].contains(&command.accel_mps2), "{command:?}");
        }
    }
}
