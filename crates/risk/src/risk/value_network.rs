//! Probability V of a failure, as it is learned from runs.
//!
//! V(s, a) is the probability that the ego fails after the joint action a in state s, if
//! the ados follow their law from then on. A run gives a target per decision, from its end
//! backwards: the mean of V under the law, in which the value of the action that was taken
//! is replaced by its own target (tree backup, Precup et al. 2000). So a single failure
//! moves the values of all states before it, with their right size.

use super::decisions::{ActionValues, Decisions};
use super::record::RiskRun;
use crate::rl::LearnerRng;
use crate::rl::adam::Adam;
use crate::rl::nn::{Mlp, Tape};

/// Width of the hidden layers.
const WIDTH: usize = 64;
/// Rows of a batch.
const BATCH: usize = 256;
/// Fewest and most batches of a sweep. In between, a sweep reads every decision twice.
const BATCHES: [usize; 2] = [40, 400];
/// Sweeps of a fit.
// On `cut_in`, relative variances per draw were 15, 8 and 23 with 30 sweeps, 43, 24 and 25
// with 15, and 65, 28 and 10 with a width of 128.
const SWEEPS: usize = 30;
/// Learning rate of the first sweep, which falls to a tenth.
const RATE: f64 = 2e-3;
/// ln V of a network of zeros, and the step of ln V per unit of an output.
const MIDDLE: f64 = -9.0;
const STEP: f64 = 4.0;
/// Limit on the pull of a target that is far above its value.
///
/// V collapses where failures are rarer than its reciprocal among the drawn decisions,
/// and then the proposals hardly play some failures.
// With 20, fits of `merge` had relative variances per draw of 17, 257 and 35, and an estimate
// passed all checks at two thirds of the risk. With 1000 they had 7 and 16.
const PULL: f64 = 1000.0;

/// Network of V, with a head per kind of failure.
///
/// Inputs are the ados' observation, their last actions and the remaining decisions.
/// Outputs are `[heads, actions]`.
#[derive(Clone, Debug)]
pub(super) struct ValueNetwork {
    net: Mlp,
    heads: usize,
    actions: usize,
}

impl ValueNetwork {
    /// Creates a network that expects hardly any failure.
    ///
    /// `sizes` are inputs, heads and joint actions.
    pub(super) fn new(sizes: [usize; 3], seed: u64) -> ValueNetwork {
        let [inputs, heads, actions] = sizes;
        let mut dice = LearnerRng::new(seed);
        let layers = [inputs, WIDTH, WIDTH, heads * actions];
        ValueNetwork {
            // Small weights give all actions nearly the same V at first.
            net: Mlp::orthogonal(&layers, 0.01, &mut dice),
            heads,
            actions,
        }
    }

    /// Returns the network of weights 0, by which all actions have equal values.
    #[cfg(test)]
    pub(super) fn flat(sizes: [usize; 3]) -> ValueNetwork {
        let mut network = ValueNetwork::new(sizes, 0);
        network.net.parameters_mut().fill(0.0);
        network
    }

    /// Returns V of every head and action, `[heads, actions]`.
    pub(super) fn values(&self, input: &[f32]) -> Vec<f64> {
        let all = self.heads * self.actions;
        self.net.evaluate(input, |out| {
            out[..all].iter().map(|it| value_of(*it)).collect()
        })
    }

    /// Fits the network to runs, each with whether it is a failure of every head.
    pub(super) fn fit(&mut self, runs: &[(&RiskRun, Vec<bool>)], seed: u64) {
        let data = Decisions::of(runs);
        if data.rows.is_empty() {
            return;
        }
        let mut dice = LearnerRng::new(seed);
        let mut adam = Adam::new(self.net.parameters().len());
        let mut step = FitStep::new(&self.net);
        // A minimum, because a few decisions would hardly change the network.
        let batches = (2 * data.rows.len() / BATCH).clamp(BATCHES[0], BATCHES[1]);
        for sweep in 0..SWEEPS {
            let targets = data.targets(self, &data.sweep_runs(&mut dice));
            let done = sweep as f64 / SWEEPS as f64;
            // It falls to a tenth, because the targets move less and less.
            let rate = (RATE * libm::pow(10.0, -done)) as f32;
            for _ in 0..batches {
                let rows = data.draw(BATCH, &targets, &mut dice);
                step.gradient(self, &data, &rows, &targets.values);
                adam.step(self.net.parameters_mut(), &step.gradient, rate);
            }
        }
    }
}

impl ActionValues for ValueNetwork {
    fn heads(&self) -> usize {
        self.heads
    }

    fn means_without(&self, input: &[f32], law: &[f32], without: usize) -> Vec<f64> {
        self.net.evaluate(input, |out| {
            let mean = |own: &[f32]| {
                let pairs = own.iter().zip(law).enumerate();
                // Impossible actions are skipped, because exponentials take most of the time.
                let possible = pairs.filter(|(action, (_, p))| *action != without && **p > 0.0);
                possible
                    .map(|(_, (it, p))| f64::from(*p) * value_of(*it))
                    .sum()
            };
            let all = self.heads * self.actions;
            out[..all].chunks(self.actions).map(mean).collect()
        })
    }
}

/// Returns V of an output.
fn value_of(output: f32) -> f64 {
    // A probability is at most 1.
    libm::exp((MIDDLE + STEP * f64::from(output)).min(0.0))
}

/// Buffers of a step.
struct FitStep {
    tape: Tape,
    inputs: Vec<f32>,
    gradient: Vec<f32>,
}

impl FitStep {
    fn new(net: &Mlp) -> FitStep {
        FitStep {
            tape: net.tape(BATCH),
            inputs: Vec::new(),
            gradient: vec![0.0; net.parameters().len()],
        }
    }

    /// Computes the gradient of the deviance y / V + ln V, whose minimum is the mean of y.
    ///
    /// It compares sizes, so that values of 1e-6 are fitted as well as those of 0.1.
    fn gradient(
        &mut self,
        value: &ValueNetwork,
        data: &Decisions<'_>,
        rows: &[usize],
        targets: &[f64],
    ) {
        self.inputs.clear();
        for row in rows {
            let (run, decision) = data.rows[*row];
            self.inputs.extend(data.runs[run].0.input(decision));
        }
        // Output rows are padded, so columns are counted by the stride
        // and not by the outputs.
        let (net, stride) = (&value.net, value.net.output_stride());
        net.forward(&self.inputs, rows.len(), &mut self.tape);
        let (out, delta) = net.output_and_gradient(rows.len(), &mut self.tape);
        // Only the action that was taken has a target.
        delta.fill(0.0);
        for (at, row) in rows.iter().enumerate() {
            let (run, decision) = data.rows[*row];
            let taken = data.runs[run].0.actions[decision] as usize;
            for head in 0..value.heads {
                let column = at * stride + head * value.actions + taken;
                let log = MIDDLE + STEP * f64::from(out[column]);
                let target = targets[row * value.heads + head];
                // The gradient of ln V + target / V, which weighs relative errors alike at
                // any size.
                let pull = (1.0 - target / libm::exp(log)).max(-PULL);
                delta[column] = (pull / rows.len() as f64) as f32;
            }
        }
        net.backward(&self.inputs, rows.len(), &mut self.tape, &mut self.gradient);
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::{EgoFailure, RunEnd};
    use super::*;

    /// Runs of two decisions, of which action 1 in the high state fails.
    fn runs() -> Vec<RiskRun> {
        let run = |i: u32| {
            let (state, action) = (f32::from((i % 2) as u8), i / 2 % 2);
            let fails = action == 1 && state > 0.5;
            let failure = EgoFailure {
                mode: "contact".to_owned(),
                lawful: true,
                preventable: None,
            };
            RiskRun {
                actions: vec![0, action],
                inputs: vec![state, 1.0, state, 0.5],
                laws: vec![1.0, 0.0, 0.9, 0.1],
                ..RiskRun::ending(if fails {
                    RunEnd::Failed(failure)
                } else {
                    RunEnd::Held { lawful: None }
                })
            }
        };
        (0..400).map(run).collect()
    }

    #[test]
    fn a_network_learns_the_size_of_v_from_the_end_of_runs_backwards() {
        let runs = runs();
        let with_heads = runs.iter().map(|run| {
            // No failure is of the second kind.
            (run, vec![run.failure().is_some(), false])
        });
        let mut network = ValueNetwork::new([2, 2, 2], 3);
        let fresh = network.values(&[1.0, 0.5]);
        assert!(
            fresh.len() == 4 && fresh.iter().all(|it| *it < 1e-3),
            "{fresh:?}"
        );
        network.fit(&with_heads.collect::<Vec<_>>(), 5);
        let near = |found: f64, expected: f64| {
            let ratio = found / expected;
            assert!((0.7..1.4).contains(&ratio), "{found}, not {expected}");
        };
        let last = network.values(&[1.0, 0.5]);
        near(last[1], 1.0);
        assert!(
            last[0] < 0.02 && last[2] < 0.02 && last[3] < 0.02,
            "{last:?}"
        );
        assert!(network.values(&[0.0, 0.5]).iter().all(|it| *it < 0.02));
        // Before it, the law takes action 1 with a tenth.
        near(network.values(&[1.0, 1.0])[0], 0.1);
        assert!(network.values(&[0.0, 1.0])[0] < 0.02);
        // A mean leaves an action out, and all that the law excludes.
        let means = network.means_without(&[1.0, 0.5], &[0.9, 0.1], 0);
        near(means[0], 0.1);
        assert!(network.means_without(&[1.0, 0.5], &[0.9, 0.1], 1)[0] < 0.02);
        assert_eq!(network.means_without(&[1.0, 0.5], &[1.0, 0.0], 0), [0.0; 2]);
        assert_eq!(network.heads(), 2);
    }

    #[test]
    fn a_network_without_runs_stays_as_it_is() {
        let mut network = ValueNetwork::new([2, 1, 2], 3);
        let before = network.values(&[1.0, 0.5]);
        network.fit(&[], 5);
        assert_eq!(network.values(&[1.0, 0.5]), before);
        assert_eq!(value_of(100.0), 1.0);
        assert!((value_of(0.0) - libm::exp(-9.0)).abs() < 1e-12);
    }
}
