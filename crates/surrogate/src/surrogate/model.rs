//! Surrogate of an ego: networks that predict its next motion.

use std::sync::Arc;

use super::emergency_brake::EmergencyBrake;
use super::fitted_model::{FittedModel, MODELS};
use crate::rl::nn::Mlp;

/// Bound on scaled inputs, in standard deviations.
///
/// Beyond the recorded range the network answers as at the edge.
const EDGE: f32 = 6.0;

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
    pub nearest: Arc<[FittedModel]>,
    /// The members of the ensemble.
    pub members: Vec<Mlp>,
    /// Emergency brake over all members.
    pub brake: Option<EmergencyBrake>,
}

impl Surrogate {
    /// Returns the change of acceleration and the lateral speed, without the brake.
    ///
    /// `member` selects a network. `None`: the mean of all.
    pub(super) fn answer(
        &self,
        member: Option<usize>,
        row: &[f32],
        scaled: &mut Vec<f32>,
    ) -> [f64; 2] {
        scaled.clear();
        scaled.extend(self.scaled(row));
        let members = match member {
            // Variations name members of a full ensemble, and a test may have fewer.
            Some(member) => std::slice::from_ref(&self.members[member % self.members.len()]),
            None => &self.members[..],
        };
        let predicted = members.iter().map(|member| {
            let outputs = member.evaluate(scaled, |out| answer_of(out).0);
            [0, 1].map(|i| f64::from(outputs[i]) * self.unit[i])
        });
        let sum = predicted.fold([0.0; 2], |sum, predicted| {
            [sum[0] + predicted[0], sum[1] + predicted[1]]
        });
        let [change, across] = sum.map(|sum| sum / members.len() as f64);
        [change + expected_mps2(&self.nearest, row), across]
    }

    /// Scales a row to standard deviations from the mean.
    pub(super) fn scaled<'a>(&'a self, row: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        let scales = self.mean.iter().zip(&self.inverse_sd);
        let pairs = row.iter().zip(scales);
        pairs.map(|(value, (mean, inverse_sd))| ((value - mean) * inverse_sd).clamp(-EDGE, EDGE))
    }
}

#[cfg(test)]
impl Surrogate {
    /// Returns a surrogate of networks without scaling, similar controllers and brake.
    pub(super) fn of_members(members: Vec<Mlp>, unit: [f64; 2], range_mps2: [f64; 2]) -> Surrogate {
        let width = members[0].inputs();
        Surrogate {
            mean: vec![0.0; width],
            inverse_sd: vec![1.0; width],
            unit,
            range_mps2,
            nearest: Arc::default(),
            members,
            brake: None,
        }
    }
}

/// Number of outputs of a network.
///
/// The outputs are the change of acceleration, the lateral speed, a second change behind
/// a gate, and the opening of that gate.
pub(super) const OUTPUTS: usize = 4;
/// Steepness of the gate.
// Of 60 starts of a safety filter, a steepness of 16 solved 36, 4 solved 25, no gate 18.
const STEEP: f32 = 16.0;

/// Converts outputs to change of acceleration and lateral speed, with their slopes.
///
/// Many egos brake quite differently beyond a threshold. A piecewise linear network
/// rounds this step off, and the gate does not.
pub(super) fn answer_of(out: &[f32]) -> ([f32; 2], [[f32; OUTPUTS]; 2]) {
    let open = 1.0 / (1.0 + libm::expf(-STEEP * out[3]));
    // The derivative of the logistic function is open · (1 − open).
    let by_gate = out[2] * STEEP * open * (1.0 - open);
    let slopes = [[1.0, 0.0, open, by_gate], [0.0, 1.0, 0.0, 0.0]];
    ([out[0] + open * out[2], out[1]], slopes)
}

/// Returns the change of acceleration that the networks' answer is added to.
///
/// It is the answer of the nearest stock controller if that is close, and 0 otherwise.
pub(super) fn expected_mps2(nearest: &[FittedModel], row: &[f32]) -> f64 {
    match nearest.first() {
        // The answers of the stock controllers are the last inputs, the nearest first.
        Some(first) if first.is_close() => f64::from(row[row.len() - MODELS]),
        _ => 0.0,
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::rl::LearnerRng;

    pub fn surrogate(range_mps2: [f64; 2], unit_mps2: f64) -> Surrogate {
        let width = crate::surrogate::features::Features::width(0, 0) + MODELS;
        let mut dice = LearnerRng::new(3);
        let mut member = || Mlp::orthogonal(&[width, 8, OUTPUTS], 1.0, &mut dice);
        Surrogate::of_members(vec![member(), member()], [unit_mps2, 0.0], range_mps2)
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
    fn slopes_of_an_answer_are_those_of_the_gate_and_of_both_sides_of_it() {
        let near = 1e-3;
        for gate in [-0.1, 0.0, 0.03, 0.2] {
            let out = [0.3, -0.2, -1.5, gate];
            let (_, slopes) = answer_of(&out);
            for i in 0..OUTPUTS {
                let [more, less] = [near, -near].map(|by: f32| {
                    let mut there = out;
                    there[i] += by;
                    answer_of(&there).0
                });
                for (predicted, slopes) in slopes.iter().enumerate() {
                    let slope = (more[predicted] - less[predicted]) / (2.0 * near);
                    assert!(
                        (slope - slopes[i]).abs() < 1e-2,
                        "{predicted} by {i}: {slope}"
                    );
                }
            }
        }
        // The gate is fully open, then fully closed.
        assert_eq!(answer_of(&[0.3, 0.0, -1.5, 9.0]).0[0], -1.2);
        assert_eq!(answer_of(&[0.3, 0.0, -1.5, -9.0]).0[0], 0.3);
    }
}
