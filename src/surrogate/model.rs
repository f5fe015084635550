//! The surrogate of an ego: what it does next, as a network says.

use std::sync::{Arc, Mutex, PoisonError};

use super::emergency_brake::{EmergencyBrake, Situation};
use super::fitted_model::{Heard, Likeness, MODELS};
use super::model_inputs::Reading;
use super::motion::Moment;
use crate::ego::{Briefing, Command, Controller, Fault, Percept};
use crate::rl::nn::Mlp;
use crate::scene::drive::ControllerFactory;

/// Inputs are held within so many standard deviations: beyond what was seen the
/// network goes on as if it were at the edge.
const EDGE: f32 = 6.0;
/// No car does more.
const MOST_ACCEL_MPS2: f64 = 15.0;
/// Nor moves faster across the road.
const MOST_LATERAL_MPS: f64 = 4.0;

/// Networks that answer as an ego did in its recorded runs.
///
/// Each of them says by how much the ego's acceleration changes until the next
/// sample, and how fast it moves across the road. They differ in what they were
/// born with and in the order in which they saw the samples, so where they
/// agree there were samples.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Surrogate {
    /// Mean of each input over the samples.
    pub mean: Vec<f32>,
    /// One over its standard deviation.
    pub inverse_sd: Vec<f32>,
    /// What an output of 1 stands for: m/s² and m/s.
    pub unit: [f64; 2],
    /// The hardest braking and acceleration that were seen, m/s²: it does no more.
    pub range_mps2: [f64; 2],
    /// The stock controllers that it is most like; what they would do is part of
    /// a row.
    pub alike: Arc<[Likeness]>,
    /// The members of the ensemble.
    pub members: Vec<Mlp>,
    /// An emergency brake over all of them.
    pub brake: Option<EmergencyBrake>,
}

impl Surrogate {
    /// Change of acceleration, and speed across the road: what one member says, or
    /// the mean of all, without the brake.
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

    /// A row in standard deviations from the mean.
    pub fn scaled<'a>(&'a self, row: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        let scales = self.mean.iter().zip(&self.inverse_sd);
        let pairs = row.iter().zip(scales);
        pairs.map(|(value, (mean, inverse_sd))| ((value - mean) * inverse_sd).clamp(-EDGE, EDGE))
    }
}

/// Outputs of a network: change of acceleration, speed across the road, by how much
/// the former is another one behind a gate, and how far that is open.
pub(super) const OUTPUTS: usize = 4;
/// How steep the gate is.
const STEEP: f32 = 16.0;

/// What a network's outputs say, change of acceleration and speed across the road, and
/// the slopes of both in all outputs.
///
/// Many an ego brakes in quite another way beyond a threshold; a network of straight
/// pieces rounds that off, a gate does not.
pub(super) fn said(out: &[f32]) -> ([f32; 2], [[f32; OUTPUTS]; 2]) {
    let open = 1.0 / (1.0 + libm::expf(-STEEP * out[3]));
    let by_gate = out[2] * STEEP * open * (1.0 - open);
    let slopes = [[1.0, 0.0, open, by_gate], [0.0, 1.0, 0.0, 0.0]];
    ([out[0] + open * out[2], out[1]], slopes)
}

/// The change of acceleration that the networks' answer is added to: what the
/// stock controller would do that the ego is like, if it is like one.
pub(super) fn expected_mps2(alike: &[Likeness], row: &[f32]) -> f64 {
    match alike.first() {
        Some(first) if first.is_close() => f64::from(row[row.len() - MODELS]),
        _ => 0.0,
    }
}

/// How the driver of a model acts in the next episode.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    /// What the ego is known to have done: it does so again, sample by sample.
    pub known: Arc<[Moment]>,
    /// What it does after that; without one it keeps its acceleration.
    pub surrogate: Option<Arc<Surrogate>>,
    /// Which member of the ensemble; `None`: the mean of all.
    pub member: Option<usize>,
    /// Added to every answer: an ego that is a little more, or less, careful.
    pub bias_mps3: f64,
    /// Where the percepts of every sample are written down.
    pub heard: Option<Arc<Mutex<Heard>>>,
}

/// Hands a part to the driver of a model; it is taken when an episode begins.
#[derive(Clone, Debug, Default)]
pub(super) struct Casting(Arc<Mutex<Part>>);

impl Casting {
    pub fn give(&self, part: Part) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = part;
    }

    fn take(&self) -> Part {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Makes drivers that play the parts given here.
    pub fn factory(&self) -> ControllerFactory {
        let casting = self.clone();
        Arc::new(move || {
            Box::new(ModelDriver {
                casting: casting.clone(),
                part: Part::default(),
                briefing: Briefing::default(),
                reading: Reading::default(),
                row: Vec::new(),
                scaled: Vec::new(),
                sample: 0,
            })
        })
    }
}

/// Drives as an ego did, and from then on as its surrogate says.
#[derive(Clone)]
struct ModelDriver {
    casting: Casting,
    part: Part,
    briefing: Briefing,
    reading: Reading,
    row: Vec<f32>,
    scaled: Vec<f32>,
    sample: usize,
}

impl ModelDriver {
    fn command(&mut self, percept: &Percept) -> Command {
        let own = &percept.own;
        let known = &self.part.known;
        if let (Some(here), Some(next)) = (known.get(self.sample), known.get(self.sample + 1)) {
            // From the model's own speed, so that what it was off by is made good.
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
        let change_mps2 = braking_mps2.map_or(change_mps2, |braking| change_mps2.min(braking));
        let accel_mps2 = own.accel_mps2 + change_mps2 + self.part.bias_mps3 * percept.sample_s;
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
    use crate::rl::Dice;

    fn surrogate(range_mps2: [f64; 2], unit_mps2: f64) -> Surrogate {
        let width = crate::surrogate::features::Features::width(0, 0) + MODELS;
        let mut dice = Dice::new(3);
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
        // All of it, or nothing.
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
        // An answer of this size is beyond anything.
        for unit_mps2 in [1e6, -1e6] {
            let casting = Casting::default();
            casting.give(Part {
                surrogate: Some(Arc::new(surrogate([-4.0, 2.0], unit_mps2))),
                ..Part::default()
            });
            let mut driver = casting.factory()();
            driver.reset(0);
            let command = driver.control(&percept).expect("it drives");
            assert!([-4.0, 2.0].contains(&command.accel_mps2), "{command:?}");
        }
    }
}
