//! Recorded situations as plans: the state at the start and the motion after it.

use crate::analysis::Analysis;
use crate::crossing_roads::CrossingRoads;
use crate::lane_change_plan::LaneChangePlan;
use crate::lanes::PlacedTrack;
use crate::other_plan::OtherPlan;
use crate::path::Path;
use crate::plan::{SpeedPlan, rounded};
use crate::recording::RoadUserTrack;
use crate::situations::{RecordedCutIn, RecordedFollowing, WINDOW_S};
use crate::stock_body::StockBody;

/// Time from the start of a planned cut-in to its lane change.
pub const LANE_CHANGE_AT_S: f64 = 2.0;

/// Time before and after the line whose offsets a lane change is fitted to.
const CHANGE_BEFORE_S: f64 = 8.0;
// Both lanes must be seen at rest to fit their offsets.
const CHANGE_AFTER_S: f64 = 8.0;

/// Offsets from the middle of a lane that are in a neighbouring lane, in metres.
const LANE_MIDDLES_M: std::ops::Range<f64> = 2.0..5.5;

/// Greatest offsets from the middle of the ego's lane, after a lane change and of the
/// ego at the start, in metres.
const SAME_LANE_M: f64 = 1.8;
const EGO_LANE_M: f64 = 0.9;

/// Greatest distance from the recorded offsets of a plan that is one lane change.
const ACROSS_M: f64 = 0.5;

/// Least lateral distance of a road user beside the ego.
const BESIDE_M: f64 = 3.2;

/// Clearance along the road at the start that is not beside the ego.
const CLEAR_M: f64 = 0.1;

/// Recorded situation of an ego and a road user that may stray from its recording.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SituationPlan {
    /// Name of the recording.
    pub source: String,
    /// Seconds from the first sample of the recording to the start.
    pub time_s: f64,
    /// Identity of the road user that the ego replaces.
    pub replaced: String,
    /// Identity of the road user with the plan.
    pub planned: String,
    /// Stock body that is nearest to it.
    pub body: StockBody,
    /// Speed of the ego at the start in m/s.
    pub ego_mps: f64,
    /// Distance at the start from the ego's front to the other's rear in metres, and
    /// between the boxes in a crossing.
    pub gap_m: f64,
    /// Motion along the road.
    pub speed: SpeedPlan,
    /// Motion across the road, `None` without a lane change.
    pub across: Option<AcrossPlan>,
    /// Road of the situation.
    pub road: SituationRoad,
    /// Tracks of the replaced and of the planned road user.
    pub tracks: [usize; 2],
    /// Further road users, empty unless they were requested.
    pub others: Vec<OtherPlan>,
    /// Speed that the lead loses, deceleration that a cut-in requires, or the negative
    /// post-encroachment time of a crossing, by which the hardest situation is found.
    pub hardness: f64,
}

/// Road of a recorded situation.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SituationRoad {
    /// Lanes of a carriageway.
    Lanes(LanePlace),
    /// Paths that cross.
    Crossing(Box<CrossingRoads>),
}

/// Place of a situation on the lanes of its recording.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LanePlace {
    /// Position of the carriageway in the frame.
    pub carriageway: usize,
    /// Offset of the middle of the world's right lane from the carriageway's line.
    pub right_lane_m: f64,
    /// Front bumper of the replaced road user along the carriageway's line.
    pub s_m: f64,
    /// Front bumper of the replaced road user in the recording's frame.
    pub front_m: [f64; 2],
}

/// Motion across the road in a cut-in, relative to the middle of the ego's lane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct AcrossPlan {
    /// Lane change, which begins 2 s after the start.
    pub change: LaneChangePlan,
    /// Offset of the replaced road user at the start in metres.
    pub ego_m: f64,
    /// Greatest lateral distance from the recorded box centres in metres.
    pub worst_m: f64,
}

/// Place of a road user along the road, relative to the ego.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordedPlace {
    /// Ahead of the ego's front.
    Ahead,
    /// Beside the ego.
    Beside,
    /// Behind the ego's rear.
    Behind,
}

impl SituationPlan {
    /// Fits a window of a following. The ego replaces the follower.
    ///
    /// Returns `None` if a state at the start is interpolated, a vehicle stands, or the
    /// plan is more than 0.1 m from the recording.
    pub fn following(analysis: &Analysis, window: &RecordedFollowing) -> Option<SituationPlan> {
        let recording = &analysis.recording;
        let pair = RecordedPair::at(analysis, window.follower, window.lead, window.first_sample)?;
        // One more sample, so that the last piece is whole.
        let samples = window.samples + 1;
        let way_m = own_way(pair.other, pair.other_at, samples, recording.dt_s)?;
        // A plan that does not repeat the recording would be evidence of
        // nothing.
        let speed = SpeedPlan::fit(&way_m, recording.dt_s).filter(SpeedPlan::repeats)?;
        let gap_m = analysis.leads.of[window.follower][pair.own_at]?.gap_m;
        let placed = analysis.frame.tracks[window.follower].as_ref()?;
        let lane = usize::from(placed.lane[pair.own_at]?);
        let lanes = &analysis.frame.carriageways[placed.carriageway].lanes;
        let place = pair.lane_place(placed, lanes.get(lane)?.offset_m);
        let mut plan = pair.plan(analysis, gap_m, speed, None, place)?;
        // A following is as hard as its lead brakes.
        plan.hardness = slowing_mps(analysis, window);
        Some(plan)
    }

    /// Fits a cut-in from 2 s before its lane change. The ego replaces the follower.
    ///
    /// Returns `None` if a state at the start is interpolated, the changing vehicle is not
    /// recorded until 10 s after the start, the plan is more than 0.1 m off, or the motion is not a single lane change: it
    /// is 0.5 m off at most, and the follower is in its lane.
    pub fn cut_in(analysis: &Analysis, cut_in: &RecordedCutIn) -> Option<SituationPlan> {
        let (recording, change) = (&analysis.recording, &cut_in.change);
        let dt_s = recording.dt_s;
        let other = &recording.tracks[change.track];
        let placed = analysis.frame.tracks[change.track].as_ref()?;
        let lanes = &analysis.frame.carriageways[placed.carriageway].lanes;
        // A plan has one change to a neighbouring lane, and needs recorded rows.
        if change.from.abs_diff(change.to) != 1 || cut_in.is_filled {
            return None;
        }
        // All offsets count from the lane that the ego drives in.
        let middle_m = lanes.get(usize::from(change.to))?.offset_m;
        let samples = |seconds: f64| (seconds / dt_s).round() as usize;
        let line = change.sample - other.first_sample;
        let from = line.saturating_sub(samples(CHANGE_BEFORE_S));
        // Vehicles often leave the recorded stretch soon after their change.
        let to = (line + samples(CHANGE_AFTER_S)).min(placed.lateral_m.len());
        let offsets: Vec<f64> = placed.lateral_m[from..to]
            .iter()
            .map(|it| it - middle_m)
            .collect();
        let mut shape = LaneChangePlan::fit(&offsets, line - from, dt_s)?;

        // It begins in the neighbouring lane and ends in the ego's.
        if !LANE_MIDDLES_M.contains(&shape.from_m.abs()) || shape.to_m.abs() > SAME_LANE_M {
            return None;
        }

        // A plan moves the rear axle, which follows the box centre along the path.
        let body = StockBody::of(other);
        let behind_m = 0.5 * other.length_m - body.rear_overhang_m;
        let later = behind_m / (other.speed_mps[line].max(1.0) * dt_s);
        let begin = (from + shape.first_sample) as f64 + later.round();
        let at = (begin as usize).checked_sub(samples(LANE_CHANGE_AT_S))?;
        let window = samples(WINDOW_S) + 1;
        let end = at.checked_add(window).filter(|end| *end <= other.len())?;

        // From here on the change is counted from the plan's start.
        shape.first_sample = from + shape.first_sample - at;
        let recorded = placed.lateral_m[at..end].iter().enumerate();
        let off =
            recorded.map(|(i, it)| (it - middle_m - shape.lateral_m(i as f64 * dt_s, dt_s)).abs());
        let worst_m = off.fold(0.0, f64::max);
        // Two changes or an aborted one fit a single change only this badly.
        if worst_m > ACROSS_M {
            return None;
        }
        let mut s_m = own_way(other, at, window, dt_s)?;
        // Along the path of its lane change, a vehicle drives farther than along the
        // road.
        along_the_road(&mut s_m, &shape, dt_s);
        let speed = SpeedPlan::fit(&s_m, dt_s).filter(SpeedPlan::repeats)?;

        let pair = RecordedPair::at(
            analysis,
            cut_in.follower,
            change.track,
            other.first_sample + at,
        )?;
        let follower = analysis.frame.tracks[cut_in.follower].as_ref()?;
        // Places along the carriageway are those of front bumpers, so the
        // length leads to the rear.
        let gap_m = placed.s_m[at] - other.length_m - follower.s_m[pair.own_at];
        let across = AcrossPlan {
            change: shape,
            ego_m: follower.lateral_m[pair.own_at] - middle_m,
            worst_m,
        };
        // The right one of the two lanes that the world has.
        let is_from_left = shape.to_m < shape.from_m;
        let right_lane_m = if is_from_left {
            middle_m
        } else {
            middle_m - LANE_WIDTH_M
        };
        let place = pair.lane_place(follower, right_lane_m);
        let mut plan = pair.plan(analysis, gap_m, speed, Some(across), place)?;
        // At the line the follower learns of the cut-in at the latest.
        plan.hardness = cut_in.at_line.needed_mps2();
        // Bodies that overlap at the start are no situation.
        let is_clear = plan.place() != RecordedPlace::Beside || shape.from_m.abs() >= BESIDE_M;
        (is_clear && across.ego_m.abs() <= EGO_LANE_M).then_some(plan)
    }

    /// Returns the headway from the ego's front to the front of the stock body.
    pub fn headway_m(&self) -> f64 {
        // Rounded as the world file has it, so that `place` decides on the
        // written value.
        rounded(self.gap_m + self.body.length_m)
    }

    /// Returns the place of the stock body at the start, along the road.
    pub fn place(&self) -> RecordedPlace {
        let headway_m = self.headway_m();
        if self.body.length_m + CLEAR_M < headway_m {
            RecordedPlace::Ahead
        } else if headway_m < -StockBody::EGO.length_m - CLEAR_M {
            RecordedPlace::Behind
        } else {
            RecordedPlace::Beside
        }
    }

    /// Returns true if the road user comes from the left of the ego's lane.
    pub fn is_from_left(&self) -> bool {
        self.across
            .is_none_or(|it| it.change.to_m < it.change.from_m)
    }
}

/// Width of the lanes of a generated world in metres.
pub const LANE_WIDTH_M: f64 = 3.75;

/// Two road users at a sample.
struct RecordedPair<'a> {
    tracks: [usize; 2],
    own: &'a RoadUserTrack,
    other: &'a RoadUserTrack,
    own_at: usize,
    other_at: usize,
    sample: usize,
}

impl<'a> RecordedPair<'a> {
    /// Returns `None` if one of them is not there or interpolated.
    fn at(
        analysis: &'a Analysis,
        own: usize,
        other: usize,
        sample: usize,
    ) -> Option<RecordedPair<'a>> {
        let both = [own, other];
        let [own, other] = both.map(|i| &analysis.recording.tracks[i]);
        let own_at = sample.checked_sub(own.first_sample)?;
        let other_at = sample.checked_sub(other.first_sample)?;
        // A start that a recorder made up is no recorded situation.
        let is_filled = *own.filled.get(own_at)? || *other.filled.get(other_at)?;
        (!is_filled).then_some(RecordedPair {
            tracks: both,
            own,
            other,
            own_at,
            other_at,
            sample,
        })
    }

    fn lane_place(&self, placed: &PlacedTrack, right_lane_m: f64) -> LanePlace {
        let (sin, cos) = libm::sincos(self.own.heading_rad[self.own_at]);
        // Positions are box centres, and the state of a vehicle is that of its
        // front bumper.
        let ahead_m = 0.5 * self.own.length_m;
        let (x, y) = (self.own.x_m[self.own_at], self.own.y_m[self.own_at]);
        LanePlace {
            carriageway: placed.carriageway,
            right_lane_m,
            s_m: placed.s_m[self.own_at],
            front_m: [x + ahead_m * cos, y + ahead_m * sin],
        }
    }

    /// Returns a plan that is not yet rated.
    fn plan(
        &self,
        analysis: &Analysis,
        gap_m: f64,
        speed: SpeedPlan,
        across: Option<AcrossPlan>,
        place: LanePlace,
    ) -> Option<SituationPlan> {
        let recording = &analysis.recording;
        let samples = (WINDOW_S / recording.dt_s).round() as usize + 1;
        let own = own_way(self.own, self.own_at, samples, recording.dt_s)?;
        // Only its start is used, so this fit need not repeat the recording.
        let own = SpeedPlan::fit(&own, recording.dt_s)?;
        Some(SituationPlan {
            source: recording.name.clone(),
            time_s: self.sample as f64 * recording.dt_s,
            replaced: self.own.id.clone(),
            planned: self.other.id.clone(),
            body: StockBody::of(self.other),
            ego_mps: own.start_mps,
            // Fitted positions at the start on both sides.
            gap_m: gap_m + speed.start_m - own.start_m,
            speed,
            across,
            road: SituationRoad::Lanes(place),
            tracks: self.tracks,
            others: Vec::new(),
            hardness: 0.0,
        })
    }
}

/// Returns the speed that the lead loses at most within a window, in m/s.
pub(crate) fn slowing_mps(analysis: &Analysis, window: &RecordedFollowing) -> f64 {
    let lead = &analysis.recording.tracks[window.lead];
    let at = window.first_sample - lead.first_sample;
    let (mut lost_mps, mut most_mps) = (0.0, f64::NEG_INFINITY);
    for speed_mps in &lead.speed_mps[at..at + window.samples] {
        most_mps = f64::max(most_mps, *speed_mps);
        lost_mps = f64::max(lost_mps, most_mps - speed_mps);
    }
    lost_mps
}

/// Returns the positions of a road user along its own path.
///
/// Along the right lane's line, a vehicle of the left lane would gain or lose decimetres
/// in a bend. Returns `None` for a road user that hardly moves.
fn own_way(track: &RoadUserTrack, from: usize, samples: usize, dt_s: f64) -> Option<Vec<f64>> {
    let range = from..(from + samples).min(track.len());
    let points = || range.clone().map(|i| [track.x_m[i], track.y_m[i]]);
    // Half seconds apart, so that the noise of positions does not lengthen the path.
    let apart = ((0.5 / dt_s).round() as usize).max(1);
    let thinned = points().step_by(apart).chain(points().next_back());
    let path = Path::through(thinned, 0.5)?;
    // The search goes on from the last piece, which keeps it linear and on the
    // right pass of a loop.
    let mut piece = 0;
    let place = points().map(|point| {
        let place = path.place(point, piece);
        piece = place.piece;
        place.s_m
    });
    Some(place.collect())
}

/// Shortens distances along a path with a lane change to those along the road.
fn along_the_road(s_m: &mut [f64], change: &LaneChangePlan, dt_s: f64) {
    let mut longer_m = 0.0;
    for i in 1..s_m.len() {
        let way_m = s_m[i] - longer_m - s_m[i - 1];
        // The rate in the middle of the step is exact to second order.
        let across_m = change.lateral_mps((i as f64 - 0.5) * dt_s, dt_s) * dt_s;
        // Invariant: a road user that stands does not move across.
        longer_m += way_m - libm::sqrt((way_m * way_m - across_m * across_m).max(0.0));
        s_m[i] -= longer_m;
    }
}
