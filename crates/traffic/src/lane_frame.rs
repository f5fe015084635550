//! Lanes of recorded traffic, fitted without a map.
//!
//! A carriageway's line is the track beside which others keep their offsets, extended by
//! further tracks. All rows are projected onto it. Where three vehicles or more drive, it
//! is moved onto the median of the right lane in every stretch of 20 m, and this is
//! repeated. Lanes are the peaks of the offsets of vehicles that do not move sideways.

use std::collections::BTreeSet;
use std::fmt;

use crate::lanes::{Lane, PlacedTrack, SettledRows, is_settled, lane_at, lanes, peaks};
use crate::median::median;
use crate::path::Path;
use crate::recording::{RoadUserTrack, TrafficRecording};
use crate::reference_line::{STEP_M, THINNED, belongs, reference_line, turns_rad};

/// Length of the stretches in which the line is centred.
const STRETCH_M: f64 = 20.0;
/// Vehicles in a stretch that move the line there.
const VEHICLES: usize = 3;
/// Turn within 40 m from which a line is that of a corner or a roundabout, 70°.
const CORNER_RAD: f64 = 1.2;
/// Share of the rows in the right lane, above a ramp's.
const RIGHT_LANE_SHARE: f64 = 0.15;

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
    /// Middle of the right lane in the frame of the file, in the direction of travel.
    pub path: Path,
    /// Offsets of the lanes' middles to the left of it in metres, from right to left.
    pub offsets_m: Vec<f64>,
}

/// Carriageways of a recording and the tracks in their frames.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LaneFrame {
    /// Carriageways, the one with the most tracks first.
    pub carriageways: Vec<Carriageway>,
    /// Place of every track of the recording, `None` outside of all carriageways.
    pub tracks: Vec<Option<PlacedTrack>>,
    /// Groups of vehicles that have no lanes.
    pub without_lanes: Vec<NoLanes>,
}

/// Reason why vehicles have no lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoLanes {
    /// This many turn as at a corner or in a roundabout.
    Turns(usize),
    /// This many keep no common offsets.
    Scattered(usize),
    /// This many drive along no common line.
    Apart(usize),
}

impl fmt::Display for NoLanes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NoLanes::Turns(count) => write!(f, "no lanes: {count} tracks turn sharply"),
            NoLanes::Scattered(count) => write!(f, "no lanes: {count} tracks keep no offsets"),
            NoLanes::Apart(count) => write!(f, "no lanes: {count} tracks along no common line"),
        }
    }
}

impl LaneFrame {
    /// Returns the median distance of adjacent lanes, `None` without two.
    pub fn lane_distance_m(&self) -> Option<f64> {
        let carriageways = self.carriageways.iter();
        let pairs = carriageways.flat_map(|it| it.lanes.windows(2));
        let apart = pairs.map(|pair| (pair[1].offset_m - pair[0].offset_m).abs());
        median(apart.collect::<Vec<f64>>())
    }

    /// Fits the carriageways of a recording from its motor vehicles.
    ///
    /// Tracks of less than 40 m start none. Traffic that turns sharply, or that keeps no
    /// common offsets, has no lanes.
    pub fn fit(recording: &TrafficRecording) -> LaneFrame {
        let mut free: Vec<usize> = (0..recording.tracks.len())
            .filter(|i| recording.tracks[*i].class.is_in_lanes())
            .collect();
        let mut fitted: Vec<(Path, Vec<usize>)> = Vec::new();
        let mut frame = LaneFrame::empty(recording);
        while let Some(path) = reference_line(recording, &free) {
            let (members, others): (Vec<usize>, Vec<usize>) = free
                .iter()
                .partition(|i| belongs(&recording.tracks[**i], &path));
            // A line without members would be found again and again.
            if members.is_empty() {
                break;
            }
            // A turn has no lanes of common offsets, since vehicles cut its
            // inside differently.
            if turns_rad(&path).1 > CORNER_RAD {
                frame.without_lanes.push(NoLanes::Turns(members.len()));
            } else {
                fitted.push((path, members));
            }
            free = others;
        }
        if !free.is_empty() {
            frame.without_lanes.push(NoLanes::Apart(free.len()));
        }
        // A line of very few vehicles, such as a rare turn, has no lanes to speak of.
        let all: usize = fitted.iter().map(|(_, members)| members.len()).sum();
        let (mut fitted, rare): (Vec<_>, Vec<_>) = fitted
            .into_iter()
            .partition(|(_, members)| all <= 100 * members.len());
        let rare = rare
            .iter()
            .map(|(_, members)| NoLanes::Apart(members.len()));
        frame.without_lanes.extend(rare);
        // Carriageway 0 has the most vehicles, as the documentation of the
        // field promises.
        fitted.sort_by_key(|(_, members)| std::cmp::Reverse(members.len()));
        for (path, members) in fitted {
            frame.add(recording, path, members);
        }
        frame
    }

    fn empty(recording: &TrafficRecording) -> LaneFrame {
        LaneFrame {
            tracks: vec![None; recording.tracks.len()],
            ..LaneFrame::default()
        }
    }

    /// Places the tracks of a recording on mapped lanes.
    ///
    /// Each motor vehicle belongs to the first carriageway along which most of its
    /// track runs. A carriageway without a vehicle is left out.
    pub fn on_map(recording: &TrafficRecording, map: &[MappedCarriageway]) -> LaneFrame {
        let mut frame = LaneFrame::empty(recording);
        let mut free: Vec<usize> = (0..recording.tracks.len())
            .filter(|i| recording.tracks[*i].class.is_in_lanes())
            .collect();
        for way in map {
            // Positions of tracks are relative to the origin, those of the map are not.
            let path = way.path.clone().relative_to(recording.origin_m);
            let (members, others): (Vec<usize>, Vec<usize>) = free
                .iter()
                .partition(|i| belongs(&recording.tracks[**i], &path));
            free = others;
            if !members.is_empty() {
                frame.add_on(recording, path, members, Some(&way.offsets_m));
            }
        }
        if !free.is_empty() {
            frame.without_lanes.push(NoLanes::Apart(free.len()));
        }
        frame
    }

    fn add(&mut self, recording: &TrafficRecording, mut path: Path, tracks: Vec<usize>) {
        for pass in Pass::ALL {
            let rows = thinned(recording, &tracks, &path);
            // Too few rows to centre on leave the path as it is.
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
        // Vehicles that change lanes would blur the peaks of the offsets.
        let settled = SettledRows::of(&placed, recording.dt_s);
        // Lanes need all tracks, so every track gets its lane numbers
        // afterwards.
        let (lanes, outside) = lanes(&placed, &settled, path.length_m(), offsets_m);
        for (_, track) in &mut placed {
            let lane = |it: &f64| lane_at(&lanes, *it);
            track.lane = track.lateral_m.iter().map(lane).collect();
        }
        // A map is believed, whatever the traffic does.
        if offsets_m.is_none() && !settled.have_lanes(&lanes, &placed) {
            self.without_lanes.push(NoLanes::Scattered(placed.len()));
            return;
        }
        for (i, track) in placed.drain(..) {
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
    track: usize,
}

/// Projects one of [`THINNED`] rows of the tracks, without those that move sideways.
fn thinned(recording: &TrafficRecording, tracks: &[usize], path: &Path) -> Vec<RowPlace> {
    let mut rows = Vec::new();
    // One second on either side, in thinned rows.
    let reach = ((1.0 / (recording.dt_s * THINNED as f64)).round() as usize).max(1);
    for (number, track) in tracks.iter().map(|i| (*i, &recording.tracks[*i])) {
        // Only the first row needs the search over the whole path. The others
        // go on from there.
        let mut piece = path.place_anywhere([track.x_m[0], track.y_m[0]]).piece;
        let own = (0..track.len()).step_by(THINNED).map(|i| {
            let place = path.place([track.x_m[i], track.y_m[i]], piece);
            piece = place.piece;
            RowPlace {
                s_m: place.s_m,
                lateral_m: place.lateral_m,
                track: number,
            }
        });
        let own: Vec<RowPlace> = own.collect();
        let offsets_m: Vec<f64> = own.iter().map(|it| it.lateral_m).collect();
        let settled = own
            .into_iter()
            .enumerate()
            .filter(|(i, _)| is_settled(&offsets_m, *i, reach));
        rows.extend(settled.map(|(_, row)| row));
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
    let mut offsets: Vec<Vec<(f64, usize)>> = vec![Vec::new(); stretches];
    for row in rows.iter().filter(|row| row.s_m >= 0.0) {
        if let Some(stretch) = offsets.get_mut((row.s_m / STRETCH_M) as usize) {
            stretch.push((row.lateral_m, row.track));
        }
    }
    // The stretch with most rows shows its lanes best, so the others follow
    // it.
    let fullest = (0..stretches).max_by_key(|i| offsets[*i].len())?;
    let start_m = match pass {
        Pass::Refine => 0.0,
        _ => {
            let all: Vec<f64> = offsets[fullest].iter().map(|it| it.0).collect();
            let peaks = peaks(&all, RIGHT_LANE_SHARE);
            peaks.into_iter().max_by_key(|it| it.1)?.0
        }
    };
    let mut middle_m = vec![start_m; stretches];
    let follow = |i: usize, near_m: f64| {
        let near = || offsets[i].iter().filter(|it| (it.0 - near_m).abs() < 1.2);
        let vehicles: BTreeSet<usize> = near().map(|it| it.1).collect();
        // The median of one vehicle is the wish of its driver, not the place of the lane.
        if near().count() < 10 || vehicles.len() < VEHICLES {
            return near_m;
        }
        median(near().map(|it| it.0).collect::<Vec<f64>>()).unwrap_or(near_m)
    };
    middle_m[fullest] = follow(fullest, start_m);
    // Away from the fullest stretch, so that each one starts from a settled
    // neighbour.
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

fn place(track: &RoadUserTrack, path: &Path, carriageway: usize) -> PlacedTrack {
    let mut piece = path.place_anywhere([track.x_m[0], track.y_m[0]]).piece;
    let mut placed = PlacedTrack {
        carriageway,
        ..PlacedTrack::default()
    };
    for (x, y) in track.x_m.iter().zip(&track.y_m) {
        let at = path.place([*x, *y], piece);
        piece = at.piece;
        // The path is that of box centres, and places are those of front
        // bumpers.
        placed.s_m.push(at.s_m + 0.5 * track.length_m);
        placed.lateral_m.push(at.lateral_m);
    }
    placed
}
