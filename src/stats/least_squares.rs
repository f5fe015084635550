//! Damped Gauss-Newton steps in a box (Levenberg 1944, Marquardt 1963).
//!
//! Near the best point deviations are nearly linear, r(x + d) ≈ r + J d, so the
//! step that solves (JᵀJ + λ diag JᵀJ) d = −Jᵀr goes most of the way at once;
//! λ shortens it, and turns it downhill, where they are not. Slopes are taken by
//! playing the runs again beside the point: a simulation has no derivatives.
//!
//! Cross-entropy search finds the region; a narrow valley, in which a late
//! brake looks like a weak gain, it leaves to this.

use crate::stats::cross_entropy::Fit;

/// Steps at most.
const STEPS: usize = 12;
/// Dampings tried at each step, all at once: their runs are played side by side,
/// and no damping has to be guessed from the step before.
const DAMPINGS: [f64; 5] = [1e-6, 1e-3, 1e-1, 1e1, 1e3];
/// Distance by which derivatives are taken, of a range from −1 to 1.
const NEAR: f64 = 0.01;
/// A step that gains less than this share is the last one.
const GAIN: f64 = 1e-3;

/// What a point deviates by, in every sample of every run.
pub(crate) type Deviations = Vec<f64>;

/// Goes downhill from `point` along the dimensions that are `free`.
///
/// `measure` gives the deviations of many points at once; the cost of a point
/// is the mean of their squares.
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
            .iter()
            .filter_map(|damping| step(&here, free, equations.clone(), *damping))
            .collect();
        let measured = measure(&candidates).into_iter().zip(candidates);
        let best = measured.min_by(|(a, _), (b, _)| cost(a).total_cmp(&cost(b)));
        let Some((there, candidate)) = best else {
            break;
        };
        let (before, after) = (cost(&deviations), cost(&there));
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

/// Root mean square of deviations.
pub(crate) fn cost(deviations: &[f64]) -> f64 {
    let sum: f64 = deviations.iter().map(|d| d * d).sum();
    // Three deviations are one distance in position and speed.
    (3.0 * sum / deviations.len().max(1) as f64).sqrt()
}

fn first(measured: Vec<Deviations>) -> Deviations {
    measured.into_iter().next().unwrap_or_default()
}

/// A point near `here` along a dimension, inside of the box.
fn beside(here: &[f64], d: usize) -> Vec<f64> {
    let mut there = here.to_vec();
    there[d] += match here[d] + NEAR <= 1.0 {
        true => NEAR,
        false => -NEAR,
    };
    there
}

/// JᵀJ d = −Jᵀr as rows `[a … | b]`: the same for every damping.
fn equations(slopes: &[Vec<f64>], deviations: &[f64]) -> Vec<Vec<f64>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut rows: Vec<Vec<f64>> = Vec::with_capacity(slopes.len());
    for (i, a) in slopes.iter().enumerate() {
        // What is left of the diagonal stands above it already.
        let left: Vec<f64> = rows.iter().map(|above| above[i]).collect();
        let right = slopes[i..].iter().map(|b| dot(a, b));
        rows.push(left.into_iter().chain(right).collect());
    }
    for (row, a) in rows.iter_mut().zip(slopes) {
        row.push(-dot(a, deviations));
    }
    rows
}

/// Where a damped step leads; `None` if the equations have no solution.
fn step(
    here: &[f64],
    free: &[usize],
    mut equations: Vec<Vec<f64>>,
    damping: f64,
) -> Option<Vec<f64>> {
    for (i, row) in equations.iter_mut().enumerate() {
        // Marquardt: in proportion to the diagonal, so that flat dimensions are not
        // damped as hard as steep ones.
        row[i] *= 1.0 + damping;
        // A dimension without any slope does not move.
        row[i] += 1e-12;
    }
    let by = solve(equations)?;
    let mut there = here.to_vec();
    for (&d, by) in free.iter().zip(by) {
        there[d] = (there[d] + by).clamp(-1.0, 1.0);
    }
    Some(there)
}

/// Gaussian elimination with pivots on rows `[a … | b]`.
///
/// By hand: a library's LU adds in another order, and what an ado is told of an
/// ego would differ in its last bits from what kept runs were told.
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
        // Narrow by a factor of ten and bent, as Rosenbrock's is more sharply.
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
