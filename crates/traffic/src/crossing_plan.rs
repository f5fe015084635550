//! Recorded crossings as plans: both paths as roads, and the motion along one of them.

use crate::analysis::Analysis;
use crate::crossing_roads::{CrossingRoads, PlacedPath};
use crate::crossings::{PathCrossing, clearance_m};
use crate::plan::{PIECE_S, SpeedPlan};
use crate::recording::RoadUserTrack;
use crate::situation_plan::{SituationPlan, SituationRoad};
use crate::situations::WINDOW_S;
use crate::stock_body::StockBody;

/// Time from the start until the first road user has left the place, at most.
const LEAVES_AFTER_S: f64 = 6.0;
/// The same at least.
const LEAST_LEAVES_AFTER_S: f64 = 2.0;
/// Time from the start until the second road user enters the place, at most.
const ENTERS_AFTER_S: f64 = 8.0;
/// Time for which the ado is recorded after it has passed the place.
const PASSED_S: f64 = 1.0;
/// Time for which the path of the replaced road user is taken.
const PATH_S: f64 = 20.0;
/// Least clearance at the start and of the recorded crossing, in metres.
const START_CLEAR_M: f64 = 1.0;
const OVERLAP_M: f64 = 0.05;
/// Least speed of the replaced road user at the start: a waiting one has reasons that the
/// world does not have.
const MOVING_MPS: f64 = 1.0;
/// Least speed that an ego keeps without traffic.
const LEAST_DESIRED_MPS: f64 = 2.0;
impl SituationPlan {
    /// Fits a crossing. The ego replaces a motor vehicle, the later one of two.
    ///
    /// Returns `None` if neither is a motor vehicle, if boxes overlap, if the paths are no
    /// roads, or if the two are not recorded from 2 s before the first leaves the place
    /// until 1 s after the planned one has passed it. The plan is at most 0.1 m off, both
    /// states at the start are recorded, and the replaced road user moves there.
    pub fn crossing(analysis: &Analysis, crossing: &PathCrossing) -> Option<SituationPlan> {
        let recording = &analysis.recording;
        let dt_s = recording.dt_s;
        let is_motor = |i: usize| recording.tracks[i].class.is_motor_vehicle();
        let (own, other) = match (is_motor(crossing.first), is_motor(crossing.second)) {
            // The later one can still react, so the ego replaces it where it
            // can.
            (_, true) => (crossing.second, crossing.first),
            (true, false) => (crossing.first, crossing.second),
            (false, false) => return None,
        };
        // Overlapping boxes are errors of the recording, not contacts.
        if crossing.is_filled || crossing.least_m.is_some_and(|it| it < OVERLAP_M) {
            return None;
        }
        let (track, planned) = (&recording.tracks[own], &recording.tracks[other]);
        let sample = start_sample(crossing, [track, planned], dt_s)?;
        let (own_at, other_at) = (sample - track.first_sample, sample - planned.first_sample);
        // A start that a recorder made up is no recorded situation.
        let is_filled = track.filled[own_at] || planned.filled[other_at];
        if is_filled || clearance_m((track, own_at), (planned, other_at)) < START_CLEAR_M {
            return None;
        }
        let samples = |seconds: f64| (seconds / dt_s).round() as usize;
        // The tolerance retains a piece that ends with the last sample.
        let left_s = (planned.len() - 1 - other_at) as f64 * dt_s + 1e-6;
        let pieces = (left_s.min(WINDOW_S) / PIECE_S) as usize;
        let end_s = sample as f64 * dt_s + pieces as f64 * PIECE_S;
        let passes_s = passed_s(crossing, other, planned.length_m);
        if end_s < passes_s {
            return None;
        }

        let path_end = (own_at + samples(PATH_S)).min(track.len());
        let ego = PlacedPath::fit(track, StockBody::EGO, own_at..path_end)?;
        // One more sample, so that the last piece is whole.
        let window = samples(pieces as f64 * PIECE_S) + 1;
        let body = StockBody::of(planned);
        let path = PlacedPath::fit(planned, body, other_at..other_at + window)?;
        // Only its start is used, so this fit need not repeat the recording.
        let own_speed = SpeedPlan::fit(&ego.s_m[..ego.s_m.len().min(window)], dt_s)?;
        let speed = SpeedPlan::fit(&path.s_m, dt_s).filter(SpeedPlan::repeats)?;
        // World files refuse a faster start of such a body.
        let is_fast = body.most_mps().is_some_and(|it| it < speed.start_mps);
        if own_speed.start_mps < MOVING_MPS || is_fast {
            return None;
        }
        let desired_mps = mean_mps(&ego, crossing.point_m, dt_s);
        let mut roads = CrossingRoads {
            ego_s_m: ego.s_m[0] + own_speed.start_m + StockBody::EGO.lever_m(),
            other_s_m: path.s_m[0] + speed.start_m + body.lever_m(),
            ego: ego.road,
            other: path.road,
            desired_mps,
            pet_s: crossing.pet_s(),
            angle_rad: crossing.angle_rad,
            least_mps: 0.0,
            across_m: path.across_m,
        };
        roads.least_mps = least_mps(&roads, body, &speed, crossing.point_m);
        Some(SituationPlan {
            source: recording.name.clone(),
            time_s: sample as f64 * dt_s,
            replaced: track.id.clone(),
            planned: planned.id.clone(),
            body,
            ego_mps: own_speed.start_mps,
            gap_m: clearance_m((track, own_at), (planned, other_at)),
            speed,
            across: None,
            road: SituationRoad::Crossing(Box::new(roads)),
            tracks: [own, other],
            others: Vec::new(),
            // A shorter time is harder, so its sign is turned.
            hardness: -crossing.pet_s(),
        })
    }
}

/// Returns the sample at which a crossing starts.
fn start_sample(crossing: &PathCrossing, both: [&RoadUserTrack; 2], dt_s: f64) -> Option<usize> {
    // The later of both, so that neither limit is exceeded.
    let from_s = (crossing.leave_s - LEAVES_AFTER_S).max(crossing.enter_s - ENTERS_AFTER_S);
    let from = (from_s.max(0.0) / dt_s).ceil() as usize;
    let first = both.iter().map(|it| it.first_sample).max()?.max(from);
    let last = both.iter().map(|it| it.end_sample()).min()?;
    let is_early = first as f64 * dt_s + LEAST_LEAVES_AFTER_S <= crossing.leave_s;
    (is_early && first < last).then_some(first)
}

/// Returns the mean speed along a path up to a point, or to its end.
///
/// An ego with this speed arrives when the replaced road user did. It is 2 m/s or more.
fn mean_mps(path: &PlacedPath, point_m: [f64; 2], dt_s: f64) -> f64 {
    let at_m = path.road.place(point_m).s_m;
    let first_m = path.s_m[0];
    let last = path.s_m.len() - 1;
    // A vehicle that turns off or stops before the place never reaches it.
    let reached = path.s_m.iter().position(|s| at_m <= *s).unwrap_or(last);
    let mean_mps = (path.s_m[reached] - first_m) / (reached.max(1) as f64 * dt_s);
    mean_mps.max(LEAST_DESIRED_MPS)
}

/// Returns the time until which the planned road user must be recorded.
fn passed_s(crossing: &PathCrossing, other: usize, length_m: f64) -> f64 {
    if other == crossing.first {
        crossing.leave_s + PASSED_S
    } else {
        // It has entered, and its own length follows at a walk or faster.
        crossing.enter_s + PASSED_S + (0.2 * length_m).min(PASSED_S)
    }
}

/// Returns the least speed of a plan while its body is on the crossing.
fn least_mps(roads: &CrossingRoads, body: StockBody, speed: &SpeedPlan, point_m: [f64; 2]) -> f64 {
    let at_m = roads.other.place(point_m).s_m;
    let reach_m = roads.reach_m(body, StockBody::EGO);
    let last = speed.to_mps.len() as f64 * PIECE_S;
    // Steps of 0.1 s, in which no body drives past a crossing.
    let steps = (last / 0.1).round() as usize;
    let from_m = roads.other_s_m - speed.start_m;
    let mut least_mps = f64::INFINITY;
    for i in 0..steps {
        let time_s = 0.1 * i as f64;
        let front_m = from_m + speed.position_m(time_s);
        let is_there = (at_m - reach_m..at_m + reach_m + body.length_m).contains(&front_m);
        if is_there {
            let way_m = speed.position_m(time_s + 0.1) - speed.position_m(time_s);
            least_mps = least_mps.min(way_m / 0.1);
        }
    }
    // A plan that never is on the crossing has no least speed there.
    if least_mps.is_finite() {
        least_mps
    } else {
        0.0
    }
}
