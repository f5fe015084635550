//! V as a network.

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
    pub(super) fn new(inputs: usize, heads: usize, actions: usize, seed: u64) -> ValueNetwork {
        let mut dice = LearnerRng::new(seed);
        let sizes = [inputs, WIDTH, WIDTH, heads * actions];
        ValueNetwork {
            // Small weights give all actions nearly the same V at first.
            net: Mlp::orthogonal(&sizes, 0.01, &mut dice),
            heads,
            actions,
        }
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
                let pairs = pairs.filter(|(action, (_, p))| *action != without && 0.0 < **p);
                pairs
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
                let pull = (1.0 - target / libm::exp(log)).max(-PULL);
                delta[column] = (pull / rows.len() as f64) as f32;
            }
        }
        net.backward(&self.inputs, rows.len(), &mut self.tape, &mut self.gradient);
    }
}
