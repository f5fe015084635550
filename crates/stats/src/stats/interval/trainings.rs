//! Mean rate of all trainings, estimated from the rates of a few.
//!
//! The model: a training solves a start with its own rate p. Rates of trainings
//! are Beta-distributed with mean μ and intra-class correlation φ, so their
//! variance is φ μ (1 − μ) (Crowder 1978). The priors are Beta(½, ½) for μ
//! (Jeffreys) and Beta(0.45, 3) for φ.
//!
//! Near φ = 0 the latter is nearly uniform in the trainings' standard deviation
//! (Gelman 2006). So a handful of equal rates is no proof that trainings never
//! differ. It falls towards φ = 1, where trainings solve either every start or
//! none. The interval is the central 95 % of the posterior of μ.

use super::{expit, logit};

/// Exponent of φ in its prior, plus one.
// Both exponents were chosen by simulated coverage and width, on other random numbers than
// those of `examples/coverage`. A two-level bootstrap covers 75 to 89 % instead of 95 % where
// trainings differ by 5 to 10 points.
const SMALL: f64 = 0.45;
/// Exponent of 1 − φ in its prior.
const LARGE: f64 = 2.0;
/// Nodes of φ, and of μ on either side of the measured mean.
const NODES: (usize, usize) = (20, 32);
/// Reach of the nodes of μ, in logits.
const REACH: f64 = 14.0;
/// Difference in log density from which nodes are left out.
const NEGLIGIBLE: f64 = 20.0;

/// 95 % interval of μ from the rates of two or more trainings.
///
/// Each rate is measured on `starts` coins. The quadrature has 20 × 65 nodes.
/// Its ends are within 2 % of the width of what finer grids give.
pub(super) fn interval(rates: &[f64], starts: f64) -> [f64; 2] {
    let mus = Mus::around(rates, starts);
    let lines: Vec<Vec<(usize, f64)>> = (0..NODES.0)
        .map(|node| {
            // In t = φ^SMALL the prior is flat, except for (1 − φ)^LARGE. Nodes
            // are evenly spaced in √t, because small φ matter most.
            let root = (node as f64 + 0.5) / NODES.0 as f64;
            let phi = libm::pow(root, 2.0 / SMALL);
            mus.posterior(phi, root, rates, starts)
        })
        .collect();
    // Relative to the greatest log density, so that not all exponentials
    // underflow.
    let best = lines
        .iter()
        .flatten()
        .map(|(_, log)| *log)
        .fold(f64::NEG_INFINITY, f64::max);
    let mut density = vec![0.0; mus.nodes.len()];
    for (node, log) in lines.into_iter().flatten() {
        density[node] += libm::exp(log - best);
    }
    [0.025, 0.975].map(|share| mus.quantile(&density, share))
}

/// Rate measured on `n` starts, with half a success and half a failure more.
///
/// It is therefore neither 0 nor 1.
pub(super) fn inside(rate: f64, n: f64) -> f64 {
    (rate * n + 0.5) / (n + 1.0)
}

/// Values of μ at which the posterior is evaluated.
///
/// They are logit⁻¹(centre + scale · sinh u) for evenly spaced u: dense near
/// the rates, sparse in the tails.
struct Mus {
    centre: f64,
    scale: f64,
    step: f64,
    nodes: Vec<Mu>,
}

/// Node: μ, 1 − μ, and the logarithm of prior times dμ/du.
struct Mu {
    p: f64,
    q: f64,
    log_prior: f64,
}

impl Mus {
    fn around(rates: &[f64], starts: f64) -> Mus {
        let trainings = rates.len() as f64;
        let mean = rates.iter().sum::<f64>() / trainings;
        let squares = rates.iter().map(|rate| (rate - mean).powi(2)).sum::<f64>();
        let mean = inside(mean, starts);
        let variance = mean * (1.0 - mean);
        let error = squares / (trainings - 1.0) / trainings + variance / (starts * trainings);
        // The standard error on the logit scale, at most 1 so that the nodes
        // stay dense.
        let (centre, scale) = (logit(mean), (error.sqrt() / variance).min(1.0));
        let half = NODES.1;
        let step = libm::asinh(REACH / scale) / half as f64;
        let node = |node: usize| {
            let u = (node as f64 - half as f64) * step;
            let x = centre + scale * libm::sinh(u);
            // 1 − p would lose all digits near 1, so q has its own formula.
            let (p, q) = (expit(x), expit(-x));
            // Jeffreys: (p q)^-½ dp, and dp = p q dx.
            let log_prior = 0.5 * libm::log(p * q) + libm::log(scale * libm::cosh(u));
            Mu { p, q, log_prior }
        };
        Mus {
            centre,
            scale,
            step,
            nodes: (0..=2 * half).map(node).collect(),
        }
    }

    /// Log posterior density at the relevant nodes, for one φ with its weight.
    ///
    /// The density is unimodal with its mode near the middle. Both walks end
    /// once they are far below it.
    fn posterior(&self, phi: f64, weight: f64, rates: &[f64], starts: f64) -> Vec<(usize, f64)> {
        let size = 1.0 / phi - 1.0;
        let trainings = rates.len() as f64;
        // These terms do not depend on μ and are computed once.
        let alone = trainings * (log_gamma(size) - log_gamma(size + starts))
            + LARGE * libm::log(1.0 - phi)
            + libm::log(weight);
        let at = |node: usize| {
            let Mu { p, q, log_prior } = self.nodes[node];
            let (a, b) = (p * size, q * size);
            let mut log = alone + log_prior - trainings * (log_gamma(a) + log_gamma(b));
            for rate in rates {
                // Products first: b may be too small to survive a sum with
                // `starts`.
                let (solved, failed) = (rate * starts, (1.0 - rate) * starts);
                log += log_gamma(a + solved) + log_gamma(b + failed);
            }
            log
        };
        let middle = self.nodes.len() / 2;
        let mut top = f64::NEG_INFINITY;
        let mut line = Vec::new();
        let mut walk = |nodes: &mut dyn Iterator<Item = usize>| {
            for node in nodes {
                let log = at(node);
                top = f64::max(top, log);
                line.push((node, log));
                if log < top - NEGLIGIBLE {
                    break;
                }
            }
        };
        walk(&mut (0..=middle).rev());
        walk(&mut (middle + 1..self.nodes.len()));
        line
    }

    /// Quantile of a density that is linear between nodes.
    fn quantile(&self, density: &[f64], share: f64) -> f64 {
        let pairs = || density.windows(2).map(|pair| (pair[0], pair[1]));
        let whole: f64 = pairs().map(|(a, b)| 0.5 * (a + b)).sum();
        let mut left = share * whole;
        let mut position = 0.0;
        for (a, b) in pairs() {
            let area = 0.5 * (a + b);
            if left <= area {
                // This form of the root of a f + (b − a) f² / 2 = left stays
                // finite.
                let root = (a * a + 2.0 * (b - a) * left).max(0.0).sqrt();
                position += if a + root > 0.0 {
                    2.0 * left / (a + root)
                } else {
                    0.0
                };
                break;
            }
            left -= area;
            position += 1.0;
        }
        let u = (position - NODES.1 as f64) * self.step;
        expit(self.centre + self.scale * libm::sinh(u))
    }
}

/// ln Γ(x) for x > 0: Stirling's series from 8 on, and the recurrence below.
///
/// `libm::lgamma` has more digits than a quadrature of 1300 nodes needs, and is
/// three times slower.
fn log_gamma(x: f64) -> f64 {
    let (mut x, mut product) = (x, 1.0);
    while x < 8.0 {
        product *= x;
        x += 1.0;
    }
    let (r, r2) = (1.0 / x, 1.0 / (x * x));
    let series = r * (1.0 / 12.0 - r2 * (1.0 / 360.0 - r2 * (1.0 / 1260.0 - r2 / 1680.0)));
    let half_log_tau = 0.918_938_533_204_672_7;
    (x - 0.5) * libm::log(x) - x + half_log_tau + series - libm::log(product)
}
