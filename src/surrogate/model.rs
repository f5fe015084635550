//! Surrogate of an ego: a network that predicts its next motion.

use std::sync::{Arc, Mutex, PoisonError};

use super::emergency_brake::{EmergencyBrake, Situation};
use super::fitted_model::{EgoInputs, FittedModel, MODELS};
use super::model_inputs::ModelInputs;
use super::motion::MotionSample;
use crate::ego::{Briefing, Command, Controller, Fault, Percept};
use crate::rl::nn::Mlp;
use crate::scene::drive::ControllerFactory;

/// Bound on scaled inputs, in standard deviations.
///
/// Beyond the recorded range the network answers as at the edge.
const EDGE: f32 = 6.0;
/// Largest acceleration of a car, m/s².
const MOST_ACCEL_MPS2: f64 = 15.0;
/// Largest lateral speed of a car, m/s.
const MOST_LATERAL_MPS: f64 = 4.0;

/// Networks that reproduce the answers of an ego in its recorded runs.
///
/// Each network predicts the change of the ego's acceleration until the next sample and
/// its lateral speed.
/// The networks differ in their initial weights and in the order of samples.
/// They agree where the samples determine the answer.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Surrogate {
    /// Mean of each input over the samples.
    pub mean: Vec<f32>,
    /// Inverse standard deviation of each input.
    pub inverse_sd: Vec<f32>,
    /// Value of an output of 1: m/s² and m/s.
    pub unit: [f64; 2],
    /// Hardest recorded braking and acceleration, m/s², which bound the prediction.
    pub range_mps2: [f64; 2],
    /// Most similar stock controllers. Their answers are part of a row.
    pub alike: Arc<[FittedModel]>,
    /// The members of the ensemble.
    pub members: Vec<Mlp>,
    /// Emergency brake over all members.
    pub brake: Option<EmergencyBrake>,
}

impl Surrogate {
    /// Returns the change of acceleration and the lateral speed, without the brake.
    ///
    /// `member` selects a network. `None`: the mean of all.
    fn answer(&self, member: Option<usize>, row: &[f32], scaled: &mut Vec<f32>) -> [f64; 2] {
        scaled.clear();
        scaled.extend(self.scaled(row));
        let asked = match member {
            Some(member) => std::slice::from_ref(&self.members[member % self.members.len()]),
            None => &self.members[..],
        };
        let said = asked.iter().map(|member| {
            let outputs = member.evaluate(scaled, |out| said(out).0);
            [0, 1].map(|i| f64::from(outputs[i]) * self.unit[i])
        });
        let sum = said.fold([0.0; 2], |sum, said| [sum[0] + said[0], sum[1] + said[1]]);
        let [change, across] = sum.map(|sum| sum / asked.len() as f64);
        [change + expected_mps2(&self.alike, row), across]
    }

    /// Scales a row to standard deviations from the mean.
    pub fn scaled<'a>(&'a self, row: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        let scales = self.mean.iter().zip(&self.inverse_sd);
        let pairs = row.iter().zip(scales);
        pairs.map(|(value, (mean, inverse_sd))| ((value - mean) * inverse_sd).clamp(-EDGE, EDGE))
    }
}

/// Number of outputs of a network.
///
/// The outputs are the change of acceleration, the lateral speed, a second change behind
/// a gate, and the opening of that gate.
pub(super) const OUTPUTS: usize = 4;
/// Steepness of the gate.
const STEEP: f32 = 16.0;

/// Converts outputs to change of acceleration and lateral speed, with their slopes.
///
/// Many egos brake quite differently beyond a threshold. A piecewise linear network
/// rounds this step off, and the gate does not.
pub(super) fn said(out: &[f32]) -> ([f32; 2], [[f32; OUTPUTS]; 2]) {
    let open = 1.0 / (1.0 + libm::expf(-STEEP * out[3]));
    // The derivative of the logistic function is open · (1 − open).
    let by_gate = out[2] * STEEP * open * (1.0 - open);
    let slopes = [[1.0, 0.0, open, by_gate], [0.0, 1.0, 0.0, 0.0]];
    ([out[0] + open * out[2], out[1]], slopes)
}

/// Returns the change of acceleration that the networks' answer is added to.
///
/// It is the answer of the nearest stock controller if that is close, and 0 otherwise.
pub(super) fn expected_mps2(alike: &[FittedModel], row: &[f32]) -> f64 {
    match alike.first() {
        // The answers of the stock controllers are the last inputs, the nearest first.
        Some(first) if first.is_close() => f64::from(row[row.len() - MODELS]),
        _ => 0.0,
    }
}

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
    pub heard: Option<Arc<Mutex<EgoInputs>>>,
}

/// Slot that hands a part to the driver of a model at the start of an episode.
#[derive(Clone, Debug, Default)]
pub(super) struct ModelDriverSlot(Arc<Mutex<ModelDriverConfig>>);

impl ModelDriverSlot {
    pub fn give(&self, part: ModelDriverConfig) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = part;
    }

    fn take(&self) -> ModelDriverConfig {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Returns a factory of drivers that play the parts given here.
    pub fn factory(&self) -> ControllerFactory {
        let casting = self.clone();
        Arc::new(move || {
            Box::new(ModelDriver {
                casting: casting.clone(),
                part: ModelDriverConfig::default(),
                briefing: Briefing::default(),
                reading: ModelInputs::default(),
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
    casting: ModelDriverSlot,
    part: ModelDriverConfig,
    briefing: Briefing,
    reading: ModelInputs,
    row: Vec<f32>,
    scaled: Vec<f32>,
    sample: usize,
}

impl ModelDriver {
    fn command(&mut self, percept: &Percept) -> Command {
        let own = &percept.own;
        let known = &self.part.known;
        if let (Some(here), Some(next)) = (known.get(self.sample), known.get(self.sample + 1)) {
            // The command starts from the model's own speed, so deviations are corrected.
            return Command {
                accel_mps2: (next.speed_mps - own.speed_mps) / percept.sample_s,
                lateral_mps: (next.lateral_m - here.lateral_m) / percept.sample_s,
            };
        }
        let Some(surrogate) = &self.part.surrogate else {
            return Command::accelerate(own.accel_mps2);
        };
        let [change_mps2, lateral_mps] =
            surrogate.answer(self.part.member, &self.row, &mut self.scaled);
        let braking_mps2 = surrogate
            .brake
            .and_then(|brake| brake.change_mps2(&Situation::of(percept)));
        // The brake only adds braking, so the harder of both applies.
        let change_mps2 = braking_mps2.map_or(change_mps2, |braking| change_mps2.min(braking));
        let accel_mps2 = own.accel_mps2 + change_mps2 + self.part.bias_mps3 * percept.sample_s;
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
        self.part = self.casting.take();
        self.sample = 0;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        if let Some(heard) = &self.part.heard {
            let mut heard = heard.lock().unwrap_or_else(PoisonError::into_inner);
            heard.percepts.push(percept.clone());
            heard.briefing = self.briefing.clone();
        }
        // The row is read during the recorded motion too, because it holds past frames.
        if let Some(surrogate) = &self.part.surrogate {
            if self.sample == 0 {
                self.reading
                    .begin(&surrogate.alike, &self.briefing, percept);
            }
            self.reading.read(percept, &mut self.row);
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
    use crate::rl::LearnerRng;

    fn surrogate(range_mps2: [f64; 2], unit_mps2: f64) -> Surrogate {
        let width = crate::surrogate::features::Features::width(0, 0) + MODELS;
        let mut dice = LearnerRng::new(3);
        let mut member = || Mlp::orthogonal(&[width, 8, OUTPUTS], 1.0, &mut dice);
        Surrogate {
            mean: vec![0.0; width],
            inverse_sd: vec![1.0; width],
            unit: [unit_mps2, 0.0],
            range_mps2,
            alike: Arc::default(),
            members: vec![member(), member()],
            brake: None,
        }
    }

    #[test]
    fn the_mean_of_all_members_lies_between_them() {
        let surrogate = surrogate([-9.0, 9.0], 1.0);
        let row: Vec<f32> = (0..surrogate.mean.len()).map(|i| 0.1 * i as f32).collect();
        let mut answer = |member| surrogate.answer(member, &row, &mut Vec::new())[0];
        let [one, other, mean] = [Some(0), Some(1), None].map(&mut answer);
        assert_ne!(one, other);
        assert!((mean - 0.5 * (one + other)).abs() < 1e-12);
    }

    #[test]
    fn slopes_of_what_is_said_are_those_of_the_gate_and_of_both_sides_of_it() {
        let near = 1e-3;
        for gate in [-0.1, 0.0, 0.03, 0.2] {
            let out = [0.3, -0.2, -1.5, gate];
            let (_, slopes) = said(&out);
            for i in 0..OUTPUTS {
                let [more, less] = [near, -near].map(|by: f32| {
                    let mut there = out;
                    there[i] += by;
                    said(&there).0
                });
                for (said, slopes) in slopes.iter().enumerate() {
                    let slope = (more[said] - less[said]) / (2.0 * near);
                    assert!((slope - slopes[i]).abs() < 1e-2, "{said} by {i}: {slope}");
                }
            }
        }
        // The gate is fully open, then fully closed.
        assert_eq!(said(&[0.3, 0.0, -1.5, 9.0]).0[0], -1.2);
        assert_eq!(said(&[0.3, 0.0, -1.5, -9.0]).0[0], 0.3);
    }

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
            let casting = ModelDriverSlot::default();
            casting.give(ModelDriverConfig {
                surrogate: Some(Arc::new(surrogate([-4.0, 2.0], unit_mps2))),
                ..ModelDriverConfig::default()
            });
            let mut driver = casting.factory()();
            driver.reset(0);
            let command = driver.control(&percept).expect("it drives");
            assert!([-4.0, 2.0].contains(&command.accel_mps2), "{command:?}");
        }
    }
}
