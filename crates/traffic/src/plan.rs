//! Recorded motion as a plan: one change of speed per half second.

/// Length of a piece of a plan in seconds.
pub const PIECE_S: f64 = 0.5;

/// Least change of speed of a piece in m/s: world files need a rate of 0.001 m/s².
const LEAST_CHANGE_MPS: f64 = 6e-4;

/// Weight against accelerations, which keeps the system of equations regular.
const RIDGE: f64 = 1e-9;

/// Plan of pieces with constant acceleration, fitted to recorded positions.
///
/// Recorded speeds are not used: integrated, they miss the positions by metres.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SpeedPlan {
    /// Position at the start relative to the first recorded one, in metres.
    pub start_m: f64,
    /// Speed at the start in m/s.
    pub start_mps: f64,
    /// Speed at the end of each piece of 0.5 s in m/s.
    pub to_mps: Vec<f64>,
    /// Greatest distance from the recording in metres.
    pub worst_m: f64,
}

impl SpeedPlan {
    /// Fits a plan to positions along a path, sampled every `dt_s`.
    ///
    /// A rest of less than 0.5 s at the end is left out. Returns `None` for less than
    /// one piece.
    pub fn fit(s_m: &[f64], dt_s: f64) -> Option<SpeedPlan> {
        let pieces = ((s_m.len().saturating_sub(1)) as f64 * dt_s / PIECE_S + 1e-6) as usize;
        if pieces == 0 {
            return None;
        }
        let last = (pieces as f64 * PIECE_S / dt_s).round() as usize;
        let first_m = s_m[0];
        let rows = s_m[..=last.min(s_m.len() - 1)].iter().enumerate();
        let rows: Vec<(f64, f64)> = rows.map(|(i, s)| (i as f64 * dt_s, s - first_m)).collect();
        let solution = least_squares(&rows, pieces)?;
        let (start_m, start_mps) = (solution[0], rounded(solution[1].max(0.0)));
        let mut speed_mps = start_mps;
        let mut fitted_mps = solution[1];
        let to_mps = solution[2..].iter().map(|accel| {
            fitted_mps += accel * PIECE_S;
            let to = rounded(fitted_mps.max(0.0));
            // A piece without a change would end at once. The least change goes
            // towards the fit, so that no error adds up.
            let is_steady = (to - speed_mps).abs() < LEAST_CHANGE_MPS;
            speed_mps = match is_steady.then_some(to < speed_mps) {
                Some(true) if LEAST_CHANGE_MPS <= speed_mps => speed_mps - LEAST_CHANGE_MPS,
                Some(_) => speed_mps + LEAST_CHANGE_MPS,
                None => to,
            };
            speed_mps
        });
        let mut plan = SpeedPlan {
            start_m: rounded(start_m),
            start_mps,
            to_mps: to_mps.map(rounded).collect(),
            worst_m: 0.0,
        };
        let off = |(t, s): &(f64, f64)| (plan.position_m(*t) - s).abs();
        plan.worst_m = rows.iter().map(off).fold(0.0, f64::max);
        Some(plan)
    }

    /// Returns the position at a time, relative to the first recorded one.
    pub fn position_m(&self, time_s: f64) -> f64 {
        let (mut s_m, mut speed_mps, mut left_s) = (self.start_m, self.start_mps, time_s);
        for to_mps in &self.to_mps {
            let within_s = left_s.clamp(0.0, PIECE_S);
            let accel = (to_mps - speed_mps) / PIECE_S;
            s_m += speed_mps * within_s + 0.5 * accel * within_s * within_s;
            left_s -= within_s;
            speed_mps = *to_mps;
        }
        s_m + speed_mps * left_s.max(0.0)
    }

    /// Returns the greatest acceleration or deceleration in m/s².
    pub fn hardest_mps2(&self) -> f64 {
        self.rates_mps2().into_iter().fold(0.0, f64::max)
    }

    /// Returns the rate of each piece in m/s², always positive.
    pub fn rates_mps2(&self) -> Vec<f64> {
        let speeds = std::iter::once(&self.start_mps).chain(&self.to_mps);
        let changes = speeds.zip(&self.to_mps);
        changes
            .map(|(from, to)| rounded((to - from).abs() / PIECE_S))
            .collect()
    }
}

/// Rounds to micrometres per second, so that texts stay short.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// Solves for start, speed and accelerations of the pieces.
fn least_squares(rows: &[(f64, f64)], pieces: usize) -> Option<Vec<f64>> {
    let n = pieces + 2;
    let (mut matrix, mut right) = (vec![vec![0.0; n]; n], vec![0.0; n]);
    for (t, s) in rows {
        let basis: Vec<f64> = (0..n).map(|k| basis(k, *t)).collect();
        for i in 0..n {
            right[i] += basis[i] * s;
            for j in 0..n {
                matrix[i][j] += basis[i] * basis[j];
            }
        }
    }
    for (i, row) in matrix.iter_mut().enumerate().skip(2) {
        row[i] += RIDGE;
    }
    solved(matrix, right)
}

/// Returns the position at a time per unit of an unknown.
fn basis(unknown: usize, time_s: f64) -> f64 {
    match unknown {
        0 => 1.0,
        1 => time_s,
        _ => {
            let after_s = time_s - (unknown - 2) as f64 * PIECE_S;
            let within_s = after_s.clamp(0.0, PIECE_S);
            within_s * (after_s.max(0.0) - 0.5 * within_s)
        }
    }
}

/// Solves a system of equations by elimination with pivots.
pub(crate) fn solved(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Option<Vec<f64>> {
    let n = right.len();
    for i in 0..n {
        let pivot = (i..n).max_by(|a, b| matrix[*a][i].abs().total_cmp(&matrix[*b][i].abs()))?;
        matrix.swap(i, pivot);
        right.swap(i, pivot);
        if matrix[i][i].abs() < 1e-14 {
            return None;
        }
        let pivot_row = matrix[i].clone();
        for row in i + 1..n {
            let factor = matrix[row][i] / pivot_row[i];
            for (value, above) in matrix[row].iter_mut().zip(&pivot_row).skip(i) {
                *value -= factor * above;
            }
            right[row] -= factor * right[i];
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| matrix[i][k] * right[k]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    Some(right)
}
