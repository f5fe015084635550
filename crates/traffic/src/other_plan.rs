//! Further road users around a recorded situation, as scripted traffic.

use crate::analysis::Analysis;
use crate::crossing_roads::PlacedPath;
use crate::crossings::clearance_m;
use crate::plan::{PIECE_S, SpeedPlan};
use crate::recording::RoadUserTrack;
use crate::road_fit::FittedRoad;
use crate::situations::WINDOW_S;
use crate::stock_body::StockBody;

/// Greatest distance from the ego at the start in metres.
const NEAR_M: f64 = 150.0;
/// Clearance from every other body at the start in metres.
const CLEAR_M: f64 = 0.5;
/// Distance below which a road user stands.
const STANDING_M: f64 = 1.0;
/// Half of the strip behind the ego in which a road user would hit an ego that brakes.
const BEHIND_M: f64 = 2.0;

/// Recorded road user beside the two of a situation.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct OtherPlan {
    /// Identity in the recording.
    pub id: String,
    /// Stock body that is nearest to it.
    pub body: StockBody,
    /// Its path in the frame of the recording.
    pub road: FittedRoad,
    /// Front along its road at the start.
    pub s_m: f64,
    /// Motion along its road, `None` if it stands.
    pub speed: Option<SpeedPlan>,
}

impl OtherPlan {
    /// Returns the plans of the road users nearest to the ego, at most `most`.
    ///
    /// `tracks` are those of the ego and of the ado. Road users behind the ego in its path
    /// are left out, because they would hit an ego that brakes. So are those that are
    /// interpolated at the start, touch a body there, or move as no plan does.
    pub(crate) fn nearest(
        analysis: &Analysis,
        tracks: [usize; 2],
        sample: usize,
        most: usize,
    ) -> Vec<OtherPlan> {
        let recording = &analysis.recording;
        let [own, ado] = tracks.map(|i| &recording.tracks[i]);
        let at = |track: &RoadUserTrack| {
            let at = sample.checked_sub(track.first_sample)?;
            (at < track.len()).then_some(at)
        };
        let Some(own_at) = at(own) else {
            return Vec::new();
        };
        let far_m = |track: &RoadUserTrack, i: usize| {
            libm::hypot(
                track.x_m[i] - own.x_m[own_at],
                track.y_m[i] - own.y_m[own_at],
            )
        };
        // Long holes split a road user into tracks of the same identity.
        let is_other = |i: &usize| {
            let id = &recording.tracks[*i].id;
            *id != own.id && *id != ado.id
        };
        let mut near: Vec<(f64, &RoadUserTrack, usize)> = (0..recording.tracks.len())
            .filter(is_other)
            .filter_map(|i| {
                let track = &recording.tracks[i];
                let i = at(track)?;
                Some((far_m(track, i), track, i))
            })
            .filter(|it| {
                it.0 < NEAR_M && !it.1.filled[it.2] && !is_behind((own, own_at), (it.1, it.2))
            })
            .collect();
        // Stable, so that equal distances keep the order of the tracks.
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Further road users must not overlap the two of the situation.
        let mut placed: Vec<(&RoadUserTrack, usize)> = vec![(own, own_at)];
        placed.extend(at(ado).map(|i| (ado, i)));
        let mut plans = Vec::new();
        for (_, track, i) in near {
            if most <= plans.len() {
                break;
            }
            let is_clear = |it: &(&RoadUserTrack, usize)| clearance_m(*it, (track, i)) >= CLEAR_M;
            if !placed.iter().all(is_clear) {
                continue;
            }
            // A road user without a plan takes no place away from the next
            // one.
            if let Some(plan) = OtherPlan::of(track, i, recording.dt_s) {
                placed.push((track, i));
                plans.push(plan);
            }
        }
        plans
    }

    /// Fits the motion from a sample on, for at most 10 s.
    ///
    /// Returns `None` if the path is no road, or no plan repeats the motion.
    fn of(track: &RoadUserTrack, at: usize, dt_s: f64) -> Option<OtherPlan> {
        let body = StockBody::of(track);
        let window = (WINDOW_S / dt_s).round() as usize + 1;
        let end = (at + window).min(track.len());
        let points = body.points_m(track, at..end);
        let motion = RecordedMotion::fit(&points, track.heading_rad[at], dt_s)?;
        let start_mps = motion.speed.as_ref().map(|it| it.start_mps);
        // World files refuse a faster start of such a body.
        let is_fast = body.most_mps().zip(start_mps);
        (!is_fast.is_some_and(|(most, start)| most < start)).then(|| OtherPlan {
            id: track.id.clone(),
            body,
            s_m: motion.s_m + body.lever_m(),
            road: motion.road,
            speed: motion.speed,
        })
    }
}

/// Recorded motion of a point, as a plan along a path.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedMotion {
    /// Path in the frame of the points.
    pub road: FittedRoad,
    /// Point along its road at the start.
    pub s_m: f64,
    /// Motion along its road, `None` if the point stands.
    pub speed: Option<SpeedPlan>,
}

impl RecordedMotion {
    /// Fits a path and a plan to points that are `dt_s` apart.
    ///
    /// A point that stands has a straight path with the heading. Returns `None` if the path
    /// is no road, or no plan repeats the motion.
    pub fn fit(points_m: &[[f64; 2]], heading_rad: f64, dt_s: f64) -> Option<RecordedMotion> {
        let first_m = *points_m.first()?;
        let far = |it: &[f64; 2]| libm::hypot(it[0] - first_m[0], it[1] - first_m[1]);
        let way_m = points_m.iter().map(far).fold(0.0, f64::max);
        // Noise alone has no direction, so a standing road user needs no fitted path.
        if way_m < STANDING_M {
            return Some(RecordedMotion {
                road: FittedRoad::straight(first_m, heading_rad),
                s_m: 0.0,
                speed: None,
            });
        }
        let path = PlacedPath::through(points_m)?;
        let least = (PIECE_S / dt_s).round() as usize;
        let speed = (least < path.s_m.len()).then(|| SpeedPlan::fit(&path.s_m, dt_s))??;
        speed.repeats().then(|| RecordedMotion {
            s_m: path.s_m[0] + speed.start_m,
            road: path.road,
            speed: Some(speed),
        })
    }
}

/// Returns true if a road user is behind the ego in its path, heading as it does.
fn is_behind(own: (&RoadUserTrack, usize), other: (&RoadUserTrack, usize)) -> bool {
    let ((own, i), (other, k)) = (own, other);
    let (sin, cos) = libm::sincos(own.heading_rad[i]);
    let (dx, dy) = (other.x_m[k] - own.x_m[i], other.y_m[k] - own.y_m[i]);
    let (ahead_m, left_m) = (cos * dx + sin * dy, cos * dy - sin * dx);
    let along = libm::cos(other.heading_rad[k] - own.heading_rad[i]);
    // The strip widens with the distance, because a heading is inexact.
    ahead_m < 0.0 && left_m.abs() < BEHIND_M + 0.03 * ahead_m.abs() && along > 0.5
}
