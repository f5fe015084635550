//! Fit of a surrogate's networks to recorded runs.

use std::sync::Arc;

use super::brake_detection::brake_in;
use super::emergency_brake::{EmergencyBrake, Situation};
use super::fitted_model::FittedModel;
use super::model::{OUTPUTS, Surrogate, answer_of, expected_mps2};
use crate::experiment::{EpisodeLoop, Watch};
use crate::rl::LearnerRng;
use crate::rl::adam::Adam;
use crate::rl::nn::{Mlp, Tape};

/// Number of networks in the ensemble.
// Behind the gate of the output, two networks solved 36 of 60 starts of a safety filter, and
// four solved 26. Without the gate, two solved 34 of 80 and five 43.
pub(super) const MEMBERS: usize = 2;
const HIDDEN: usize = 32;
const BATCH: usize = 32;
const LEARNING_RATE: f64 = 3e-3;
/// Share of the learning rate that is left at the end of the linear decay.
const LAST_RATE: f64 = 0.03;
/// Number of answers: change of acceleration and lateral speed.
const ANSWERS: usize = 2;
/// Threshold of a critical sample.
///
/// It applies to the ego's acceleration in m/s² and to its change in standard deviations.
const CRITICAL: f64 = 1.0;
/// Smallest standard deviation used for scaling.
///
/// Inputs that hardly vary are not amplified.
const LEAST_SD: f32 = 1e-3;
/// Lateral speed below which an ego counts as keeping its lane, m/s.
const LEAST_LATERAL_MPS: f64 = 0.05;
/// Updates of the trial fits that decide whether a brake helps.
const TRIAL_UPDATES: u64 = 10_000;

/// Recorded inputs of an ego and its answers, sample by sample.
#[derive(Clone, Debug, Default)]
pub(super) struct FitSamples {
    /// Length of a row of inputs.
    pub width: usize,
    /// All rows in sequence.
    pub inputs: Vec<f32>,
    /// Present acceleration, its change until the next sample, and lateral speed.
    pub answers: Vec<[f64; 3]>,
    /// Inputs of an emergency brake at the same samples.
    pub situations: Vec<Situation>,
}

impl FitSamples {
    fn row(&self, sample: usize) -> &[f32] {
        &self.inputs[sample * self.width..][..self.width]
    }

    /// Returns the mean and the inverse standard deviation of each input.
    fn scales(&self) -> (Vec<f32>, Vec<f32>) {
        let count = self.answers.len().max(1) as f64;
        let rows = || self.inputs.chunks_exact(self.width.max(1));
        let column = |i: usize| rows().map(move |row| f64::from(row[i]));
        let mean = |i: usize| column(i).sum::<f64>() / count;
        let means: Vec<f64> = (0..self.width).map(mean).collect();
        let sd = |i: usize| {
            let squares = column(i).map(|value| (value - means[i]).powi(2));
            (squares.sum::<f64>() / count).sqrt() as f32
        };
        // Inputs that never vary would divide by 0, and noise on them would be blown up.
        let inverse = (0..self.width).map(|i| 1.0 / sd(i).max(LEAST_SD)).collect();
        (means.into_iter().map(|mean| mean as f32).collect(), inverse)
    }

    /// Returns the value of an output of 1, or 0 for an output that is always 0.
    fn units(&self, nearest: &[FittedModel]) -> [f64; 2] {
        let across_mps = self.rms(|_, answer| answer[2]);
        // Below it the ego only corrects its lane, and its answer would be noise.
        let steers = across_mps > LEAST_LATERAL_MPS;
        let left = |row: &[f32], answer: &[f64; 3]| answer[1] - expected_mps2(nearest, row);
        // The floor keeps the targets finite if a controller explains everything.
        let left_mps2 = self.rms(left).max(1e-6);
        [left_mps2, if steers { across_mps } else { 0.0 }]
    }

    /// Returns the smallest and the largest acceleration of the ego.
    fn range_mps2(&self) -> [f64; 2] {
        let answers = self
            .answers
            .iter()
            .flat_map(|[now, change, _]| [*now, now + change]);
        // From 0, so that a surrogate may always hold its speed.
        answers.fold([0.0; 2], |[least, most], mps2| {
            [mps2.min(least), mps2.max(most)]
        })
    }

    /// Fits an emergency brake to the samples.
    fn brake(&self, before: Option<EmergencyBrake>, seed: u64) -> Option<EmergencyBrake> {
        let changes: Vec<f64> = self.answers.iter().map(|answer| answer[1]).collect();
        brake_in(&self.situations, &changes, before, seed)
    }

    /// Returns the root mean square of a quantity over all samples.
    fn rms(&self, of: impl Fn(&[f32], &[f64; 3]) -> f64) -> f64 {
        let rows = self.inputs.chunks_exact(self.width.max(1));
        let squares = rows
            .zip(&self.answers)
            .map(|(row, answer)| of(row, answer).powi(2));
        (squares.sum::<f64>() / self.answers.len().max(1) as f64).sqrt()
    }

    /// Returns the samples in which the ego accelerates or brakes.
    ///
    /// Most samples are cruising, but plans depend on the braking.
    fn critical(&self, unit_mps2: f64) -> Vec<usize> {
        let is_critical = |answer: &[f64; 3]| {
            answer[0].abs() > CRITICAL || CRITICAL * unit_mps2 < answer[1].abs()
        };
        let samples = self.answers.iter().enumerate();
        let critical = samples.filter(|(_, answer)| is_critical(answer));
        critical.map(|(sample, _)| sample).collect()
    }
}

/// Fits the ensemble, and the brake over it.
///
/// Each member gets `updates` updates. `before` is a brake fitted earlier.
/// `None`: stopped, or there are no samples.
/// Equal samples and seeds give equal networks on any number of threads.
pub(super) fn fit(
    samples: &FitSamples,
    nearest: &Arc<[FittedModel]>,
    before: Option<EmergencyBrake>,
    updates: u64,
    seed: u64,
    watch: &Watch<'_>,
) -> Option<Arc<Surrogate>> {
    if samples.answers.is_empty() {
        return None;
    }
    let (mean, inverse_sd) = samples.scales();
    let mut surrogate = Surrogate {
        mean,
        inverse_sd,
        unit: samples.units(nearest),
        range_mps2: samples.range_mps2(),
        nearest: Arc::clone(nearest),
        members: Vec::new(),
        brake: None,
    };
    if let Some(brake) = samples.brake(before, seed) {
        // The line of a brake may also be the end of a smooth law. The brake is kept only
        // if it lowers the loss of a short fit.
        let with = Surrogate {
            brake: Some(brake),
            ..surrogate.clone()
        };
        let [left, less] = [&surrogate, &with].map(|surrogate| {
            let mut member_fit = MemberFit::new(samples, surrogate, seed);
            let net = member_fit.trained(TRIAL_UPDATES);
            member_fit.loss(&net)
        });
        if less < left {
            surrogate = with;
        }
    }
    // Members differ by their seed, so their disagreement shows where samples are missing.
    let seeds: Vec<u64> = (0..MEMBERS as u64)
        // From 1, because the fits that judge the brake use `seed` itself.
        .map(|member| seed ^ (member + 1))
        .collect();
    let one = |_: &mut (), &seed: &u64, _: &_| {
        Some(MemberFit::new(samples, &surrogate, seed).trained(updates))
    };
    // The members report no progress of their own.
    let quiet = watch.quiet();
    let members = EpisodeLoop::uncounted(&quiet).run(&seeds, || (), one);
    surrogate.members = members.into_iter().collect::<Option<_>>()?;
    Some(Arc::new(surrogate))
}

/// Fit of one member.
struct MemberFit<'a> {
    samples: &'a FitSamples,
    /// All rows in standard deviations.
    scaled: Vec<f32>,
    targets: Vec<[f32; ANSWERS]>,
    /// Upper limit of the first answer where the brake acts, infinite elsewhere.
    limits: Vec<f32>,
    critical: Vec<usize>,
    dice: LearnerRng,
}

impl<'a> MemberFit<'a> {
    fn new(samples: &'a FitSamples, surrogate: &Surrogate, seed: u64) -> MemberFit<'a> {
        let rows = 0..samples.answers.len();
        let scaled = rows.flat_map(|sample| surrogate.scaled(samples.row(sample)));
        let [accel, lateral] = surrogate.unit;
        let answers = samples.answers.iter().enumerate();
        let targets = answers.map(|(sample, answer)| {
            let left_mps2 = answer[1] - expected_mps2(&surrogate.nearest, samples.row(sample));
            let across = match lateral {
                // An ego that never moved sideways has no unit to divide by.
                0.0 => 0.0,
                unit => answer[2] / unit,
            };
            [(left_mps2 / accel) as f32, across as f32]
        });
        let mut member_fit = MemberFit {
            samples,
            limits: vec![f32::INFINITY; samples.answers.len()],
            scaled: scaled.collect(),
            targets: targets.collect(),
            // The unit of the outputs would not do here, because it is that of the part
            // which a stock controller leaves.
            critical: samples.critical(samples.rms(|_, answer| answer[1])),
            dice: LearnerRng::new(seed),
        };
        if let Some(brake) = &surrogate.brake {
            member_fit.limit(surrogate, brake);
        }
        member_fit
    }

    /// Limits the answers where the brake acts, so that it need not be learned.
    fn limit(&mut self, surrogate: &Surrogate, brake: &EmergencyBrake) {
        for (sample, limit) in self.limits.iter_mut().enumerate() {
            let braking = self
                .samples
                .situations
                .get(sample)
                .and_then(|situation| brake.change_mps2(situation));
            *limit = braking.map_or(f32::INFINITY, |change_mps2| {
                let row = self.samples.row(sample);
                let left_mps2 = change_mps2 - expected_mps2(&surrogate.nearest, row);
                (left_mps2 / surrogate.unit[0]) as f32
            });
        }
    }

    /// Draws a sample, every second time from the critical ones.
    fn draw(&mut self, i: usize) -> usize {
        if i.is_multiple_of(2) && !self.critical.is_empty() {
            self.critical[self.dice.below(self.critical.len())]
        } else {
            self.dice.below(self.targets.len())
        }
    }

    /// Returns the mean Huber loss over all samples plus that over the critical ones.
    fn loss(&self, net: &Mlp) -> f64 {
        let width = self.samples.width;
        let loss = |sample: usize| {
            let row = &self.scaled[sample * width..][..width];
            // The lateral speed is left out, because no brake has an influence on it.
            let predicted = net.evaluate(row, |out| answer_of(out).0[0]);
            // The brake limits the prediction here as it does in `ModelDriver::command`.
            let off = predicted.min(self.limits[sample]) - self.targets[sample][0];
            f64::from(if off.abs() < 1.0 {
                0.5 * off * off
            } else {
                off.abs() - 0.5
            })
        };
        let mean = |samples: &mut dyn Iterator<Item = usize>| {
            let (sum, count) = samples.fold((0.0, 0.0), |(sum, count), sample| {
                (sum + loss(sample), count + 1.0)
            });
            if count == 0.0 { 0.0 } else { sum / count }
        };
        mean(&mut (0..self.targets.len())) + mean(&mut self.critical.iter().copied())
    }

    fn trained(&mut self, updates: u64) -> Mlp {
        let width = self.samples.width;
        let sizes = [width, HIDDEN, HIDDEN, OUTPUTS];
        // A small last layer starts the fit near the answer of the stock controller.
        let mut net = Mlp::orthogonal(&sizes, 0.1, &mut self.dice);
        let mut adam = Adam::new(net.parameters().len());
        let (mut tape, mut gradient) = (net.tape(BATCH), vec![0.0; net.parameters().len()]);
        let mut batch = vec![0.0; BATCH * width];
        let mut wanted = [([0.0; ANSWERS], f32::INFINITY); BATCH];
        for update in 0..updates {
            for (i, wanted) in wanted.iter_mut().enumerate() {
                let sample = self.draw(i);
                let row = &self.scaled[sample * width..][..width];
                batch[i * width..][..width].copy_from_slice(row);
                *wanted = (self.targets[sample], self.limits[sample]);
            }
            net.forward(&batch, BATCH, &mut tape);
            huber(&net, &wanted, &mut tape);
            net.backward(&batch, BATCH, &mut tape, &mut gradient);
            let done = update as f64 / updates as f64;
            // The rate decays linearly to its last share.
            let rate = LEARNING_RATE * (1.0 - done * (1.0 - LAST_RATE));
            adam.step(net.parameters_mut(), &gradient, rate as f32);
        }
        net
    }
}

/// Target of both answers, and the limit that the brake puts on the first.
type Wanted = ([f32; ANSWERS], f32);

/// Writes the gradient of the mean Huber loss.
///
/// It bounds the influence of a single jump of a controller that switches.
fn huber(net: &Mlp, wanted: &[Wanted; BATCH], tape: &mut Tape) {
    let stride = net.output_stride();
    let (output, gradient) = net.output_and_gradient(BATCH, tape);
    let rows = output
        .chunks_exact(stride)
        .zip(gradient.chunks_exact_mut(stride));
    for ((output, gradient), (wanted, limit)) in rows.zip(wanted) {
        gradient.fill(0.0);
        let (predicted, mut slopes) = answer_of(output);
        // Where the brake limits the answer, the network has no influence and no gradient.
        if *limit < predicted[0] {
            slopes[0].fill(0.0);
        }
        for ((predicted, wanted), slopes) in predicted.into_iter().zip(wanted).zip(slopes) {
            let off = (predicted - wanted).clamp(-1.0, 1.0) / BATCH as f32;
            for (slope, by) in gradient.iter_mut().zip(slopes) {
                *slope += off * by;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of an ego that changes its acceleration by `law` of two inputs.
    fn samples(count: usize, law: impl Fn(f32, f32) -> f64) -> FitSamples {
        let mut dice = LearnerRng::new(7);
        let mut samples = FitSamples {
            width: 2,
            ..FitSamples::default()
        };
        for _ in 0..count {
            let row = [0, 1].map(|_| 2.0 * dice.unit() as f32 - 1.0);
            samples.inputs.extend(row);
            samples.answers.push([0.0, law(row[0], row[1]), 0.0]);
        }
        samples
    }

    #[test]
    fn members_learn_what_an_ego_does_and_differ_only_where_nothing_was_seen() {
        let law = |x: f32, y: f32| f64::from(0.3 * x - 0.2 * y.max(0.0));
        let seen = samples(2000, law);
        let watch = Watch::unwatched();
        let learned = fit(&seen, &Arc::default(), None, 3000, 1, &watch).expect("fitted");
        let answer = |member: usize, row: [f32; 2]| {
            let scaled: Vec<f32> = learned.scaled(&row).collect();
            let net = &learned.members[member];
            net.evaluate(&scaled, |out| {
                f64::from(answer_of(out).0[0]) * learned.unit[0]
            })
        };
        let mut squares = 0.0;
        for row in samples(200, law).inputs.chunks_exact(2) {
            let off = [0, 1].map(|member| answer(member, [row[0], row[1]]) - law(row[0], row[1]));
            squares += off.iter().map(|off| off * off).sum::<f64>() / 400.0;
        }
        assert!(squares.sqrt() < 0.01, "{}", squares.sqrt());
        let apart = |row| (answer(0, row) - answer(1, row)).abs();
        assert!(5.0 * apart([0.2, 0.3]) < apart([3.0, -3.0]));
    }

    #[test]
    fn what_a_brake_does_is_not_learned() {
        let net = Mlp::orthogonal(&[2, 4, OUTPUTS], 1.0, &mut LearnerRng::new(3));
        let batch = vec![0.5; 2 * BATCH];
        let gradient = |limit: f32| {
            let (mut tape, mut gradient) = (net.tape(BATCH), vec![0.0; net.parameters().len()]);
            net.forward(&batch, BATCH, &mut tape);
            huber(&net, &[([0.7, 0.0], limit); BATCH], &mut tape);
            net.backward(&batch, BATCH, &mut tape, &mut gradient);
            gradient.iter().map(|slope| slope.abs()).sum::<f32>()
        };
        let predicted = net.evaluate(&[0.5, 0.5], |out| answer_of(out).0);
        let across = |limit| gradient(limit) - gradient(predicted[0] - 1.0);
        assert!(across(f32::INFINITY) > 0.0 && across(predicted[0] + 1.0) == across(f32::INFINITY));
        assert_eq!(across(predicted[0] - 0.1), 0.0);
    }

    #[test]
    fn an_ego_that_keeps_its_lane_is_none_that_steers() {
        let watch = Watch::unwatched();
        let mut seen = samples(50, |x, _| f64::from(x));
        let learned = |seen: &FitSamples| fit(seen, &Arc::default(), None, 10, 1, &watch);
        let across = |seen: &FitSamples| learned(seen).expect("fitted").unit[1];
        assert_eq!(across(&seen), 0.0);
        for answer in &mut seen.answers {
            answer[2] = 0.5;
        }
        assert_eq!(across(&seen), 0.5);
        assert_eq!(learned(&FitSamples::default()), None);
    }
}
