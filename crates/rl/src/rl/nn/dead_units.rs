//! Hidden units that no input turns on, and their renewal.
//!
//! - Sokar et al., "The Dormant Neuron Phenomenon in Deep Reinforcement Learning",
//!   ICML 2023: such units become more during a training, and new weights for them
//!   let it learn again.

use super::super::dice::LearnerRng;
use super::{Mlp, Tape};

/// Hidden units that were on for some input, by layer.
#[derive(Clone, Debug, PartialEq)]
pub struct UsedUnits(Vec<Vec<bool>>);

/// Hidden unit: its layer, and its place there.
type HiddenUnit = (usize, usize);

impl UsedUnits {
    /// Returns the units of a network before the first input.
    pub fn of(net: &Mlp) -> UsedUnits {
        let (_, hidden) = net.layers.split_last().unzip();
        let hidden = hidden.into_iter().flatten();
        UsedUnits(hidden.map(|layer| vec![false; layer.outputs]).collect())
    }

    /// Notes the units that are on after [`Mlp::forward`] of a batch.
    pub fn note(&mut self, net: &Mlp, tape: &Tape, batch: usize) {
        for ((used, layer), rows) in self.0.iter_mut().zip(&net.layers).zip(&tape.activations) {
            for row in rows[..batch * layer.width].chunks_exact(layer.width) {
                used.iter_mut()
                    .zip(row)
                    // Only units that no input of the whole period turns on are dead.
                    .for_each(|(used, on)| *used |= *on > 0.0);
            }
        }
    }

    fn dead(&self) -> Vec<HiddenUnit> {
        let layers = self.0.iter().enumerate();
        let units = layers.flat_map(|(i, used)| used.iter().enumerate().map(move |it| (i, it)));
        let dead = units.filter(|(_, (_, used))| !**used);
        dead.map(|(i, (unit, _))| (i, unit)).collect()
    }
}

impl Mlp {
    /// Gives the units that were never on new weights, and returns the changed parameters.
    ///
    /// What the network computes stays the same, because nothing leads on from a new unit
    /// yet.
    pub fn renew_unused(&mut self, used: &UsedUnits, dice: &mut LearnerRng) -> Vec<usize> {
        let mut changed = Vec::new();
        for (i, unit) in used.dead() {
            let (layer, next) = (self.layers[i], self.layers[i + 1]);
            let draws: Vec<f64> = (0..layer.inputs).map(|_| dice.normal()).collect();
            // As long as a column of the first weights on average ([`Mlp::orthogonal`]).
            let share = layer.inputs as f64 / layer.outputs.max(layer.inputs) as f64;
            let length = libm::sqrt(draws.iter().map(|draw| draw * draw).sum());
            // A length of 0 would make the weights NaN.
            let scale = libm::sqrt(2.0 * share) / length.max(1e-9);
            self.parameters[layer.bias + unit] = 0.0;
            changed.push(layer.bias + unit);
            for (row, draw) in draws.iter().enumerate() {
                let at = layer.weights + row * layer.width + unit;
                self.parameters[at] = (draw * scale) as f32;
                changed.push(at);
            }
            let first = next.weights + unit * next.width;
            let leading_on = first..first + next.outputs;
            self.parameters[leading_on.clone()].fill(0.0);
            changed.extend(leading_on);
        }
        changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unused_units_get_new_weights_and_the_outputs_stay() {
        let mut dice = LearnerRng::new(3);
        let mut net = Mlp::orthogonal(&[4, 16, 16, 3], 1.0, &mut dice);
        // Units 2 of the first and 5 of the second hidden layer never turn on.
        for (i, unit) in [(0, 2), (1, 5)] {
            net.parameters[net.layers[i].bias + unit] = -100.0;
        }
        let inputs: Vec<f32> = (0..4 * 64).map(|_| dice.normal() as f32).collect();
        let mut tape = net.tape(64);
        let before = net.forward(&inputs, 64, &mut tape).to_vec();
        let mut used = UsedUnits::of(&net);
        used.note(&net, &tape, 64);
        assert_eq!(used.dead(), [(0, 2), (1, 5)]);
        let old = net.parameters.clone();
        let changed = net.renew_unused(&used, &mut dice);
        let differing = (0..old.len()).filter(|&at| old[at] != net.parameters[at]);
        assert!(
            differing.clone().count() > 4 + 16
                && differing.into_iter().all(|at| changed.contains(&at))
        );
        let after = net.forward(&inputs, 64, &mut tape).to_vec();
        let apart = before.iter().zip(&after).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f32::max) < 1e-5, "{before:?} {after:?}");
        used.note(&net, &tape, 64);
        assert_eq!(used.dead(), []);
        assert!(net.renew_unused(&used, &mut dice).is_empty());
    }
}
