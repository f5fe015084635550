//! Trainings and starts drawn from known distributions, and how often an
//! interval of their marks holds the truth.

use brakecheck::seed::generator;
use brakecheck::stats::{
    Outcomes, StartOutcome, mean_difference, normal_cdf, normal_quantile, paired_difference,
    seeds_interval,
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Trainings of one ado: Beta-distributed success rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trainings {
    /// How many are seen; 1 for a fixed policy, whose rate does not vary.
    pub count: usize,
    /// Mean rate.
    pub rate: f64,
    /// Standard deviation of the rates.
    pub spread: f64,
}

/// One line of the simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Whose rate is estimated.
    pub a: Trainings,
    /// Whose rate is taken away, on the same starts.
    pub b: Option<Trainings>,
    /// How much easier each ego is for everybody, in logits; one ego: `[0.0]`.
    pub egos: Vec<f64>,
    /// Starts; the same for all.
    pub starts: usize,
    /// Correlation between trainings of what decides a start.
    pub shared: f64,
}

/// How often, and with what width.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coverage {
    /// Experiments.
    pub experiments: u64,
    /// Those whose interval holds the truth.
    pub covered: u64,
    /// Mean width of the interval.
    pub width: f64,
    /// Width of ± 1.96 true standard deviations of the estimate: what somebody
    /// would state who knew how much trainings and starts vary.
    pub oracle: f64,
}

impl Coverage {
    /// covered / experiments.
    pub fn share(&self) -> f64 {
        self.covered as f64 / self.experiments as f64
    }
}

/// What one experiment came to.
#[derive(Clone, Copy, Default)]
struct Sums {
    covered: u64,
    width: f64,
    estimate: f64,
    square: f64,
}

impl Cell {
    /// Trainings of one ado against the one ego.
    pub fn of_rate(a: Trainings, starts: usize, shared: f64) -> Cell {
        Cell {
            a,
            b: None,
            egos: vec![0.0],
            starts,
            shared,
        }
    }

    /// Runs so many experiments of a seed; equal for any number of threads.
    pub fn cover(&self, experiments: u64, seed: u64) -> Coverage {
        let truth = self.truth();
        let all = (0..experiments).into_par_iter();
        let sums = all
            .map(|number| self.experiment((seed, number), truth))
            .reduce(Sums::default, |a, b| Sums {
                covered: a.covered + b.covered,
                width: a.width + b.width,
                estimate: a.estimate + b.estimate,
                square: a.square + b.square,
            });
        let n = experiments as f64;
        let variance = sums.square / n - (sums.estimate / n).powi(2);
        Coverage {
            experiments,
            covered: sums.covered,
            width: sums.width / n,
            oracle: 2.0 * 1.96 * variance.max(0.0).sqrt(),
        }
    }

    fn experiment(&self, (seed, number): (u64, u64), truth: f64) -> Sums {
        let mut dice = generator("coverage", &[self.key(), seed, number]);
        let starts: Vec<f64> = (0..self.starts).map(|_| normal(&mut dice)).collect();
        let a = self.marks(self.a, &starts, &mut dice);
        let b = self.b.map(|b| self.marks(b, &starts, &mut dice));
        let (estimate, [lo, hi]) = match (&b, self.egos.len()) {
            (None, _) => (rate(&a[0]), seeds_interval(&all(&a[0]))),
            (Some(b), 1) => paired_difference(&all(&a[0]), &all(&b[0])),
            (Some(b), _) => {
                let pairs = a.iter().zip(b).map(|(a, b)| (all(a), all(b)));
                mean_difference(&pairs.collect::<Vec<_>>())
            }
        };
        Sums {
            covered: u64::from(lo <= truth && truth <= hi),
            width: hi - lo,
            estimate,
            square: estimate * estimate,
        }
    }

    /// Marks per ego and training: every start has a difficulty, and every
    /// training its rate and its luck.
    fn marks(&self, of: Trainings, starts: &[f64], dice: &mut ChaCha8Rng) -> Vec<Vec<Outcomes>> {
        let rates: Vec<f64> = (0..of.count).map(|_| of.draw(dice)).collect();
        let one = |rate: f64, dice: &mut ChaCha8Rng| -> Outcomes {
            let threshold = normal_quantile(rate);
            let (difficult, luck) = (self.shared.sqrt(), (1.0 - self.shared).sqrt());
            let marks = starts.iter().map(|start| {
                let chance = match self.shared {
                    0.0 => rate,
                    _ => normal_cdf((threshold - difficult * start) / luck),
                };
                if dice.random::<f64>() < chance {
                    StartOutcome::Solved
                } else {
                    StartOutcome::Unsolved
                }
            });
            marks.collect()
        };
        let egos = self.egos.iter();
        egos.map(|&easier| {
            let rates = rates.iter();
            rates
                .map(|&rate| one(shifted(rate, easier), dice))
                .collect()
        })
        .collect()
    }

    /// What the estimate is of: the mean over trainings, starts and these egos.
    fn truth(&self) -> f64 {
        let of = |of: Trainings| {
            if self.egos == [0.0] {
                return of.rate;
            }
            // Rates are bent where egos differ, so their mean is too.
            const DRAWS: u32 = 400_000;
            let mut dice = generator("coverage/truth", &[self.key()]);
            let mut sum = 0.0;
            for _ in 0..DRAWS {
                let rate = of.draw(&mut dice);
                sum += self.egos.iter().map(|&ego| shifted(rate, ego)).sum::<f64>();
            }
            sum / f64::from(DRAWS) / self.egos.len() as f64
        };
        of(self.a) - self.b.map_or(0.0, of)
    }

    /// A number of its own for every cell.
    fn key(&self) -> u64 {
        let numbers = |of: Trainings| [of.count as f64, of.rate, of.spread];
        let b = self.b.map_or([0.0; 3], numbers);
        let all = [self.starts as f64, self.shared, self.egos.len() as f64];
        let all = numbers(self.a).into_iter().chain(b).chain(all);
        all.fold(0, |key: u64, number| {
            key.wrapping_mul(0x0100_0000_01b3) ^ (number * 1e4).round() as u64
        })
    }
}

impl Trainings {
    /// The rate of one more training.
    fn draw(&self, dice: &mut ChaCha8Rng) -> f64 {
        if self.spread == 0.0 {
            return self.rate;
        }
        let size = self.rate * (1.0 - self.rate) / (self.spread * self.spread) - 1.0;
        assert!(size > 0.0, "no rates in [0, 1] spread so far: {self:?}");
        let good = gamma(self.rate * size, dice);
        let bad = gamma((1.0 - self.rate) * size, dice);
        good / (good + bad)
    }
}

fn all(marks: &[Outcomes]) -> Vec<&Outcomes> {
    marks.iter().collect()
}

fn rate(marks: &[Outcomes]) -> f64 {
    let ones = |marks: &Outcomes| marks.count(StartOutcome::Solved);
    let rates = marks.iter().map(|m| ones(m) as f64 / m.len() as f64);
    rates.sum::<f64>() / marks.len() as f64
}

/// A rate on an ego that is so much easier.
fn shifted(rate: f64, logits: f64) -> f64 {
    match logits {
        0.0 => rate,
        _ => 1.0 / (1.0 + (1.0 - rate) / rate * libm::exp(-logits)),
    }
}

/// Box and Muller 1958.
fn normal(dice: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * libm::log(1.0 - dice.random::<f64>())).sqrt();
    radius * libm::cos(core::f64::consts::TAU * dice.random::<f64>())
}

/// Marsaglia and Tsang 2000; for a shape below 1 with their last section's power.
fn gamma(shape: f64, dice: &mut ChaCha8Rng) -> f64 {
    if shape < 1.0 {
        let power = libm::pow(1.0 - dice.random::<f64>(), 1.0 / shape);
        return gamma(shape + 1.0, dice) * power;
    }
    let d = shape - 1.0 / 3.0;
    let c = 1.0 / (9.0 * d).sqrt();
    loop {
        let x = normal(dice);
        let v = (1.0 + c * x).powi(3);
        let u = 1.0 - dice.random::<f64>();
        if v > 0.0 && libm::log(u) < 0.5 * x * x + d - d * v + d * libm::log(v) {
            return d * v;
        }
    }
}
