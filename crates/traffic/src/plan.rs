//! Recorded motion as a plan: one change of speed per half second.

/// Length of a piece of a plan in seconds.
pub const PIECE_S: f64 = 0.5;

/// Least change of speed of a piece in m/s: world files need a rate of 0.001 m/s².
const LEAST_CHANGE_MPS: f64 = 6e-4;

/// Distance from the recording of a plan that repeats it, in metres.
const REPLAY_M: f64 = 0.1;

/// Weight against speeds, which keeps the system of equations regular.
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
        // The tolerance retains a piece whose duration is a sum of inexact
        // steps.
        let pieces = ((s_m.len().saturating_sub(1)) as f64 * dt_s / PIECE_S + 1e-6) as usize;
        if pieces == 0 {
            return None;
        }
        let last = (pieces as f64 * PIECE_S / dt_s).round() as usize;
        let first_m = s_m[0];
        // Relative to the first position, so that the equations are not
        // dominated by the offset.
        let rows: Vec<(f64, f64)> = s_m[..=last.min(s_m.len() - 1)]
            .iter()
            .enumerate()
            .map(|(i, s)| (i as f64 * dt_s, s - first_m))
            .collect();
        let (start_m, fitted_mps) = least_squares(&rows, pieces)?;
        let start_mps = rounded(fitted_mps[0]);
        let mut speed_mps = start_mps;
        let to_mps = fitted_mps[1..].iter().map(|fitted_mps| {
            let to = rounded(*fitted_mps);
            // A piece without a change would end at once. The least change goes
            // towards the fit, so that no error adds up.
            let is_steady = (to - speed_mps).abs() < LEAST_CHANGE_MPS;
            speed_mps = match is_steady.then_some(to < speed_mps) {
                Some(true) if speed_mps >= LEAST_CHANGE_MPS => speed_mps - LEAST_CHANGE_MPS,
                Some(_) => speed_mps + LEAST_CHANGE_MPS,
                None => to,
            };
            speed_mps
        });
        let mut plan = SpeedPlan {
            start_m: rounded(start_m),
            start_mps,
            // Rounded before the error is measured, which is then that of the
            // written plan.
            to_mps: to_mps.map(rounded).collect(),
            worst_m: 0.0,
        };
        let off = |(t, s): &(f64, f64)| (plan.position_m(*t) - s).abs();
        plan.worst_m = rows.iter().map(off).fold(0.0, f64::max);
        Some(plan)
    }

    /// Returns true if the plan is within 0.1 m of the recording.
    ///
    /// Others are of vehicles that the recorder moves backwards or makes jump.
    pub fn repeats(&self) -> bool {
        self.worst_m <= REPLAY_M
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
        // Beyond its last piece a plan keeps its speed.
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

/// Rounds to the sixth decimal, so that texts of worlds stay short.
pub fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// Solves for the start and the speeds at the joints of the pieces, which are not negative.
///
/// Without that bound, the fit of a vehicle that stops reverses in its last pieces. Speeds
/// cut off at 0 afterwards would then end decimetres from the recording.
fn least_squares(rows: &[(f64, f64)], pieces: usize) -> Option<(f64, Vec<f64>)> {
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
    // The start is left free, because a shift of all positions costs nothing.
    for (i, row) in matrix.iter_mut().enumerate().skip(1) {
        row[i] += RIDGE;
    }
    // An active set: speeds at 0, until none of the others is negative, and none at 0
    // would rise.
    let mut is_zero = vec![false; n];
    let mut solution = bounded(&matrix, &right, &is_zero)?;
    // Bounded, since rounding may let a speed enter and leave the set for
    // ever.
    for _ in 0..4 * n {
        let lowest = (1..n).min_by(|a, b| solution[*a].total_cmp(&solution[*b]))?;
        if solution[lowest] < 0.0 {
            is_zero[lowest] = true;
        } else {
            let rise = |i: usize| -> f64 {
                let now: f64 = (0..n).map(|k| matrix[i][k] * solution[k]).sum();
                right[i] - now
            };
            let rising = (1..n).filter(|i| is_zero[*i]);
            let most = rising.max_by(|a, b| rise(*a).total_cmp(&rise(*b)));
            match most.filter(|i| rise(*i) > 1e-6) {
                Some(i) => is_zero[i] = false,
                None => break,
            }
        }
        solution = bounded(&matrix, &right, &is_zero)?;
    }
    let speeds_mps = solution[1..].iter().map(|it| it.max(0.0));
    Some((solution[0], speeds_mps.collect()))
}

/// Solves a system of equations in which some unknowns are 0.
fn bounded(matrix: &[Vec<f64>], right: &[f64], is_zero: &[bool]) -> Option<Vec<f64>> {
    let (mut matrix, mut right) = (matrix.to_vec(), right.to_vec());
    for i in (0..right.len()).filter(|i| is_zero[*i]) {
        // A row of the identity fixes the unknown and keeps the indexes of all
        // others.
        matrix[i].fill(0.0);
        matrix[i][i] = 1.0;
        right[i] = 0.0;
    }
    solved(matrix, right)
}

/// Returns the position at a time per unit of an unknown: the start, or the speed at a joint.
fn basis(unknown: usize, time_s: f64) -> f64 {
    let Some(joint) = unknown.checked_sub(1) else {
        return 1.0;
    };
    // The speed rises linearly before its joint and falls after it.
    let from_s = time_s - (joint as f64 - 1.0) * PIECE_S;
    // Nothing comes before the first joint.
    let rises_s = if joint == 0 {
        0.0
    } else {
        from_s.clamp(0.0, PIECE_S)
    };
    let falls_s = (from_s - PIECE_S).clamp(0.0, PIECE_S);
    0.5 * rises_s * rises_s / PIECE_S + falls_s * (1.0 - 0.5 * falls_s / PIECE_S)
}

/// Solves a system of equations by elimination with pivots.
pub(crate) fn solved(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Option<Vec<f64>> {
    let n = right.len();
    for i in 0..n {
        let pivot = (i..n).max_by(|a, b| matrix[*a][i].abs().total_cmp(&matrix[*b][i].abs()))?;
        matrix.swap(i, pivot);
        right.swap(i, pivot);
        // A singular system has no unique solution.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Positions of a vehicle that brakes with 2.3 m/s² from 6 m/s until it stands.
    fn stopping(jitter_m: f64) -> Vec<f64> {
        let stop_s = 6.0 / 2.3;
        (0..=200)
            .map(|i| {
                let t = f64::min(0.05 * f64::from(i), stop_s);
                6.0 * t - 1.15 * t * t + jitter_m * f64::from(i * 29 % 7 - 3) / 3.0
            })
            .collect()
    }

    #[test]
    fn a_vehicle_that_stops_is_repeated_to_its_stop() {
        for jitter_m in [0.0, 0.01] {
            let s_m = stopping(jitter_m);
            let plan = SpeedPlan::fit(&s_m, 0.05).expect("a plan");
            assert!(plan.worst_m < 0.06, "{jitter_m}: {}", plan.worst_m);
            let off_m = plan.position_m(10.0) - s_m[200];
            assert!(off_m.abs() < 0.02, "{jitter_m}: {off_m} m at the end");
            assert!(plan.to_mps.iter().all(|it| (0.0..6.1).contains(it)));
        }
    }

    #[test]
    fn a_vehicle_that_the_recorder_moves_back_has_no_plan_that_repeats_it() {
        let back: Vec<f64> = (0..=200).map(|i| -0.005 * f64::from(i)).collect();
        let plan = SpeedPlan::fit(&back, 0.05).expect("a plan");
        assert!(
            !plan.repeats() && plan.to_mps.iter().all(|it| *it < 0.01),
            "{plan:?}"
        );
    }
}
