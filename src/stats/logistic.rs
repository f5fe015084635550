//! Least squares by normal equations, and logistic regression by Newton's method.

use nalgebra::{DMatrix, DVector};

/// Regularisation of the weights, in standard deviations.
pub(crate) const SMALL_WEIGHTS: f64 = 1e-4;
/// Largest number of Newton steps.
const NEWTON_STEPS: usize = 40;

/// Adds a weighted row with its target to the normal equations.
pub(crate) fn add_equation(
    left: &mut DMatrix<f64>,
    right: &mut DVector<f64>,
    row: &[f64],
    (weight, wanted): (f64, f64),
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
pub(crate) fn logistic(rows: &[Vec<f64>], worths: &[f64]) -> Option<Vec<f64>> {
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
            let wanted = f64::from(u8::from(0.0 < *worth)) - braked;
            // The gradient, expressed as a weighted row with a target.
            let wanted = worth.abs() * wanted / curved;
            add_equation(&mut left, &mut right, row, (curved, wanted));
        }
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

    #[test]
    fn a_regression_finds_where_signs_change() {
        let rows: Vec<Vec<f64>> = (0..200)
            .map(|i| vec![f64::from(i), 1.0, -7.0 + f64::from(i % 3)])
            .collect();
        let worths: Vec<f64> = (0..200)
            .map(|i| if 120 <= i { 1.0 } else { -0.5 })
            .collect();
        let found = logistic(&rows, &worths).expect("solved");
        let over = |i: usize| rows[i].iter().zip(&found).map(|(a, b)| a * b).sum::<f64>();
        assert!(over(119) < 0.0 && 0.0 < over(120), "{found:?}");
    }
}
