//! Model of a driver's accelerations, decision by decision.

use std::f64::consts::PI;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use crate::simplex::minimum;

/// Second-order autoregression with Student t noise whose scale grows.
///
/// The next acceleration is `mean + carry[0]·a + carry[1]·b + scale·t`, where a is the
/// last acceleration, b the one before, and t has `freedom` degrees of freedom. The
/// scale is `scale[0] + scale[1]·|a| + scale[2]·|a − b|`. All are means over decisions
/// of 0.5 s in m/s².
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccelerationModel {
    /// Constant part in m/s².
    pub mean: f64,
    /// Weights of the last two accelerations.
    pub carry: [f64; 2],
    /// Scale of the noise: constant in m/s², per |a|, per |a − b|.
    pub scale: [f64; 3],
    /// Degrees of freedom of the noise, above 2.
    pub freedom: f64,
}

impl AccelerationModel {
    /// Fits the model by maximum likelihood.
    ///
    /// Each series has the accelerations of unbroken decisions in m/s². Returns `None`
    /// for fewer than 100 decisions.
    pub fn fit(series: &[Vec<f64>]) -> Option<AccelerationModel> {
        let triples: Vec<[f64; 3]> = series
            .iter()
            .flat_map(|it| it.windows(3).map(|w| [w[0], w[1], w[2]]))
            .collect();
        // Seven parameters from fewer decisions would describe their noise.
        if triples.len() < 100 {
            return None;
        }
        let loss = |p: &[f64], triples: &[[f64; 3]]| {
            let model = AccelerationModel::of_parameters(p);
            let terms = triples
                .iter()
                .map(|[b, a, next]| model.log_density_at([*b, *a], *next));
            -(terms.sum::<f64>() / triples.len() as f64 + model.constant())
        };
        // Scales and the freedom are logarithms, which keep them positive
        // without bounds.
        let start = [0.0, 1.0, -0.3, -2.3, -2.0, -2.0, 1.0];
        let step = [0.05, 0.2, 0.2, 0.5, 0.5, 0.5, 0.5];
        // A tenth of the data finds the neighbourhood, all of it the place.
        let few: Vec<[f64; 3]> = triples
            .iter()
            .step_by(triples.len().div_ceil(8000))
            .copied()
            .collect();
        let rough = minimum(|p| loss(p, &few), &start, &step, 500);
        let near = [0.01, 0.05, 0.05, 0.1, 0.1, 0.1, 0.2];
        let fine = minimum(|p| loss(p, &triples), &rough, &near, 250);
        Some(AccelerationModel::of_parameters(&fine))
    }

    fn of_parameters(p: &[f64]) -> AccelerationModel {
        AccelerationModel {
            mean: p[0],
            carry: [p[1], p[2]],
            scale: [libm::exp(p[3]), libm::exp(p[4]), libm::exp(p[5])],
            // Above 2 the noise has a variance.
            freedom: 2.0 + libm::exp(p[6]),
        }
    }

    /// Returns the part of the log density that no observation changes.
    fn constant(&self) -> f64 {
        let nu = self.freedom;
        // Computed once per likelihood, since `lgamma` is the costliest part
        // of it.
        libm::lgamma(0.5 * (nu + 1.0)) - libm::lgamma(0.5 * nu) - 0.5 * libm::log(nu * PI)
    }

    /// Returns centre and scale of the next acceleration in m/s², `before` it two others.
    pub fn centre_and_scale(&self, [b, a]: [f64; 2]) -> (f64, f64) {
        let centre = self.mean + self.carry[0] * a + self.carry[1] * b;
        let scale = self.scale[0] + self.scale[1] * a.abs() + self.scale[2] * (a - b).abs();
        (centre, scale)
    }

    /// Returns the log density of `next` without its constant.
    fn log_density_at(&self, before: [f64; 2], next: f64) -> f64 {
        let (centre, scale) = self.centre_and_scale(before);
        let z = (next - centre) / scale;
        // `log1p` keeps the digits of a small z², and `libm` the bits on all
        // machines.
        -libm::log(scale) - 0.5 * (self.freedom + 1.0) * libm::log1p(z * z / self.freedom)
    }

    /// Returns the natural log likelihood of accelerations after two of zero.
    pub fn log_likelihood(&self, accelerations_mps2: &[f64]) -> f64 {
        let constant = self.constant();
        let mut before = [0.0; 2];
        let mut sum = 0.0;
        for accel in accelerations_mps2 {
            sum += constant + self.log_density_at(before, *accel);
            before = [before[1], *accel];
        }
        sum
    }

    /// Returns the mean log likelihood per second of series, given their first two.
    pub fn log_likelihood_per_s(&self, series: &[Vec<f64>]) -> f64 {
        let (mut sum, mut n) = (0.0, 0_usize);
        for triple in series.iter().flat_map(|it| it.windows(3)) {
            sum += self.log_density_at([triple[0], triple[1]], triple[2]);
            n += 1;
        }
        (sum / n.max(1) as f64 + self.constant()) / crate::DECISION_S
    }

    /// Draws the acceleration after `before`, the last one second.
    pub fn next(&self, before: [f64; 2], rng: &mut impl Rng) -> f64 {
        let (centre, scale) = self.centre_and_scale(before);
        centre + scale * student(self.freedom, rng)
    }
}

/// Draws a Student t (Bailey 1994, polar method).
fn student(freedom: f64, rng: &mut impl Rng) -> f64 {
    loop {
        let u = 2.0 * rng.random::<f64>() - 1.0;
        let v = 2.0 * rng.random::<f64>() - 1.0;
        let w = u * u + v * v;
        // Points outside of the unit disc are drawn again, and 0 would divide
        // by 0.
        if w > 0.0 && w <= 1.0 {
            let spread = freedom * (libm::pow(w, -2.0 / freedom) - 1.0) / w;
            return u * libm::sqrt(spread);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn truth() -> AccelerationModel {
        AccelerationModel {
            mean: 0.0,
            carry: [1.1, -0.35],
            scale: [0.06, 0.12, 0.2],
            freedom: 5.5,
        }
    }

    #[test]
    fn a_fit_finds_the_parameters_that_made_the_data() {
        let (truth, mut rng) = (truth(), ChaCha8Rng::seed_from_u64(1));
        let series: Vec<Vec<f64>> = (0..40)
            .map(|_| {
                let mut all = vec![0.0, 0.0];
                for k in 0..500 {
                    all.push(truth.next([all[k], all[k + 1]], &mut rng));
                }
                all
            })
            .collect();
        let found = AccelerationModel::fit(&series).expect("enough decisions");
        let pairs = [
            (found.carry[0], truth.carry[0], 0.03),
            (found.carry[1], truth.carry[1], 0.03),
            (found.scale[0], truth.scale[0], 0.005),
            (found.scale[1], truth.scale[1], 0.02),
            (found.scale[2], truth.scale[2], 0.02),
            (found.freedom, truth.freedom, 0.8),
        ];
        for (found, truth, within) in pairs {
            assert!((found - truth).abs() < within, "{found} instead of {truth}");
        }
        let better = found.log_likelihood_per_s(&series) - truth.log_likelihood_per_s(&series);
        assert!((0.0..0.01).contains(&better), "{better}");
    }

    #[test]
    fn the_noise_has_the_quantiles_of_student_t() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut all: Vec<f64> = (0..200_000).map(|_| student(5.0, &mut rng)).collect();
        all.sort_by(f64::total_cmp);
        // Quantiles at 0.5, 0.9 and 0.99 of t with 5 degrees of freedom.
        for (share, expected) in [(0.5, 0.0), (0.9, 1.476), (0.99, 3.365)] {
            let found = all[(share * all.len() as f64) as usize];
            assert!((found - expected).abs() < 0.06, "{share}: {found}");
        }
    }

    #[test]
    fn the_density_adds_to_one() {
        let model = truth();
        let density = |x: f64| libm::exp(model.constant() + model.log_density_at([0.2, -0.4], x));
        let sum: f64 = (-40_000..40_000)
            .map(|i| density(f64::from(i) * 1e-3) * 1e-3)
            .sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
    }
}
