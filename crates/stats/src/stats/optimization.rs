//! Minimization: cross-entropy search, damped Gauss-Newton steps, logistic regression.
//!
//! Cross-entropy search (Rubinstein 1999) finds the region: draw, select the best, refit.
//! Gauss-Newton steps (Levenberg 1944, Marquardt 1963) follow narrow valleys, such as the
//! trade-off between a late brake and a weak gain.
//!
//! Near the optimum the deviations are nearly linear, r(x + d) ≈ r + J d. The step that
//! solves (JᵀJ + λ diag JᵀJ) d = −Jᵀr then goes most of the way.
//! Elsewhere λ shortens the step and turns it downhill.
//! A simulation has no derivatives, so the slopes come from runs beside the point.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::seed::normal;

/// Best point found, in −1 ..= 1 per dimension, and its cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    pub point: Vec<f64>,
    pub cost: f64,
}

/// Least standard deviation, of a range from −1 to 1.
const LEAST_SPREAD: f64 = 0.005;

/// Length and width of a search.
#[derive(Clone, Copy, Debug)]
pub struct CrossEntropySearch {
    generations: usize,
    population: usize,
    elite: usize,
    /// Standard deviation at the start.
    wide: f64,
}

impl CrossEntropySearch {
    /// Search of the whole box.
    pub const WIDE: CrossEntropySearch = CrossEntropySearch {
        generations: 20,
        population: 48,
        elite: 8,
        wide: 0.8,
    };
    /// Search of the whole box for costs that take many simulations.
    pub const COARSE: CrossEntropySearch = CrossEntropySearch {
        generations: 5,
        population: 20,
        elite: 5,
        wide: 0.8,
    };
    /// Search around a point that is nearly right, for costs that take many simulations.
    pub const COARSE_NEAR: CrossEntropySearch = CrossEntropySearch {
        generations: 3,
        population: 16,
        elite: 4,
        wide: 0.4,
    };
    /// Search around a point that is nearly right.
    pub const NEAR: CrossEntropySearch = CrossEntropySearch {
        generations: 10,
        population: 32,
        elite: 6,
        wide: 0.2,
    };

    /// Returns the number of points that it measures.
    pub fn points(&self) -> usize {
        self.generations * self.population
    }

    /// Searches around `mean`; `costs` measures many points at once.
    pub fn run(
        &self,
        mut mean: Vec<f64>,
        dice: &mut ChaCha8Rng,
        costs: &dyn Fn(&[Vec<f64>]) -> Vec<f64>,
    ) -> Fit {
        let mut spread = vec![self.wide; mean.len()];
        let mut best = Fit {
            point: mean.clone(),
            cost: f64::INFINITY,
        };
        for _ in 0..self.generations {
            let mut points: Vec<Vec<f64>> = (1..self.population)
                .map(|_| draw(&mean, &spread, dice))
                .collect();
            // The mean is measured too, so the result is never worse than the starting
            // point.
            points.push(mean.clone());
            let measured = costs(&points);
            let mut order: Vec<usize> = (0..points.len()).collect();
            // Equal costs keep the order of the draws: a stable sort.
            order.sort_by(|&a, &b| measured[a].total_cmp(&measured[b]));
            if measured[order[0]] < best.cost {
                best = Fit {
                    point: points[order[0]].clone(),
                    cost: measured[order[0]],
                };
            }
            let elite: Vec<&Vec<f64>> = order[..self.elite].iter().map(|&i| &points[i]).collect();
            (mean, spread) = refit(&elite, LEAST_SPREAD);
        }
        best
    }
}

/// Mean and standard deviation of one or more points, per dimension; the deviation is at
/// least `least`, which keeps a search from standing still too early.
fn refit(points: &[&Vec<f64>], least: f64) -> (Vec<f64>, Vec<f64>) {
    // Invariant: there is a point.
    debug_assert!(!points.is_empty());
    let count = points.len() as f64;
    let dimensions = points.first().map_or(0, |point| point.len());
    let per_dimension = (0..dimensions).map(|d| {
        let mean = points.iter().map(|point| point[d]).sum::<f64>() / count;
        let squares = points.iter().map(|point| (point[d] - mean).powi(2));
        (mean, (squares.sum::<f64>() / count).sqrt().max(least))
    });
    per_dimension.unzip()
}

/// A point about `mean`, in the box.
fn draw(mean: &[f64], spread: &[f64], dice: &mut ChaCha8Rng) -> Vec<f64> {
    let pairs = mean.iter().zip(spread);
    pairs
        .map(|(mean, spread)| (mean + spread * normal(dice)).clamp(-1.0, 1.0))
        .collect()
}

/// A position by its share; rounding leaves what remains to the last one.
pub fn pick(shares: &[f64], rng: &mut ChaCha8Rng) -> usize {
    let mut left = rng.random::<f64>();
    let below = shares.iter().position(|share| {
        left -= share;
        left < 0.0
    });
    below.unwrap_or(shares.len() - 1)
}

/// Largest number of steps.
const STEPS: usize = 12;
/// Dampings tried at each step.
///
/// Their runs are played in parallel, so the previous step need not predict a damping.
const DAMPINGS: [f64; 5] = [1e-6, 1e-3, 1e-1, 1e1, 1e3];
/// Distance for derivatives, in a range from −1 to 1.
const NEAR: f64 = 0.01;
/// Relative gain below which a step is the last step.
const GAIN: f64 = 1e-3;

/// Deviations of a point in every sample of every run.
pub(crate) type Deviations = Vec<f64>;

/// Descends from `point` along the dimensions in `free`.
///
/// `measure` returns the deviations of many points at once. The cost of a point is
/// `cost`.
pub fn descend(
    point: Vec<f64>,
    free: &[usize],
    measure: &dyn Fn(&[Vec<f64>]) -> Vec<Deviations>,
) -> Fit {
    let mut here = point;
    let mut deviations = first(measure(std::slice::from_ref(&here)));
    for _ in 0..STEPS {
        let moved: Vec<Vec<f64>> = free.iter().map(|&d| beside(&here, d)).collect();
        let slopes: Vec<Vec<f64>> = measure(&moved)
            .iter()
            .zip(free.iter().zip(&moved))
            .map(|(there, (&d, moved))| {
                // Rounding and the edge of the box change the distance, so it is
                // measured.
                let by = moved[d] - here[d];
                let pairs = there.iter().zip(&deviations);
                pairs.map(|(there, here)| (there - here) / by).collect()
            })
            .collect();
        let count = free.len();
        let left = DMatrix::from_fn(count, count, |i, j| dot(&slopes[i], &slopes[j]));
        let right = DVector::from_fn(count, |i, _| -dot(&slopes[i], &deviations));
        let candidates: Vec<Vec<f64>> = DAMPINGS
            // A damping without a solution is skipped.
            .iter()
            .filter_map(|damping| step(&here, free, left.clone(), &right, *damping))
            .collect();
        let measured = measure(&candidates).into_iter().zip(candidates);
        let best = measured.min_by(|(a, _), (b, _)| cost(a).total_cmp(&cost(b)));
        let Some((there, candidate)) = best else {
            break;
        };
        let (before, after) = (cost(&deviations), cost(&there));
        // No damping improves the point, so it is a minimum up to the slopes' precision.
        if before <= after {
            break;
        }
        (here, deviations) = (candidate, there);
        if before * (1.0 - GAIN) < after {
            break;
        }
    }
    Fit {
        cost: cost(&deviations),
        point: here,
    }
}

/// Returns the root mean square distance of deviations.
pub fn cost(deviations: &[f64]) -> f64 {
    let sum: f64 = deviations.iter().map(|d| d * d).sum();
    // Three deviations, x, y and speed, form one distance.
    (3.0 * sum / deviations.len().max(1) as f64).sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn first(measured: Vec<Deviations>) -> Deviations {
    measured.into_iter().next().unwrap_or_default()
}

/// Returns a point near `here` along a dimension, inside the box.
fn beside(here: &[f64], d: usize) -> Vec<f64> {
    let mut there = here.to_vec();
    there[d] += if here[d] + NEAR <= 1.0 { NEAR } else { -NEAR };
    there
}

/// Returns the end of a damped step, or `None` if the equations have no solution.
///
/// `left` is JᵀJ and `right` is −Jᵀr.
fn step(
    here: &[f64],
    free: &[usize],
    mut left: DMatrix<f64>,
    right: &DVector<f64>,
    damping: f64,
) -> Option<Vec<f64>> {
    for i in 0..free.len() {
        // Marquardt: damping in proportion to the diagonal, so that flat dimensions are
        // damped less than steep ones. A dimension without slope stays in place.
        left[(i, i)] = left[(i, i)] * (1.0 + damping) + 1e-12;
    }
    let by = left.lu().solve(right)?;
    let mut there = here.to_vec();
    for (&d, by) in free.iter().zip(&by) {
        there[d] = (there[d] + by).clamp(-1.0, 1.0);
    }
    by.iter().all(|by| by.is_finite()).then_some(there)
}

/// Regularisation of the weights, in standard deviations.
pub const SMALL_WEIGHTS: f64 = 1e-4;
/// Largest number of Newton steps.
const NEWTON_STEPS: usize = 40;

/// Adds a weighted row with its target to the normal equations.
pub fn add_equation(
    left: &mut DMatrix<f64>,
    right: &mut DVector<f64>,
    row: &[f64],
    weight: f64,
    wanted: f64,
) {
    for (i, a) in row.iter().enumerate() {
        right[i] += weight * a * wanted;
        for (j, b) in row.iter().enumerate() {
            left[(i, j)] += weight * a * b;
        }
    }
}

/// Fits a logistic regression to the signs of `worths`.
///
/// Their magnitudes weight the rows. The second to last column must be constant.
/// Newton steps are halved where they overshoot. `None`: the problem has no solution.
pub fn logistic(rows: &[Vec<f64>], worths: &[f64]) -> Option<Vec<f64>> {
    let width = rows.first()?.len();
    let constant = width - 2;
    let count = rows.len() as f64;
    let mean = |i: usize| {
        if i == constant {
            0.0
        } else {
            rows.iter().map(|row| row[i]).sum::<f64>() / count
        }
    };
    let means: Vec<f64> = (0..width).map(mean).collect();
    let sd = |i: usize| {
        if i == constant {
            1.0
        } else {
            let squares = rows.iter().map(|row| (row[i] - means[i]).powi(2));
            // A constant column is not amplified.
            let sd = (squares.sum::<f64>() / count).sqrt();
            sd.max(1e-6 * (1.0 + means[i].abs()))
        }
    };
    let sds: Vec<f64> = (0..width).map(sd).collect();
    let scaled = |row: &Vec<f64>| {
        let row = row.iter().zip(&means).zip(&sds);
        row.map(|((value, mean), sd)| (value - mean) / sd)
            .collect::<Vec<f64>>()
    };
    let rows: Vec<Vec<f64>> = rows.iter().map(scaled).collect();
    let at = |weights: &DVector<f64>, row: &[f64]| -> f64 {
        row.iter().zip(weights.iter()).map(|(a, b)| a * b).sum()
    };
    let loss = |weights: &DVector<f64>| {
        let losses = rows.iter().zip(worths).map(|(row, worth)| {
            // This form of the logistic loss does not overflow for large arguments.
            let wrong = -worth.signum() * at(weights, row);
            worth.abs() * (wrong.max(0.0) + libm::log1p(libm::exp(-wrong.abs())))
        });
        losses.sum::<f64>() + 0.5 * SMALL_WEIGHTS * weights.norm_squared()
    };
    let mut weights = DVector::zeros(width);
    let mut here = loss(&weights);
    for _ in 0..NEWTON_STEPS {
        let mut left = DMatrix::identity(width, width) * SMALL_WEIGHTS;
        let mut right = &weights * -SMALL_WEIGHTS;
        for (row, worth) in rows.iter().zip(worths) {
            let braked = 1.0 / (1.0 + libm::exp(-at(&weights, row)));
            // The floor keeps the division below finite for certain rows.
            let curved = worth.abs() * (braked * (1.0 - braked)).max(1e-12);
            let missing = f64::from(u8::from(*worth > 0.0)) - braked;
            // The gradient, expressed as a weighted row with a target.
            let wanted = worth.abs() * missing / curved;
            add_equation(&mut left, &mut right, row, curved, wanted);
        }
        // The weights' regularisation keeps the matrix positive definite, as Cholesky
        // requires.
        let step = left.cholesky()?.solve(&right);
        let mut share = 1.0;
        let there = loop {
            let there = &weights + &step * share;
            if loss(&there) < here || share < 1e-3 {
                break there;
            }
            share *= 0.5;
        };
        let lower = loss(&there);
        // A share below 1e-3 ends the halving, and the loss check below rejects the step.
        if here <= lower {
            break;
        }
        let gained = here - lower;
        (weights, here) = (there, lower);
        // A relative gain this small cannot change the threshold noticeably.
        if gained < 1e-6 * here {
            break;
        }
    }
    // Back from scaled to raw columns, with the means absorbed by the constant.
    let mut raw: Vec<f64> = weights
        .iter()
        .zip(&sds)
        .map(|(weight, sd)| weight / sd)
        .collect();
    let shift: f64 = raw
        .iter()
        .zip(&means)
        .map(|(weight, mean)| weight * mean)
        .sum();
    raw[constant] -= shift;
    Some(raw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed;

    #[test]
    fn the_least_of_a_bowl_is_found_and_the_box_is_kept() {
        let mut dice = seed::generator("test", &[]);
        let bowl = |points: &[Vec<f64>]| -> Vec<f64> {
            let cost = |p: &Vec<f64>| (p[0] - 0.3).powi(2) + 4.0 * (p[1] + 2.0).powi(2);
            points.iter().map(cost).collect()
        };
        let found = CrossEntropySearch::WIDE.run(vec![0.0, 0.0], &mut dice, &bowl);
        assert!((found.point[0] - 0.3).abs() < 0.01, "{found:?}");
        assert_eq!(found.point[1], -1.0);
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        // The valley is bent and ten times as long as wide, a mild form of Rosenbrock's.
        let measure = |points: &[Vec<f64>]| -> Vec<Deviations> {
            let one = |p: &Vec<f64>| {
                let (x, y) = (2.0 * p[0], 2.0 * p[1]);
                vec![10.0 * (y - x - 0.3 * x * x + 0.3), 1.0 - x, 0.0]
            };
            points.iter().map(one).collect()
        };
        let found = descend(vec![-0.6, 0.5, 0.3], &[0, 1], &measure);
        assert!((found.point[0] - 0.5).abs() < 1e-3, "{found:?}");
        assert!((found.point[1] - 0.5).abs() < 1e-3, "{found:?}");
        assert_eq!(found.point[2], 0.3, "not free");
    }

    #[test]
    fn a_regression_finds_where_signs_change() {
        let rows: Vec<Vec<f64>> = (0..200)
            .map(|i| vec![f64::from(i), 1.0, -7.0 + f64::from(i % 3)])
            .collect();
        let worths: Vec<f64> = (0..200)
            .map(|i| if i >= 120 { 1.0 } else { -0.5 })
            .collect();
        let found = logistic(&rows, &worths).expect("solved");
        let over = |i: usize| rows[i].iter().zip(&found).map(|(a, b)| a * b).sum::<f64>();
        assert!(over(119) < 0.0 && over(120) > 0.0, "{found:?}");
    }
}
