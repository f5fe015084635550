//! Contents of a recording in numbers.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::analysis::Analysis;
use crate::recording::{Class, ReadCounts};

/// Greatest post-encroachment time of a close crossing in seconds.
const CLOSE_PET_S: f64 = 5.0;

/// Contents of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RecordingSummary {
    /// Corrections made while reading.
    pub counts: ReadCounts,
    /// Road users, each counted once.
    pub road_users: usize,
    /// Duration in seconds.
    pub duration_s: f64,
    /// Sampling period in seconds.
    pub dt_s: f64,
    /// Distance of all road users in kilometres.
    pub distance_km: f64,
    /// Carriageways with their lanes.
    pub carriageways: Vec<CarriagewaySummary>,
    /// Followings of 10 s or more.
    pub followings: usize,
    /// Separate windows of 10 s in them.
    pub windows: usize,
    /// Lane changes.
    pub lane_changes: usize,
    /// Cut-ins within 100 m of a follower.
    pub cut_ins: usize,
    /// Crossing paths by the classes of the two road users.
    pub crossings: Vec<CrossingSummary>,
}

/// Carriageway of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CarriagewaySummary {
    /// Number of vehicles.
    pub vehicles: usize,
    /// Share of rows in no lane.
    pub outside: f64,
    /// Lanes from right to left.
    pub lanes: Vec<LaneSummary>,
}

/// Lane of a carriageway.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LaneSummary {
    /// Offset of its middle from the line in metres, to the left.
    pub offset_m: f64,
    /// Share of the carriageway's rows.
    pub share: f64,
    /// Deviation of its median per 100 m, 95 % quantile in metres.
    pub wander_m: f64,
}

/// Crossing paths of two classes.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CrossingSummary {
    /// Names of the classes.
    pub classes: [&'static str; 2],
    /// Number of pairs whose paths cross.
    pub paths: usize,
    /// Those with a post-encroachment time below 5 s.
    pub pet_below_5_s: usize,
    /// Least post-encroachment time in seconds.
    pub least_pet_s: f64,
    /// Least clearance at one instant in metres.
    pub least_m: Option<f64>,
}

impl Analysis {
    /// Returns the contents of the recording in numbers.
    pub fn summary(&self) -> RecordingSummary {
        let recording = &self.recording;
        let carriageways = self.frame.carriageways.iter().map(|it| CarriagewaySummary {
            vehicles: it.tracks.len(),
            outside: it.outside,
            lanes: it
                .lanes
                .iter()
                .map(|lane| LaneSummary {
                    offset_m: lane.offset_m,
                    share: lane.share,
                    wander_m: lane.wander_m,
                })
                .collect(),
        });
        let found = &self.situations;
        RecordingSummary {
            counts: recording.counts,
            road_users: recording.road_users(),
            duration_s: recording.duration_s(),
            dt_s: recording.dt_s,
            distance_km: recording.distance_km(),
            carriageways: carriageways.collect(),
            followings: found.long_followings(recording).count(),
            windows: found.windows(recording).len(),
            lane_changes: found.lane_changes.len(),
            cut_ins: found.cut_ins.len(),
            crossings: self.crossing_summaries(),
        }
    }

    /// Counts the crossing paths by the classes of the two road users.
    pub fn crossing_summaries(&self) -> Vec<CrossingSummary> {
        let class = |track: usize| self.recording.tracks[track].class;
        // Ordered by the classes, so that tables of equal recordings are
        // equal.
        let mut rows: BTreeMap<[Class; 2], CrossingSummary> = BTreeMap::new();
        for crossing in &self.crossings {
            let (first, second) = (class(crossing.first), class(crossing.second));
            // Sorted, so that the order of passing does not divide a pair of classes.
            let classes = [first.min(second), first.max(second)];
            let row = rows.entry(classes).or_insert(CrossingSummary {
                classes: classes.map(Class::name),
                paths: 0,
                pet_below_5_s: 0,
                least_pet_s: f64::INFINITY,
                least_m: None,
            });
            row.paths += 1;
            row.pet_below_5_s += usize::from(crossing.pet_s() < CLOSE_PET_S);
            row.least_pet_s = row.least_pet_s.min(crossing.pet_s());
            let clearances = row.least_m.into_iter().chain(crossing.least_m);
            row.least_m = clearances.min_by(f64::total_cmp);
        }
        rows.into_values().collect()
    }
}
