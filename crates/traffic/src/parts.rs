//! Unbroken parts of a road user's rows: without holes, jumps and other vehicles.

use crate::raw::{RawRow, RawTrack};
use crate::recording::{HOLE_S, ReadCounts};

/// Speed above that of the neighbouring steps from which a step is a jump, in m/s.
const JUMP_MPS: f64 = 20.0;
/// Distance that no step exceeds by noise, in metres.
const NOISE_M: f64 = 1.0;
/// Speed above the usual one at which no vehicle passes a hole, in m/s.
const HOLE_MPS: f64 = 15.0;
/// Distance behind its last place at which no vehicle comes out of a hole, and the speed
/// from which it would have had to turn round twice.
const BACK_M: f64 = 10.0;
const BACK_MPS: f64 = 5.0;
/// Acceleration in m/s² and noise in metres that no step to the side exceeds.
const SIDEWAYS_MPS2: f64 = 30.0;
const SIDEWAYS_M: f64 = 2.5;
/// Steps on either side that show the usual speed.
const NEAR_STEPS: usize = 5;
/// Longest stretch that is displaced and comes back, in seconds.
const DISPLACED_S: f64 = 0.5;
/// Difference of lengths from which two boxes are those of two vehicles.
const OTHER_LENGTH_M: f64 = 0.5;
/// Its least share of the length.
const OTHER_LENGTH: f64 = 0.1;

/// Unbroken rows of one vehicle.
pub(crate) struct TrackPart {
    pub(crate) rows: Vec<RawRow>,
    /// Number of the vehicle among those with this identity, from 0.
    pub(crate) vehicle: usize,
}

/// Splits rows at long holes, at jumps and where an identity goes to another vehicle.
///
/// Rows that are displaced for at most half a second are left out. All of it is counted.
pub(crate) fn parts(raw: &mut RawTrack, dt_s: f64, counts: &mut ReadCounts) -> Vec<TrackPart> {
    // First, because a displaced row would otherwise split the track twice.
    let rows = without_displaced(std::mem::take(&mut raw.rows), counts);
    counts.sideways += sideways_steps(&rows);
    let speeds = step_speeds(&rows);
    // A recording of 1 Hz has steps beyond `HOLE_S` that are no holes.
    let hole_s = HOLE_S.max(1.5 * dt_s);
    let mut parts: Vec<TrackPart> = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        let before = i.checked_sub(1).map(|at| &rows[at]);
        let Some((before, part)) = before.zip(parts.last_mut()) else {
            parts.push(TrackPart {
                rows: vec![*row],
                vehicle: 0,
            });
            continue;
        };
        // A box may change within unbroken rows, so only a hole or a jump is
        // examined further.
        let is_hole = row.time_s - before.time_s > hole_s;
        let is_jump = is_jump(&speeds, i - 1, before, row);
        if !is_hole && !is_jump {
            part.rows.push(*row);
            continue;
        }
        counts.holes_split += usize::from(is_hole);
        // A jump over a hole is counted once, as a hole.
        counts.jumps += usize::from(is_jump && !is_hole);
        let is_other = is_jump
            || has_other_box(before, row)
            || (is_hole && comes_from_elsewhere(&rows[..i], &speeds[..i], row));
        counts.reused_ids += usize::from(is_other);
        let vehicle = part.vehicle + usize::from(is_other);
        parts.push(TrackPart {
            rows: vec![*row],
            vehicle,
        });
    }
    parts
}

fn distance_m(a: &RawRow, b: &RawRow) -> f64 {
    libm::hypot(b.x_m - a.x_m, b.y_m - a.y_m)
}

/// Returns the speed of every step in m/s.
fn step_speeds(rows: &[RawRow]) -> Vec<f64> {
    let speed =
        |pair: &[RawRow]| distance_m(&pair[0], &pair[1]) / (pair[1].time_s - pair[0].time_s);
    rows.windows(2).map(speed).collect()
}

/// Returns the median speed of the steps around one, without itself.
fn usual_mps(speeds: &[f64], step: usize) -> f64 {
    let from = step.saturating_sub(NEAR_STEPS);
    let to = (step + NEAR_STEPS + 1).min(speeds.len());
    let others = (from..to).filter(|i| *i != step).map(|i| speeds[i]);
    let mut near: Vec<f64> = others.collect();
    if near.is_empty() {
        // A single step is believed, unless nothing on wheels is as fast.
        return 25.0;
    }
    let middle = near.len() / 2;
    *near.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Returns true if nothing that drives gets from one row to the next.
fn is_jump(speeds: &[f64], step: usize, before: &RawRow, after: &RawRow) -> bool {
    let usual_mps = usual_mps(speeds, step);
    let most_mps = if has_other_box(before, after) {
        // A new box needs less of a jump to be another vehicle.
        1.5 * usual_mps
    } else {
        3.0 * usual_mps + JUMP_MPS
    };
    let step_s = after.time_s - before.time_s;
    distance_m(before, after) > most_mps * step_s + NOISE_M
}

/// Returns true if no vehicle drives from the last of the rows before a hole to one after.
fn comes_from_elsewhere(before: &[RawRow], speeds: &[f64], after: &RawRow) -> bool {
    // A single row has no direction to compare with.
    let [.., earlier, last] = before else {
        return false;
    };
    // The last speed is that of the hole itself.
    let seen = speeds.len().saturating_sub(1);
    let usual_mps = usual_mps(&speeds[..seen], seen);
    let hole_s = after.time_s - last.time_s;
    let is_fast = distance_m(last, after) > (1.5 * usual_mps + HOLE_MPS) * hole_s + NOISE_M;
    let step = [last.x_m - earlier.x_m, last.y_m - earlier.y_m];
    // A standing vehicle must not divide by zero.
    let step_m = libm::hypot(step[0], step[1]).max(1e-9);
    let ahead_m = (step[0] * (after.x_m - last.x_m) + step[1] * (after.y_m - last.y_m)) / step_m;
    let is_moving = step_m > BACK_MPS * (last.time_s - earlier.time_s);
    // Whoever turns round needs more time than that of a short hole.
    is_fast || (is_moving && ahead_m < -BACK_M.max(usual_mps * hole_s))
}

/// Returns the number of steps that jump to the side of those before and after.
///
/// They are counted and kept: a simulator may change lanes so, as may a tracker that takes
/// one vehicle for another.
fn sideways_steps(rows: &[RawRow]) -> usize {
    let step = |i: usize| [rows[i + 1].x_m - rows[i].x_m, rows[i + 1].y_m - rows[i].y_m];
    let steps_s = |i: usize| rows[i + 1].time_s - rows[i].time_s;
    let is_sideways = |i: &usize| {
        // The distance from where each neighbour's velocity leads, across that velocity.
        let across_m = |neighbour: usize| {
            let [ux, uy] = step(neighbour);
            let way_m = libm::hypot(ux, uy);
            let [x, y] = step(*i);
            // A standing neighbour has no direction, so nothing lies to its
            // side.
            if way_m < 1e-9 {
                return 0.0;
            }
            ((ux * y - uy * x) / way_m).abs()
        };
        let most_m = SIDEWAYS_M + 0.5 * SIDEWAYS_MPS2 * steps_s(*i) * steps_s(*i);
        // Both neighbours must disagree, since a sharp turn disagrees with one
        // of them.
        across_m(i - 1).min(across_m(i + 1)) > most_m
    };
    // A step is compared with those before and after, which the ends lack.
    (1..rows.len().saturating_sub(2))
        .filter(is_sideways)
        .count()
}

/// Returns true if two rows have boxes or classes of two vehicles.
fn has_other_box(a: &RawRow, b: &RawRow) -> bool {
    let off_m = (a.size_m[0] - b.size_m[0]).abs();
    let is_known = a.size_m[0] > 0.0 && b.size_m[0] > 0.0;
    // Lengths are measured with noise that grows with them, so the limit is
    // the greater of both.
    let is_longer = is_known && off_m > OTHER_LENGTH_M.max(OTHER_LENGTH * a.size_m[0]);
    let classes = a.class.zip(b.class);
    is_longer || classes.is_some_and(|(a, b)| a != b)
}

/// Leaves out rows that jump away and come back.
fn without_displaced(rows: Vec<RawRow>, counts: &mut ReadCounts) -> Vec<RawRow> {
    let speeds = step_speeds(&rows);
    let jumps: Vec<usize> = (0..speeds.len())
        .filter(|i| is_jump(&speeds, *i, &rows[*i], &rows[*i + 1]))
        .collect();
    let mut is_out = vec![false; rows.len()];
    for pair in jumps.windows(2) {
        let (before, first, after) = (pair[0], pair[0] + 1, pair[1] + 1);
        let is_short = rows[pair[1]].time_s - rows[first].time_s <= DISPLACED_S;
        let comes_back = {
            let span_s = rows[after].time_s - rows[before].time_s;
            let most_mps = 3.0 * usual_mps(&speeds, before) + JUMP_MPS;
            distance_m(&rows[before], &rows[after]) <= most_mps * span_s + NOISE_M
        };
        // The end of one displaced stretch is not the start of another one.
        if is_short && comes_back && !is_out[before] {
            is_out[first..after].fill(true);
        }
    }
    // The first or the last row alone has nothing to come back to.
    let last = speeds.len().saturating_sub(1);
    if jumps.first() == Some(&0) && !jumps.contains(&1) {
        is_out[0] = true;
    }
    if jumps.last() == Some(&last) && last > 0 && !jumps.contains(&(last - 1)) {
        is_out[last + 1] = true;
    }
    counts.displaced += is_out.iter().filter(|it| **it).count();
    let kept = rows.into_iter().zip(is_out).filter(|(_, is_out)| !is_out);
    kept.map(|(row, _)| row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raw::RawVector;

    fn row(time_s: f64, x_m: f64, length_m: f64) -> RawRow {
        RawRow {
            time_s,
            x_m,
            y_m: 0.0,
            heading_rad: None,
            velocity: RawVector::Unknown,
            acceleration: RawVector::Unknown,
            marked: false,
            size_m: [length_m, 1.8],
            class: None,
        }
    }

    fn split(rows: Vec<RawRow>) -> (Vec<(usize, usize)>, ReadCounts) {
        let mut raw = RawTrack {
            rows,
            ..RawTrack::default()
        };
        let mut counts = ReadCounts::default();
        let parts = parts(&mut raw, 0.1, &mut counts);
        let shown = parts.iter().map(|it| (it.rows.len(), it.vehicle));
        (shown.collect(), counts)
    }

    fn steady(n: usize, from: usize, length_m: f64) -> Vec<RawRow> {
        let at = |i: usize| row(0.1 * (from + i) as f64, 2.0 * (from + i) as f64, length_m);
        (0..n).map(at).collect()
    }

    #[test]
    fn a_displaced_row_is_left_out_and_a_jump_splits() {
        let mut rows = steady(50, 0, 4.5);
        rows[20].x_m = 5000.0;
        let (parts, counts) = split(rows);
        assert_eq!((parts, counts.displaced), (vec![(49, 0)], 1));
        let mut rows = steady(50, 0, 4.5);
        for row in &mut rows[25..] {
            row.x_m += 300.0;
        }
        let (parts, counts) = split(rows);
        assert_eq!((parts, counts.jumps), (vec![(25, 0), (25, 1)], 1));
    }

    #[test]
    fn an_identity_with_another_box_is_another_vehicle() {
        let rows = [steady(30, 0, 4.5), steady(30, 60, 12.0)].concat();
        let (parts, counts) = split(rows);
        assert_eq!((parts, counts.reused_ids), (vec![(30, 0), (30, 1)], 1));
        let rows = [steady(30, 0, 4.5), steady(30, 60, 4.5)].concat();
        let (parts, counts) = split(rows);
        assert_eq!((parts, counts.reused_ids), (vec![(30, 0), (30, 0)], 0));
    }

    #[test]
    fn an_identity_that_comes_out_of_a_hole_elsewhere_is_another_vehicle() {
        let moved = |x_m: f64| {
            let mut rows = steady(30, 60, 4.5);
            for row in &mut rows {
                row.x_m += x_m;
            }
            [steady(30, 0, 4.5), rows].concat()
        };
        // 3.1 s at 20 m/s are 62 m: as expected, far ahead, far behind, and a stop.
        for (x_m, vehicles) in [(0.0, 0), (200.0, 1), (-250.0, 1), (-62.0, 0)] {
            let (parts, counts) = split(moved(x_m));
            assert_eq!(parts, [(30, 0), (30, vehicles)], "{x_m}");
            assert_eq!(counts.reused_ids, vehicles);
        }
    }

    #[test]
    fn steps_to_the_side_are_counted_and_kept() {
        let mut rows = steady(50, 0, 4.5);
        for row in &mut rows[25..] {
            row.y_m += 3.5;
        }
        let (parts, counts) = split(rows);
        assert_eq!((parts, counts.sideways), (vec![(50, 0)], 1));
        // A turn with a radius of 8 m at 8 m/s is none, with a row per 0.5 s.
        let turn = (0..40).map(|i| {
            let (sin, cos) = libm::sincos(0.5 * f64::from(i));
            RawRow {
                y_m: 8.0 * cos,
                ..row(0.5 * f64::from(i), 8.0 * sin, 4.5)
            }
        });
        assert_eq!(split(turn.collect()).1.sideways, 0);
    }

    #[test]
    fn hard_braking_is_no_jump() {
        let mut x_m = 0.0;
        let rows = (0..100).map(|i| {
            let speed_mps = (40.0 - f64::from(i)).max(0.0);
            x_m += 0.1 * speed_mps;
            row(0.1 * f64::from(i), x_m, 4.5)
        });
        assert_eq!(split(rows.collect()).0, [(100, 0)]);
    }
}
