//! Road users of any class whose paths cross.

use std::f64::consts::PI;

use crate::raw::wrapped;
use crate::recording::{RoadUserTrack, TrafficRecording};

/// Greatest post-encroachment time of a crossing that is kept.
pub const CROSSING_PET_S: f64 = 10.0;

/// Least angle of two paths that cross, 20°.
pub const CROSSING_RAD: f64 = PI / 9.0;

/// Least distance of two points of a path, so that a standing road user has none.
const POINT_M: f64 = 0.3;

/// Greatest time between the centres in the place, of which most is a wait there.
const NEAR_S: f64 = 60.0;

/// Distance before and behind a place between which the course there is measured.
const CHORD_M: f64 = 2.0;

/// Number of pieces of a path that are compared at once.
const RUN_PIECES: usize = 16;

/// Two road users that pass one place, one after the other.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PathCrossing {
    /// Track of the road user that leaves the place first.
    pub first: usize,
    /// Track of the other road user.
    pub second: usize,
    /// Place at which the paths of the box centres cross.
    pub point_m: [f64; 2],
    /// Angle of the paths in (0, π/2].
    pub angle_rad: f64,
    /// Seconds from the recording's start until the first box has left the other's path.
    pub leave_s: f64,
    /// Seconds from the recording's start until the second box enters the other's path.
    pub enter_s: f64,
    /// Least clearance of the boxes at one instant, `None` without a common instant.
    pub least_m: Option<f64>,
    /// True if either state at the place is interpolated.
    pub is_filled: bool,
}

impl PathCrossing {
    /// Returns the post-encroachment time in seconds.
    ///
    /// It is 0 if both were in the place at once.
    pub fn pet_s(&self) -> f64 {
        (self.enter_s - self.leave_s).max(0.0)
    }

    /// Finds the crossings of a recording with a post-encroachment time of up to 10 s.
    ///
    /// Paths cross at 20° or more, so that neither a lane change nor a merge counts. The
    /// place is where a box overlaps the strip that the other one sweeps. A pair that
    /// crosses several times counts once, with its smallest time. The smallest comes first.
    pub fn find(recording: &TrafficRecording) -> Vec<PathCrossing> {
        let dt_s = recording.dt_s;
        let ways: Vec<Way> = recording
            .tracks
            .iter()
            .map(|it| Way::new(it, dt_s))
            .collect();
        let mut order: Vec<usize> = (0..ways.len()).collect();
        let start_s = |i: usize| recording.tracks[i].first_sample as f64 * dt_s;
        // In the order of starts the search of each track can stop early.
        order.sort_by(|a, b| start_s(*a).total_cmp(&start_s(*b)));
        let mut found = Vec::new();
        for (k, a) in order.iter().enumerate() {
            let end_s = recording.tracks[*a].end_sample() as f64 * dt_s;
            let later = order[k + 1..].iter();
            for b in later.take_while(|b| start_s(**b) <= end_s + CROSSING_PET_S) {
                // Holes split a road user into tracks, which do not cross each
                // other.
                if recording.tracks[*a].id == recording.tracks[*b].id {
                    continue;
                }
                found.extend(crossing(recording, &ways, *a, *b));
            }
        }
        // Stable, so that equal times keep the order of the starts.
        found.sort_by(|a, b| a.pet_s().total_cmp(&b.pet_s()));
        found
    }
}

/// Path of a road user with the instants of its points.
struct Way {
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    time_s: Vec<f64>,
    s_m: Vec<f64>,
    runs: Vec<PathRun>,
}

/// Some pieces of a path, with what bounds them.
struct PathRun {
    from: usize,
    to: usize,
    low_m: [f64; 2],
    high_m: [f64; 2],
    course_rad: f64,
    /// Greatest deviation of a piece from the course.
    turn_rad: f64,
}

impl Way {
    fn new(track: &RoadUserTrack, dt_s: f64) -> Way {
        let mut way = Way {
            x_m: Vec::new(),
            y_m: Vec::new(),
            time_s: Vec::new(),
            s_m: Vec::new(),
            runs: Vec::new(),
        };
        let mut s_m = 0.0;
        for (i, (x, y)) in track.x_m.iter().zip(&track.y_m).enumerate() {
            if let (Some(x0), Some(y0)) = (way.x_m.last(), way.y_m.last()) {
                let step_m = libm::hypot(x - x0, y - y0);
                if step_m < POINT_M {
                    continue;
                }
                s_m += step_m;
            }
            way.x_m.push(*x);
            way.y_m.push(*y);
            way.s_m.push(s_m);
            way.time_s.push((track.first_sample + i) as f64 * dt_s);
        }
        let pieces = way.x_m.len().saturating_sub(1);
        way.runs = (0..pieces)
            .step_by(RUN_PIECES)
            .map(|from| way.run(from, (from + RUN_PIECES).min(pieces)))
            .collect();
        way
    }

    fn run(&self, from: usize, to: usize) -> PathRun {
        let course_rad = self.course_rad(from);
        let turn = |i: usize| wrapped(self.course_rad(i) - course_rad).abs();
        let low = |values: &[f64]| {
            values[from..=to]
                .iter()
                .copied()
                .fold(f64::INFINITY, f64::min)
        };
        let high = |values: &[f64]| {
            values[from..=to]
                .iter()
                .copied()
                .fold(-f64::INFINITY, f64::max)
        };
        PathRun {
            from,
            to,
            low_m: [low(&self.x_m), low(&self.y_m)],
            high_m: [high(&self.x_m), high(&self.y_m)],
            course_rad,
            turn_rad: (from..to).map(turn).fold(0.0, f64::max),
        }
    }

    fn piece_m(&self, piece: usize) -> [f64; 2] {
        [
            self.x_m[piece + 1] - self.x_m[piece],
            self.y_m[piece + 1] - self.y_m[piece],
        ]
    }

    fn course_rad(&self, piece: usize) -> f64 {
        let [x, y] = self.piece_m(piece);
        libm::atan2(y, x)
    }

    /// Returns a value of the points at a distance along the path, that of an end beyond it.
    fn at(&self, s_m: f64, values: &[f64]) -> f64 {
        let after = self.s_m.partition_point(|it| *it < s_m);
        if after == 0 {
            return values[0];
        }
        let Some(next) = values.get(after) else {
            return values[after - 1];
        };
        let share = (s_m - self.s_m[after - 1]) / (self.s_m[after] - self.s_m[after - 1]);
        values[after - 1] + share * (next - values[after - 1])
    }

    fn time_at(&self, s_m: f64) -> f64 {
        self.at(s_m, &self.time_s)
    }

    /// Returns the course of a chord, which jitter of the positions hardly turns.
    fn chord_rad(&self, s_m: f64) -> f64 {
        let step_m =
            |values: &[f64]| self.at(s_m + CHORD_M, values) - self.at(s_m - CHORD_M, values);
        libm::atan2(step_m(&self.y_m), step_m(&self.x_m))
    }

    /// Returns the distance along the path at a share of a piece.
    fn along_m(&self, piece: usize, share: f64) -> f64 {
        self.s_m[piece] + share * (self.s_m[piece + 1] - self.s_m[piece])
    }
}

/// Returns the angle of two lines in [0, π/2].
fn line_angle(a_rad: f64, b_rad: f64) -> f64 {
    let turned = wrapped(a_rad - b_rad).abs();
    turned.min(PI - turned)
}

/// Returns true if pieces of two runs may cross at a large angle.
fn may_cross(run: &PathRun, other: &PathRun) -> bool {
    // Boxes first: comparing numbers costs less than the angle, and rejects
    // most pairs.
    let is_apart = (0..2)
        .any(|axis| run.high_m[axis] < other.low_m[axis] || other.high_m[axis] < run.low_m[axis]);
    let angle_rad = line_angle(run.course_rad, other.course_rad);
    !is_apart && angle_rad + run.turn_rad + other.turn_rad >= CROSSING_RAD
}

fn crossing(
    recording: &TrafficRecording,
    ways: &[Way],
    a: usize,
    b: usize,
) -> Option<PathCrossing> {
    let mut best: Option<PathCrossing> = None;
    for run in &ways[a].runs {
        let (way, runs) = (&ways[b], &ways[b].runs);
        let from_s = ways[a].time_s[run.from] - NEAR_S;
        let to_s = ways[a].time_s[run.to] + NEAR_S;
        // Runs are in the order of time, so those long before are skipped at once.
        let first = runs.partition_point(|it| way.time_s[it.to] < from_s);
        let near = runs[first..]
            .iter()
            .take_while(|it| way.time_s[it.from] <= to_s);
        for other in near.filter(|it| may_cross(run, it)) {
            for (i, k) in
                (run.from..run.to).flat_map(|i| (other.from..other.to).map(move |k| (i, k)))
            {
                let Some(found) = at_pieces(recording, ways, [(a, i), (b, k)]) else {
                    continue;
                };
                // Strictly smaller, so that the first of equal crossings is
                // kept.
                if best.is_none_or(|best| found.pet_s() < best.pet_s()) {
                    best = Some(found);
                }
            }
        }
    }
    let mut best = best.filter(|it| it.pet_s() <= CROSSING_PET_S)?;
    // Over both tracks and costly, so it is computed only for a crossing that is kept.
    best.least_m = least_clearance_m(&recording.tracks[a], &recording.tracks[b]);
    Some(best)
}

/// Returns the crossing of two pieces of paths, given by their tracks and positions.
fn at_pieces(
    recording: &TrafficRecording,
    ways: &[Way],
    [(a, i), (b, k)]: [(usize, usize); 2],
) -> Option<PathCrossing> {
    let (way, other) = (&ways[a], &ways[b]);
    let ([ax, ay], [bx, by]) = (way.piece_m(i), other.piece_m(k));
    let cross = ax * by - ay * bx;
    // Parallel pieces have no single common point, and the division would give
    // NaN.
    if cross == 0.0 {
        return None;
    }
    let (dx, dy) = (other.x_m[k] - way.x_m[i], other.y_m[k] - way.y_m[i]);
    let (u, v) = ((dx * by - dy * bx) / cross, (dx * ay - dy * ax) / cross);
    // Paths may cross at a point of theirs, which rounding must not put between two pieces.
    let piece = -1.0e-9..=1.0 + 1.0e-9;
    if !piece.contains(&u) || !piece.contains(&v) {
        return None;
    }
    let places_m = (way.along_m(i, u), other.along_m(k, v));
    // Not of the pieces, which are as short as 0.3 m and turn with every
    // jitter.
    let angle_rad = line_angle(way.chord_rad(places_m.0), other.chord_rad(places_m.1));
    if angle_rad < CROSSING_RAD {
        return None;
    }
    let stay = |track: usize, crossed: usize, s_m: f64| {
        let (own, crossed) = (&recording.tracks[track], &recording.tracks[crossed]);
        // The angle is at least 20°, so the division by the sine below is
        // safe.
        let (sin, cos) = libm::sincos(angle_rad);
        // From the centre at the place to the box at the edge of the other's strip.
        let reach_m = 0.5 * (own.length_m + (crossed.width_m + own.width_m * cos) / sin);
        let way = &ways[track];
        let sample = (way.time_at(s_m) / recording.dt_s).round() as usize;
        let filled = sample
            .checked_sub(own.first_sample)
            .and_then(|at| own.filled.get(at));
        let times = (way.time_at(s_m - reach_m), way.time_at(s_m + reach_m));
        (track, times, filled.copied().unwrap_or(false))
    };
    let (mut first, mut second) = (stay(a, b, places_m.0), stay(b, a, places_m.1));
    // The road user that has left the other's path earlier is the first one.
    if second.1.1 < first.1.1 {
        std::mem::swap(&mut first, &mut second);
    }
    Some(PathCrossing {
        first: first.0,
        second: second.0,
        point_m: [way.x_m[i] + u * ax, way.y_m[i] + u * ay],
        angle_rad,
        leave_s: first.1.1,
        enter_s: second.1.0,
        least_m: None,
        is_filled: first.2 || second.2,
    })
}

/// Returns the least clearance of two boxes at one instant.
fn least_clearance_m(a: &RoadUserTrack, b: &RoadUserTrack) -> Option<f64> {
    let common = a.first_sample.max(b.first_sample)..a.end_sample().min(b.end_sample());
    let clearances = common
        .map(|sample| clearance_m((a, sample - a.first_sample), (b, sample - b.first_sample)));
    // Without a common instant the range is empty and there is no clearance.
    clearances.min_by(f64::total_cmp)
}

/// Returns the clearance of two boxes, each given by its track and sample.
pub(crate) fn clearance_m(a: (&RoadUserTrack, usize), b: (&RoadUserTrack, usize)) -> f64 {
    let (of_a, is_left) = from_box(a, b);
    let (of_b, is_right) = from_box(b, a);
    // Without an axis that separates them the boxes overlap, even if no corner is inside.
    if is_left || is_right {
        of_a.min(of_b)
    } else {
        0.0
    }
}

/// Returns the distance of a box to the nearest corner of another one.
///
/// Also returns whether an axis of the box separates the two.
fn from_box(own: (&RoadUserTrack, usize), other: (&RoadUserTrack, usize)) -> (f64, bool) {
    let (track, at) = own;
    let half_m = [0.5 * track.length_m, 0.5 * track.width_m];
    let (sin, cos) = libm::sincos(track.heading_rad[at]);
    let corners = corners_m(other.0, other.1).map(|[x, y]| {
        let (dx, dy) = (x - track.x_m[at], y - track.y_m[at]);
        [cos * dx + sin * dy, cos * dy - sin * dx]
    });
    // Distance to a box: only what sticks out of its half extents counts.
    let away = |[x, y]: [f64; 2]| {
        let (x, y) = (
            (x.abs() - half_m[0]).max(0.0),
            (y.abs() - half_m[1]).max(0.0),
        );
        libm::hypot(x, y)
    };
    let is_beyond = |axis: usize, sign: f64| {
        corners
            .iter()
            .all(|corner| half_m[axis] < sign * corner[axis])
    };
    let is_separate = (0..2).any(|axis| is_beyond(axis, 1.0) || is_beyond(axis, -1.0));
    let nearest = corners.map(away).into_iter().fold(f64::INFINITY, f64::min);
    (nearest, is_separate)
}

/// Returns the corners of a box, counter-clockwise from the front left one.
pub(crate) fn corners_m(track: &RoadUserTrack, at: usize) -> [[f64; 2]; 4] {
    let (sin, cos) = libm::sincos(track.heading_rad[at]);
    let (half_m, side_m) = (0.5 * track.length_m, 0.5 * track.width_m);
    [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(ahead, left)| {
        let (ahead_m, left_m) = (ahead * half_m, left * side_m);
        [
            track.x_m[at] + ahead_m * cos - left_m * sin,
            track.y_m[at] + ahead_m * sin + left_m * cos,
        ]
    })
}
