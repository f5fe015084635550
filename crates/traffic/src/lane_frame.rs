//! Lanes of recorded traffic, fitted without a map.
//!
//! Trajectories are chained into one line per carriageway and direction. All rows are
//! projected onto it. The line is then moved onto the median of the right lane in
//! every stretch of 20 m, and this is repeated. Lanes are the peaks of the offsets.

use crate::grid::wrapped;
use crate::path::Path;
use crate::recording::{RoadUserTrack, TrafficRecording};

/// Distance of the points of a carriageway's line.
const STEP_M: f64 = 5.0;
/// Length of the stretches in which the line is centred.
const STRETCH_M: f64 = 20.0;
/// Offset from the line within which traffic belongs to a carriageway.
const WIDTH_M: f64 = 15.0;
/// Difference of headings within which traffic belongs to a carriageway.
const SAME_WAY_RAD: f64 = 0.6;
/// Shortest track that starts a carriageway.
const SEED_M: f64 = 100.0;
/// Rows of which one is looked at where all would be too many.
const THINNED: usize = 5;
/// Share of the rows in the right lane, above a ramp's.
const RIGHT_LANE_SHARE: f64 = 0.15;
/// Width of the bins of offsets.
const BIN_M: f64 = 0.1;
/// Least distance of two lanes.
const LANE_M: f64 = 2.0;
/// Least share of the rows in a lane.
const LANE_SHARE: f64 = 0.005;
/// Offset from the middle of a lane within which a vehicle is in it.
const IN_LANE_M: f64 = 1.9;

/// Lane of a carriageway.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Lane {
    /// Offset of its middle from the line in metres, to the left.
    pub offset_m: f64,
    /// Share of the carriageway's rows within 1.9 m of it.
    pub share: f64,
    /// Deviation of its median per 100 m from the offset, 95 % quantile in metres.
    pub wander_m: f64,
}

/// Traffic in one direction with its line and lanes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Carriageway {
    /// Line along the right lane, in the direction of travel.
    pub path: Path,
    /// Lanes from right to left.
    pub lanes: Vec<Lane>,
    /// Share of rows in no lane.
    pub outside: f64,
    /// Tracks by their position in the recording.
    pub tracks: Vec<usize>,
}

/// Traffic lanes of one direction, from a map.
#[derive(Clone, Debug, PartialEq)]
pub struct MappedCarriageway {
    /// Middle of the right lane, in the direction of travel.
    pub path: Path,
    /// Offsets of the lanes' middles to the left of it in metres, from right to left.
    pub offsets_m: Vec<f64>,
}

/// Track in the frame of its carriageway, a value per sample.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PlacedTrack {
    /// Position of the carriageway in the frame.
    pub carriageway: usize,
    /// Front bumper along the line in metres.
    pub s_m: Vec<f64>,
    /// Box centre to the left of the line in metres.
    pub lateral_m: Vec<f64>,
    /// Lane from the right, 0 first, `None` outside of all lanes.
    pub lane: Vec<Option<u8>>,
}

/// Carriageways of a recording and the tracks in their frames.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LaneFrame {
    /// Carriageways, the one with the most tracks first.
    pub carriageways: Vec<Carriageway>,
    /// Place of every track of the recording, `None` outside of all carriageways.
    pub tracks: Vec<Option<PlacedTrack>>,
}

impl LaneFrame {
    /// Fits the carriageways of a recording from its motor vehicles.
    ///
    /// A recording without a track of 100 m has none.
    pub fn fit(recording: &TrafficRecording) -> LaneFrame {
        let mut free: Vec<usize> = (0..recording.tracks.len())
            .filter(|i| recording.tracks[*i].class.is_in_lanes())
            .collect();
        let mut fitted: Vec<(Path, Vec<usize>)> = Vec::new();
        while let Some(path) = chained(recording, &free) {
            let (members, others): (Vec<usize>, Vec<usize>) = free
                .iter()
                .partition(|i| belongs(&recording.tracks[**i], &path));
            if members.is_empty() {
                break;
            }
            fitted.push((path, members));
            free = others;
        }
        // A line of very few vehicles, such as a rare turn, has no lanes to speak of.
        let all: usize = fitted.iter().map(|(_, members)| members.len()).sum();
        fitted.retain(|(_, members)| all <= 100 * members.len());
        fitted.sort_by_key(|(_, members)| std::cmp::Reverse(members.len()));
        let mut frame = LaneFrame {
            carriageways: Vec::new(),
            tracks: vec![None; recording.tracks.len()],
        };
        for (path, members) in fitted {
            frame.add(recording, path, members);
        }
        frame
    }

    /// Places the tracks of a recording on mapped lanes.
    ///
    /// Each motor vehicle belongs to the first carriageway along which most of its
    /// track runs. A carriageway without a vehicle is left out.
    pub fn on_map(recording: &TrafficRecording, map: &[MappedCarriageway]) -> LaneFrame {
        let mut frame = LaneFrame {
            carriageways: Vec::new(),
            tracks: vec![None; recording.tracks.len()],
        };
        let mut free: Vec<usize> = (0..recording.tracks.len())
            .filter(|i| recording.tracks[*i].class.is_in_lanes())
            .collect();
        for way in map {
            let (members, others): (Vec<usize>, Vec<usize>) = free
                .iter()
                .partition(|i| belongs(&recording.tracks[**i], &way.path));
            free = others;
            if !members.is_empty() {
                frame.add_on(recording, way.path.clone(), members, Some(&way.offsets_m));
            }
        }
        frame
    }

    fn add(&mut self, recording: &TrafficRecording, mut path: Path, tracks: Vec<usize>) {
        for pass in Pass::ALL {
            let rows = thinned(recording, &tracks, &path);
            let Some(centred) = centred(&path, &rows, pass) else {
                break;
            };
            path = centred;
        }
        self.add_on(recording, path, tracks, None);
    }

    /// Adds a carriageway with its lanes, which are fitted if there are no offsets.
    fn add_on(
        &mut self,
        recording: &TrafficRecording,
        path: Path,
        tracks: Vec<usize>,
        offsets_m: Option<&[f64]>,
    ) {
        let carriageway = self.carriageways.len();
        let mut placed: Vec<(usize, PlacedTrack)> = tracks
            .iter()
            .map(|i| (*i, place(&recording.tracks[*i], &path, carriageway)))
            .collect();
        let (lanes, outside) = lanes(&placed, path.length_m(), offsets_m);
        for (i, mut track) in placed.drain(..) {
            track.lane = track
                .lateral_m
                .iter()
                .map(|it| lane_at(&lanes, *it))
                .collect();
            self.tracks[i] = Some(track);
        }
        self.carriageways.push(Carriageway {
            path,
            lanes,
            outside,
            tracks,
        });
    }
}

/// Returns the lane whose middle is nearest, within 1.9 m.
fn lane_at(lanes: &[Lane], lateral_m: f64) -> Option<u8> {
    let far = |lane: &Lane| (lane.offset_m - lateral_m).abs();
    let nearest = lanes
        .iter()
        .enumerate()
        .min_by(|a, b| far(a.1).total_cmp(&far(b.1)))?;
    (far(nearest.1) <= IN_LANE_M).then_some(nearest.0 as u8)
}

/// Chains trajectories from the longest one on.
fn chained(recording: &TrafficRecording, free: &[usize]) -> Option<Path> {
    let lengths = free.iter().map(|i| (recording.tracks[*i].distance_m(), *i));
    let (length_m, seed) = lengths.max_by(|a, b| a.0.total_cmp(&b.0))?;
    if length_m < SEED_M {
        return None;
    }
    let mut line: Vec<[f64; 2]> = points(&recording.tracks[seed]);
    loop {
        let path = Path::through(line.iter().copied(), STEP_M)?;
        let Some(longer) = extended(recording, free, &path) else {
            return Some(path);
        };
        line = longer;
    }
}

fn points(track: &RoadUserTrack) -> Vec<[f64; 2]> {
    let places = track.x_m.iter().zip(&track.y_m);
    places.map(|(x, y)| [*x, *y]).collect()
}

/// Returns the line with the trajectory that reaches farthest beyond one of its ends.
fn extended(recording: &TrafficRecording, free: &[usize], path: &Path) -> Option<Vec<[f64; 2]>> {
    let line: Vec<[f64; 2]> = path.points().map(|(point, _)| point).collect();
    let mut best: Option<(f64, Vec<[f64; 2]>)> = None;
    for is_end in [true, false] {
        for i in free {
            let track = &recording.tracks[*i];
            let Some((gain_m, tail)) = tail(track, path, is_end) else {
                continue;
            };
            if best.as_ref().is_none_or(|(most_m, _)| *most_m < gain_m) {
                let whole = if is_end {
                    [&line[..], &tail].concat()
                } else {
                    [&tail[..], &line].concat()
                };
                best = Some((gain_m, whole));
            }
        }
    }
    best.map(|(_, line)| line)
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
        a.0 <= 0.0 && 0.0 < b.0 && a.1.abs() < WIDTH_M && same_way()
    })?;
    let left_m = at(rows[crossing]).1;
    let rows = if is_end {
        &rows[crossing + 1..]
    } else {
        &rows[..=crossing]
    };
    let tail: Vec<[f64; 2]> = rows
        .iter()
        .map(|i| [track.x_m[*i] + left_m * uy, track.y_m[*i] - left_m * ux])
        .collect();
    let (first, last) = (tail.first()?, tail.last()?);
    let gain_m = libm::hypot(last[0] - first[0], last[1] - first[1]);
    (4.0 * STEP_M < gain_m).then_some((gain_m, tail))
}

/// Returns true if most of a track runs along a path.
fn belongs(track: &RoadUserTrack, path: &Path) -> bool {
    let mut piece = path.place_anywhere([track.x_m[0], track.y_m[0]]).piece;
    let (mut along, mut seen) = (0, 0);
    for i in (0..track.len()).step_by(10) {
        let place = path.place([track.x_m[i], track.y_m[i]], piece);
        piece = place.piece;
        let [ux, uy] = path.direction(piece);
        let turned = wrapped(track.heading_rad[i] - libm::atan2(uy, ux)).abs();
        let is_along = place.lateral_m.abs() < WIDTH_M && turned < SAME_WAY_RAD;
        along += usize::from(is_along);
        seen += 1;
    }
    4 * seen <= 5 * along
}

/// Pass of the centring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pass {
    /// Onto the fullest lane, followed from the fullest stretch.
    Fullest,
    /// By a constant, from the fullest lane onto the right one.
    ToRight,
    /// Onto the lane at the line.
    Refine,
}

impl Pass {
    const ALL: [Pass; 5] = [
        Pass::Fullest,
        Pass::Fullest,
        Pass::ToRight,
        Pass::Refine,
        Pass::Refine,
    ];
}

/// Place of a row.
struct RowPlace {
    s_m: f64,
    lateral_m: f64,
}

/// Projects one of [`THINNED`] rows of the tracks.
fn thinned(recording: &TrafficRecording, tracks: &[usize], path: &Path) -> Vec<RowPlace> {
    let mut rows = Vec::new();
    for track in tracks.iter().map(|i| &recording.tracks[*i]) {
        let mut piece = path.place_anywhere([track.x_m[0], track.y_m[0]]).piece;
        for i in (0..track.len()).step_by(THINNED) {
            let place = path.place([track.x_m[i], track.y_m[i]], piece);
            piece = place.piece;
            rows.push(RowPlace {
                s_m: place.s_m,
                lateral_m: place.lateral_m,
            });
        }
    }
    rows
}

/// Moves a path onto the median of a lane.
fn centred(path: &Path, rows: &[RowPlace], pass: Pass) -> Option<Path> {
    if pass == Pass::ToRight {
        let all: Vec<f64> = rows.iter().map(|row| row.lateral_m).collect();
        let right_m = peaks(&all, RIGHT_LANE_SHARE).first()?.0;
        return path.moved(|_| right_m, 0.5 * STEP_M);
    }
    let stretches = (path.length_m() / STRETCH_M).ceil().max(1.0) as usize;
    let mut offsets: Vec<Vec<f64>> = vec![Vec::new(); stretches];
    for row in rows.iter().filter(|row| 0.0 <= row.s_m) {
        if let Some(stretch) = offsets.get_mut((row.s_m / STRETCH_M) as usize) {
            stretch.push(row.lateral_m);
        }
    }
    let fullest = (0..stretches).max_by_key(|i| offsets[*i].len())?;
    let start_m = match pass {
        Pass::Refine => 0.0,
        _ => {
            let peaks = peaks(&offsets[fullest], RIGHT_LANE_SHARE);
            peaks.into_iter().max_by_key(|it| it.1)?.0
        }
    };
    let mut middle_m = vec![start_m; stretches];
    let follow = |i: usize, near_m: f64| {
        let is_near = |it: &&f64| (*it - near_m).abs() < 1.2;
        let near: Vec<f64> = offsets[i].iter().filter(is_near).copied().collect();
        if near.len() < 10 {
            near_m
        } else {
            median(near).unwrap_or(near_m)
        }
    };
    middle_m[fullest] = follow(fullest, start_m);
    for i in fullest + 1..stretches {
        middle_m[i] = follow(i, middle_m[i - 1]);
    }
    for i in (0..fullest).rev() {
        middle_m[i] = follow(i, middle_m[i + 1]);
    }
    let offset_m = |s: f64| {
        // Linear between the middles of the stretches.
        let at = (s / STRETCH_M - 0.5).clamp(0.0, (stretches - 1) as f64);
        let i = (at as usize).min(stretches.saturating_sub(2));
        let next = (i + 1).min(stretches - 1);
        middle_m[i] + (at - i as f64) * (middle_m[next] - middle_m[i])
    };
    path.moved(offset_m, 0.5 * STEP_M)
}

pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Returns the peaks of offsets from right to left, with their counts.
///
/// A peak has at least the share `least` of all offsets within 1 m.
fn peaks(offsets: &[f64], least: f64) -> Vec<(f64, usize)> {
    let bins = (2.0 * WIDTH_M / BIN_M) as usize;
    let mut counts = vec![0.0_f64; bins];
    for offset in offsets.iter().filter(|it| it.abs() < WIDTH_M) {
        let bin = ((offset + WIDTH_M) / BIN_M) as usize;
        counts[bin.min(bins - 1)] += 1.0;
    }
    let smooth: Vec<f64> = (0..bins as isize)
        .map(|i| {
            let weight = |k: isize| f64::from(7 - k.unsigned_abs() as i32);
            let at = |k: isize| counts.get((i + k) as usize).copied().unwrap_or(0.0);
            (-6..=6).map(|k| weight(k) * at(k)).sum()
        })
        .collect();
    let mut order: Vec<usize> = (1..bins - 1)
        .filter(|i| smooth[i - 1] <= smooth[*i] && smooth[i + 1] < smooth[*i])
        .collect();
    order.sort_by(|a, b| smooth[*b].total_cmp(&smooth[*a]));
    let mut found: Vec<(f64, usize)> = Vec::new();
    for i in order {
        let middle_m = (i as f64 + 0.5) * BIN_M - WIDTH_M;
        let near = |it: &&f64| (*it - middle_m).abs() < 1.0;
        let count = offsets.iter().filter(near).count();
        let is_apart = found.iter().all(|it| LANE_M <= (it.0 - middle_m).abs());
        if is_apart && least * offsets.len() as f64 <= count as f64 {
            found.push((middle_m, count));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

fn place(track: &RoadUserTrack, path: &Path, carriageway: usize) -> PlacedTrack {
    let mut piece = path.place_anywhere([track.x_m[0], track.y_m[0]]).piece;
    let mut placed = PlacedTrack {
        carriageway,
        ..PlacedTrack::default()
    };
    for (x, y) in track.x_m.iter().zip(&track.y_m) {
        let at = path.place([*x, *y], piece);
        piece = at.piece;
        placed.s_m.push(at.s_m + 0.5 * track.length_m);
        placed.lateral_m.push(at.lateral_m);
    }
    placed
}

/// Returns the lanes and the share of rows in none of them.
///
/// The lanes have the given offsets, or those of the peaks.
fn lanes(
    placed: &[(usize, PlacedTrack)],
    length_m: f64,
    offsets_m: Option<&[f64]>,
) -> (Vec<Lane>, f64) {
    let all: Vec<f64> = placed
        .iter()
        .flat_map(|(_, track)| track.lateral_m.iter().copied())
        .collect();
    let fitted = || peaks(&all, LANE_SHARE).into_iter().map(|it| it.0).collect();
    let offsets_m: Vec<f64> = offsets_m.map_or_else(fitted, <[f64]>::to_vec);
    let mut lanes: Vec<Lane> = offsets_m
        .into_iter()
        .map(|offset_m| Lane {
            offset_m,
            share: 0.0,
            wander_m: 0.0,
        })
        .collect();
    let pieces = (length_m / 100.0).ceil().max(1.0) as usize;
    let mut rows: Vec<Vec<Vec<f64>>> = vec![vec![Vec::new(); pieces]; lanes.len()];
    let mut counts = vec![0_usize; lanes.len()];
    for (_, track) in placed {
        for (s, lateral_m) in track.s_m.iter().zip(&track.lateral_m) {
            let Some(lane) = lane_at(&lanes, *lateral_m) else {
                continue;
            };
            counts[usize::from(lane)] += 1;
            let piece = ((s / 100.0).max(0.0) as usize).min(pieces - 1);
            rows[usize::from(lane)][piece].push(*lateral_m);
        }
    }
    for ((lane, rows), count) in lanes.iter_mut().zip(rows).zip(&counts) {
        lane.share = *count as f64 / all.len().max(1) as f64;
        let medians = rows
            .into_iter()
            // The median of a few rows is the wish of one driver, not the place of the lane.
            .filter(|it| 100 <= it.len())
            .filter_map(median);
        let mut wander: Vec<f64> = medians.map(|it| (it - lane.offset_m).abs()).collect();
        wander.sort_by(f64::total_cmp);
        // Not the greatest deviation, which a single short piece can cause.
        let at = (0.95 * wander.len().saturating_sub(1) as f64).ceil() as usize;
        lane.wander_m = wander.get(at).copied().unwrap_or(0.0);
    }
    let inside: usize = counts.iter().sum();
    (lanes, 1.0 - inside as f64 / all.len().max(1) as f64)
}
