//! Line along which traffic in one direction drives, from the tracks of all vehicles.
//!
//! It begins with the medoid: the track beside which the others keep their offsets best.
//! The others of a vehicle that changes lanes seem to move sideways, so it is not chosen.

use crate::path::Path;
use crate::raw::wrapped;
use crate::recording::{RoadUserTrack, TrafficRecording};

/// Distance of the points of a line in metres.
pub(crate) const STEP_M: f64 = 5.0;
/// Offset from the line within which traffic belongs to a carriageway.
pub(crate) const WIDTH_M: f64 = 15.0;
/// Difference of headings within which traffic belongs to a carriageway.
pub(crate) const SAME_WAY_RAD: f64 = 0.6;
/// Shortest track that starts a carriageway.
const SEED_M: f64 = 40.0;
/// Share of the longest track that a medoid has at least.
const SEED_SHARE: f64 = 0.6;
/// Tracks that are compared as the medoid, and with each of them.
const COMPARED: usize = 24;
/// Rows of which one is looked at where all would be too many.
pub(crate) const THINNED: usize = 5;
/// Lateral motion that is noise, in metres.
const NOISE_M: f64 = 0.3;
/// Turn of a line from which it is a loop, 240°.
const LOOP_RAD: f64 = 4.2;

/// Returns a line from the medoid of the longer tracks on.
pub(crate) fn reference_line(recording: &TrafficRecording, free: &[usize]) -> Option<Path> {
    let mut candidates: Vec<(f64, usize)> = free
        .iter()
        .map(|i| (recording.tracks[*i].distance_m(), *i))
        .filter(|(length_m, i)| *length_m >= SEED_M && !is_loop(&recording.tracks[*i]))
        .collect();
    // The longest first, since only a number of them is compared.
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
    let longest_m = candidates.first()?.0;
    candidates.retain(|it| it.0 >= SEED_SHARE * longest_m);
    candidates.truncate(COMPARED);
    let mut best: Option<(f64, f64, Path)> = None;
    for (_, seed) in &candidates {
        let Some(path) = Path::through(points(&recording.tracks[*seed]), STEP_M) else {
            continue;
        };
        let moved_m = sideways_m(recording, free, *seed, &path);
        let bends = bending(&path);
        let is_better = best.as_ref().is_none_or(|(least_m, least, _)| {
            // Within the noise the straighter one wins, because bends of a
            // seed are copied into the line.
            moved_m < least_m - NOISE_M || (moved_m < least_m + NOISE_M && bends < *least)
        });
        if is_better {
            // The least of all so far, so that steps within the noise do not
            // add up.
            let least_m = best.as_ref().map_or(moved_m, |it| it.0.min(moved_m));
            best = Some((least_m, bends, path));
        }
    }
    let mut path = best?.2;
    // Each extension adds a part of a track, and no track is needed twice at either end.
    for _ in 0..2 * free.len() {
        let Some(longer) = extended(recording, free, &path) else {
            break;
        };
        path = longer;
    }
    Some(path)
}

/// Returns true if a track turns like one that drives round.
fn is_loop(track: &RoadUserTrack) -> bool {
    let mut turned_rad = 0.0;
    let (mut least, mut most) = (0.0_f64, 0.0_f64);
    for pair in track.heading_rad.windows(2) {
        turned_rad += wrapped(pair[1] - pair[0]);
        least = least.min(turned_rad);
        most = most.max(turned_rad);
    }
    most - least > LOOP_RAD
}

fn points(track: &RoadUserTrack) -> impl Iterator<Item = [f64; 2]> {
    let places = track.x_m.iter().zip(&track.y_m);
    places.map(|(x, y)| [*x, *y])
}

/// Returns the mean range of the offsets of other tracks from a path.
fn sideways_m(recording: &TrafficRecording, free: &[usize], seed: usize, path: &Path) -> f64 {
    let others = free.iter().filter(|i| **i != seed);
    // Spread over all tracks, so that traffic of the whole recording votes.
    let step = free.len().div_ceil(COMPARED).max(1);
    let (mut n, mut sum_m) = (0.0, 0.0);
    for i in others.step_by(step) {
        let track = &recording.tracks[*i];
        let mut piece = path.place_anywhere([track.x_m[0], track.y_m[0]]).piece;
        let (mut least_m, mut most_m) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in (0..track.len()).step_by(THINNED) {
            let place = path.place([track.x_m[k], track.y_m[k]], piece);
            piece = place.piece;
            let is_beside = (0.0..=path.length_m()).contains(&place.s_m);
            if is_beside && place.lateral_m.abs() < WIDTH_M {
                least_m = least_m.min(place.lateral_m);
                most_m = most_m.max(place.lateral_m);
            }
        }
        if least_m <= most_m {
            n += 1.0;
            sum_m += most_m - least_m;
        }
    }
    // A path that no other track runs beside contradicts none.
    if n == 0.0 { 0.0 } else { sum_m / n }
}

/// Returns how much the curvature of a path varies, 0 for lines and arcs.
fn bending(path: &Path) -> f64 {
    let courses: Vec<f64> = (0..path.pieces())
        // Points 20 m apart, so that jitter of single points is no bend.
        .step_by(4)
        .map(|piece| {
            let [x, y] = path.direction(piece);
            libm::atan2(y, x)
        })
        .collect();
    let turns: Vec<f64> = courses
        .windows(2)
        .map(|it| wrapped(it[1] - it[0]))
        .collect();
    turns.windows(2).map(|it| (it[1] - it[0]).abs()).sum()
}

/// Returns the net turn of a path, and the sharpest one within 40 m.
pub(crate) fn turns_rad(path: &Path) -> (f64, f64) {
    let courses: Vec<f64> = (0..path.pieces())
        .map(|piece| {
            let [x, y] = path.direction(piece);
            libm::atan2(y, x)
        })
        .collect();
    let mut turned = vec![0.0];
    for pair in courses.windows(2) {
        turned.push(turned[turned.len() - 1] + wrapped(pair[1] - pair[0]));
    }
    let within = (40.0 / STEP_M) as usize;
    let sharpest = (0..turned.len()).map(|i| {
        // Shorter near the end of the path.
        let to = (i + within).min(turned.len() - 1);
        (turned[to] - turned[i]).abs()
    });
    (turned[turned.len() - 1].abs(), sharpest.fold(0.0, f64::max))
}

/// Returns the path with the part of a track beyond one of its ends, `None` without one.
///
/// Of the tracks that reach far, the straightest is taken.
fn extended(recording: &TrafficRecording, free: &[usize], path: &Path) -> Option<Path> {
    let mut tails: Vec<(f64, bool, Vec<[f64; 2]>)> = Vec::new();
    for is_end in [true, false] {
        for i in free {
            if let Some((gain_m, tail)) = tail(&recording.tracks[*i], path, is_end) {
                tails.push((gain_m, is_end, tail));
            }
        }
    }
    let most_m = tails.iter().map(|it| it.0).fold(0.0, f64::max);
    let far = tails.into_iter().filter(|it| it.0 >= SEED_SHARE * most_m);
    let bends = |tail: &[[f64; 2]]| {
        let path = Path::through(tail.iter().copied(), STEP_M);
        path.map_or(0.0, |it| bending(&it))
    };
    let best = far.min_by(|a, b| bends(&a.2).total_cmp(&bends(&b.2)));
    let (_, is_end, tail) = best?;
    let line = path.points().map(|(point, _)| point);
    let whole: Vec<[f64; 2]> = if is_end {
        line.chain(tail).collect()
    } else {
        tail.into_iter().chain(line).collect()
    };
    let longer = Path::through(whole, STEP_M)?;
    // Traffic that drives round would extend it without end.
    (turns_rad(&longer).0 < LOOP_RAD && longer.length_m() > path.length_m() + STEP_M)
        .then_some(longer)
}

/// Returns the part of a track beyond an end of the path, moved onto the path's line.
fn tail(track: &RoadUserTrack, path: &Path, is_end: bool) -> Option<(f64, Vec<[f64; 2]>)> {
    let piece = if is_end { path.pieces() - 1 } else { 0 };
    let [ux, uy] = path.direction(piece);
    let tip = path.tip(is_end);
    let course_rad = libm::atan2(uy, ux);
    // Along and across the straight extension of the tip.
    let at = |i: usize| {
        let (dx, dy) = (track.x_m[i] - tip[0], track.y_m[i] - tip[1]);
        (ux * dx + uy * dy, ux * dy - uy * dx)
    };
    let rows: Vec<usize> = (0..track.len()).step_by(THINNED).collect();
    let crossing = rows.windows(2).position(|pair| {
        let (a, b) = (at(pair[0]), at(pair[1]));
        let same_way = || wrapped(track.heading_rad[pair[0]] - course_rad).abs() < SAME_WAY_RAD;
        a.0 <= 0.0 && b.0 > 0.0 && a.1.abs() < WIDTH_M && same_way()
    })?;
    let left_m = at(rows[crossing]).1;
    let rows = if is_end {
        &rows[crossing + 1..]
    } else {
        &rows[..=crossing]
    };
    // The offset at the tip is removed, so that the extension continues the
    // line of the lane.
    let tail: Vec<[f64; 2]> = rows
        .iter()
        .map(|i| [track.x_m[*i] + left_m * uy, track.y_m[*i] - left_m * ux])
        .collect();
    let (first, last) = (tail.first()?, tail.last()?);
    let gain_m = libm::hypot(last[0] - first[0], last[1] - first[1]);
    // Shorter tails are not worth their noise.
    (4.0 * STEP_M < gain_m).then_some((gain_m, tail))
}

/// Returns true if most of a track runs along a path.
pub(crate) fn belongs(track: &RoadUserTrack, path: &Path) -> bool {
    let mut piece = path.place_anywhere([track.x_m[0], track.y_m[0]]).piece;
    let (mut along, mut seen) = (0, 0);
    // A share needs no more rows, and this runs for every pair of track and
    // line.
    for i in (0..track.len()).step_by(10) {
        let place = path.place([track.x_m[i], track.y_m[i]], piece);
        piece = place.piece;
        let [ux, uy] = path.direction(piece);
        let turned = wrapped(track.heading_rad[i] - libm::atan2(uy, ux)).abs();
        let is_along = place.lateral_m.abs() < WIDTH_M && turned < SAME_WAY_RAD;
        along += usize::from(is_along);
        seen += 1;
    }
    // Four fifths, in whole numbers.
    4 * seen <= 5 * along
}
