//! Damped Gauss-Newton steps in a box (Levenberg 1944, Marquardt 1963).
//!
//! Near the optimum the deviations are nearly linear, r(x + d) ≈ r + J d. The step that
//! solves (JᵀJ + λ diag JᵀJ) d = −Jᵀr then goes most of the way.
//! Elsewhere λ shortens the step and turns it downhill.
//! A simulation has no derivatives, so the slopes come from runs beside the point.
//!
//! Cross-entropy search finds the region. These steps follow narrow valleys, such as the
//! trade-off between a late brake and a weak gain.

use crate::stats::cross_entropy::Fit;

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
/// [`cost`].
pub(crate) fn descend(
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
                let by = moved[d] - here[d];
                let pairs = there.iter().zip(&deviations);
                pairs.map(|(there, here)| (there - here) / by).collect()
            })
            .collect();
        let equations = equations(&slopes, &deviations);
        let candidates: Vec<Vec<f64>> = DAMPINGS
            // A damping without a solution is skipped.
            .iter()
            .filter_map(|damping| step(&here, free, equations.clone(), *damping))
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
pub(crate) fn cost(deviations: &[f64]) -> f64 {
    let sum: f64 = deviations.iter().map(|d| d * d).sum();
    // Three deviations, x, y and speed, form one distance.
    (3.0 * sum / deviations.len().max(1) as f64).sqrt()
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

/// Returns JᵀJ d = −Jᵀr as rows `[a … | b]`, which are the same for every damping.
fn equations(slopes: &[Vec<f64>], deviations: &[f64]) -> Vec<Vec<f64>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut rows: Vec<Vec<f64>> = Vec::with_capacity(slopes.len());
    for (i, a) in slopes.iter().enumerate() {
        // The matrix is symmetric, so the left part is copied from the rows above.
        let left: Vec<f64> = rows.iter().map(|above| above[i]).collect();
        let right = slopes[i..].iter().map(|b| dot(a, b));
        rows.push(left.into_iter().chain(right).collect());
    }
    for (row, a) in rows.iter_mut().zip(slopes) {
        row.push(-dot(a, deviations));
    }
    rows
}

/// Returns the end of a damped step, or `None` if the equations have no solution.
fn step(
    here: &[f64],
    free: &[usize],
    mut equations: Vec<Vec<f64>>,
    damping: f64,
) -> Option<Vec<f64>> {
    for (i, row) in equations.iter_mut().enumerate() {
        // Marquardt: damping in proportion to the diagonal, so that flat dimensions are
        // damped less than steep ones.
        row[i] *= 1.0 + damping;
        // A dimension without slope stays in place.
        row[i] += 1e-12;
    }
    let by = solve(equations)?;
    let mut there = here.to_vec();
    for (&d, by) in free.iter().zip(by) {
        there[d] = (there[d] + by).clamp(-1.0, 1.0);
    }
    Some(there)
}

/// Solves rows `[a … | b]` by Gaussian elimination with pivots.
///
/// A library's LU decomposition adds in another order. The identified parameters would
/// then differ in their last bits from those of kept runs.
fn solve(mut rows: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let n = rows.len();
    for i in 0..n {
        let pivot = (i..n).max_by(|&a, &b| rows[a][i].abs().total_cmp(&rows[b][i].abs()))?;
        rows.swap(i, pivot);
        let head = rows[i].clone();
        for row in rows.iter_mut().skip(i + 1) {
            let factor = row[i] / head[i];
            row.iter_mut()
                .zip(&head)
                .for_each(|(a, b)| *a -= factor * b);
        }
    }
    let mut solution = vec![0.0; n];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| rows[i][j] * solution[j]).sum();
        solution[i] = (rows[i][n] - known) / rows[i][i];
    }
    solution
        .iter()
        .all(|value| value.is_finite())
        .then_some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
