//! Probability V of a failure, as networks learn it from runs.
//!
//! V(s, a) is the probability that the ego fails after the joint action a in state s, if
//! the ados follow their law from then on. A run gives a target per decision, from its end
//! backwards: the mean of V under the law, in which the value of the action that was taken
//! is replaced by its own target (tree backup, Precup et al. 2000). So a single failure
//! moves the values of all states before it, with their right size.

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
/// Least value, below which no failure is expected.
const LEAST: f64 = 1e-8;
/// ln V of a network of zeros, and the step of ln V per unit of an output.
const MIDDLE: f64 = -9.0;
const STEP: f64 = 4.0;
/// Limit on the pull of a target that is far above its value.
const PULL: f64 = 20.0;

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

/// Decisions of runs as a table, with targets.
struct Decisions<'a> {
    runs: &'a [(&'a RiskRun, Vec<bool>)],
    /// Run and decision of each row.
    rows: Vec<(usize, usize)>,
    /// First row of each run.
    first: Vec<usize>,
    /// Rows of runs that fail.
    failing: Vec<usize>,
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

    /// Returns the number of heads.
    pub(super) fn heads(&self) -> usize {
        self.heads
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
            let targets = data.targets(self);
            let done = sweep as f64 / SWEEPS as f64;
            let rate = (RATE * libm::pow(10.0, -done)) as f32;
            for _ in 0..batches {
                let rows = data.draw(&mut dice);
                step.gradient(self, &data, &rows, &targets);
                adam.step(self.net.parameters_mut(), &step.gradient, rate);
            }
        }
    }
}

/// Returns V of an output.
fn value_of(output: f32) -> f64 {
    // A probability is at most 1.
    libm::exp((MIDDLE + STEP * f64::from(output)).min(0.0))
}

impl<'a> Decisions<'a> {
    fn of(runs: &'a [(&'a RiskRun, Vec<bool>)]) -> Decisions<'a> {
        let (mut rows, mut first, mut failing) = (Vec::new(), Vec::new(), Vec::new());
        for (run, (played, fails)) in runs.iter().enumerate() {
            first.push(rows.len());
            for decision in 0..played.actions.len() {
                if fails.contains(&true) {
                    failing.push(rows.len());
                }
                rows.push((run, decision));
            }
        }
        Decisions {
            runs,
            rows,
            first,
            failing,
        }
    }

    /// Returns the target of every row and head, `[rows, heads]`.
    fn targets(&self, value: &ValueNetwork) -> Vec<f64> {
        let heads = value.heads;
        let mut targets = vec![LEAST; self.rows.len() * heads];
        for ((run, fails), first) in self.runs.iter().zip(&self.first) {
            // Not 0, because values are compared on a logarithmic scale.
            let end = fails.iter().map(|it| if *it { 1.0 } else { LEAST });
            let mut next: Vec<f64> = end.collect();
            for decision in (0..run.actions.len()).rev() {
                let row = (first + decision) * heads;
                targets[row..row + heads].copy_from_slice(&next);
                // No earlier decision reads the value of the first.
                if decision == 0 {
                    break;
                }
                let (law, taken) = (run.law(decision), run.actions[decision] as usize);
                let values = value.values(run.input(decision));
                for (head, next) in next.iter_mut().enumerate() {
                    let own = &values[head * value.actions..][..value.actions];
                    let others = own.iter().zip(law).enumerate();
                    let others = others.filter(|(action, _)| *action != taken);
                    let others: f64 = others.map(|(_, (v, p))| v * f64::from(*p)).sum();
                    *next = (others + f64::from(law[taken]) * *next).clamp(LEAST, 1.0);
                }
            }
        }
        targets
    }

    /// Draws the rows of a batch, half of them from runs that fail.
    fn draw(&self, dice: &mut LearnerRng) -> Vec<usize> {
        // Failures are rare, and a batch without them would teach only that.
        let draw = |at: usize| {
            if at.is_multiple_of(2) && !self.failing.is_empty() {
                self.failing[dice.below(self.failing.len())]
            } else {
                dice.below(self.rows.len())
            }
        };
        (0..BATCH).map(draw).collect()
    }
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
