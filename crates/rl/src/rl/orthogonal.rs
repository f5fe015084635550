//! Orthogonal matrices, the first weights of networks.

use super::dice::LearnerRng;

/// Returns a matrix with orthonormal rows or columns, whichever are fewer.
///
/// Gram-Schmidt on normal draws, written by hand. A library's QR uses reflections
/// or another order of sums, which gives other bits and so other policies from
/// the same seed.
pub(super) fn orthogonal_matrix(
    rows: usize,
    columns: usize,
    dice: &mut LearnerRng,
) -> Vec<Vec<f64>> {
    // Only the shorter side can be orthonormal.
    let (few, many) = (rows.min(columns), rows.max(columns));
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(few);
    while basis.len() < few {
        let mut vector: Vec<f64> = (0..many).map(|_| dice.normal()).collect();
        // Two passes are enough (Kahan, in Parlett 1980). The first pass may leave
        // rounding as large as the rest of the vector, the second removes it.
        for _ in 0..2 {
            for other in &basis {
                let along: f64 = vector.iter().zip(other).map(|(a, b)| a * b).sum();
                vector
                    .iter_mut()
                    .zip(other)
                    .for_each(|(a, b)| *a -= along * b);
            }
        }
        let length = libm::sqrt(vector.iter().map(|a| a * a).sum());
        // A draw within the span of the others has no direction left, so draw again.
        if length > 1e-6 {
            vector.iter_mut().for_each(|a| *a /= length);
            basis.push(vector);
        }
    }
    if rows <= columns {
        return basis;
    }
    // A tall matrix has orthonormal columns instead of rows.
    (0..rows)
        .map(|row| basis.iter().map(|column| column[row]).collect())
        .collect()
}
