//! Situations in a recording: followings, lane changes and cut-ins.

use brakecheck_driver_model::CUT_IN_GAP_M;

use crate::following::Leads;
use crate::lane_frame::LaneFrame;
use crate::lead::Lead;
use crate::recording::{Class, TrafficRecording};

/// Shortest following that counts, and the length of its windows, in seconds.
pub const WINDOW_S: f64 = 10.0;

/// Time for which the follower of a cut-in has been in its lane.
const IN_LANE_BEFORE_S: f64 = 1.0;

/// Kind of recorded situations that become worlds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SituationKind {
    /// Windows of 10 s in which a vehicle follows the same lead.
    Following,
    /// Lane changes in front of a follower.
    CutIn,
    /// Paths that cross within a post-encroachment time of 10 s.
    Crossing,
}

/// Unbroken stretch in which a vehicle has the same lead.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedFollowing {
    /// Track of the follower.
    pub follower: usize,
    /// Track of the lead.
    pub lead: usize,
    /// First sample of the recording.
    pub first_sample: usize,
    /// Number of samples.
    pub samples: usize,
    /// Samples with a negative gap, an artefact of the recorder.
    pub overlaps: usize,
}

/// Change of a vehicle from one lane to a neighbouring one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LaneChange {
    /// Track of the vehicle.
    pub track: usize,
    /// First sample of the recording in the new lane.
    pub sample: usize,
    /// Lane before.
    pub from: u8,
    /// Lane after.
    pub to: u8,
}

/// Lane change in front of a follower.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedCutIn {
    /// The lane change.
    pub change: LaneChange,
    /// Track of the follower.
    pub follower: usize,
    /// State of the follower at the line, with the changing vehicle as its lead.
    pub at_line: Lead,
    /// Lateral speed at the line in m/s, always positive.
    pub lateral_mps: f64,
    /// True if the state of either vehicle at the line is interpolated.
    pub is_filled: bool,
}

/// Situations of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Situations {
    /// All followings, however short.
    pub followings: Vec<RecordedFollowing>,
    /// Lane changes that last.
    pub lane_changes: Vec<LaneChange>,
    /// Cut-ins within 100 m of a follower. Those with a negative gap are left out.
    pub cut_ins: Vec<RecordedCutIn>,
    /// Cut-ins left out for a negative gap.
    pub overlapping_cut_ins: usize,
}

impl Situations {
    /// Finds the situations of a recording.
    pub fn find(recording: &TrafficRecording, frame: &LaneFrame, leads: &Leads) -> Situations {
        let mut found = Situations {
            followings: followings(recording, leads),
            lane_changes: lane_changes(recording, frame),
            ..Situations::default()
        };
        for change in &found.lane_changes {
            match cut_in(recording, frame, leads, change) {
                Some(cut_in) if cut_in.at_line.gap_m < 0.0 => found.overlapping_cut_ins += 1,
                Some(cut_in) => found.cut_ins.push(cut_in),
                None => {}
            }
        }
        found
    }

    /// Returns the followings of at least 10 s without a negative gap.
    pub fn long_followings(
        &self,
        recording: &TrafficRecording,
    ) -> impl Iterator<Item = &RecordedFollowing> {
        let least = window_samples(recording);
        // Overlapping boxes make the gap of the whole following doubtful.
        let is_long = move |it: &&RecordedFollowing| least <= it.samples && it.overlaps == 0;
        self.followings.iter().filter(is_long)
    }

    /// Returns the separate windows of 10 s in all followings.
    pub fn windows(&self, recording: &TrafficRecording) -> Vec<RecordedFollowing> {
        let length = window_samples(recording);
        let windows = |it: &RecordedFollowing| {
            let it = *it;
            // The rest at the end is shorter than a window and is dropped.
            (0..it.samples / length).map(move |i| RecordedFollowing {
                first_sample: it.first_sample + i * length,
                samples: length,
                ..it
            })
        };
        self.long_followings(recording).flat_map(windows).collect()
    }
}

fn window_samples(recording: &TrafficRecording) -> usize {
    ((WINDOW_S / recording.dt_s).round() as usize).max(1)
}

fn followings(recording: &TrafficRecording, leads: &Leads) -> Vec<RecordedFollowing> {
    let mut all = Vec::new();
    for (follower, leads) in leads.of.iter().enumerate() {
        let first_sample = recording.tracks[follower].first_sample;
        let mut at = 0;
        let same =
            |a: &Option<Lead>, b: &Option<Lead>| a.map(|it| it.track) == b.map(|it| it.track);
        // `None` forms stretches, too, so that `at` counts every sample.
        for stretch in leads.chunk_by(same) {
            if let Some(lead) = stretch[0] {
                let is_overlap = |it: &&Lead| it.gap_m < 0.0;
                all.push(RecordedFollowing {
                    follower,
                    lead: lead.track,
                    first_sample: first_sample + at,
                    samples: stretch.len(),
                    overlaps: stretch.iter().flatten().filter(is_overlap).count(),
                });
            }
            at += stretch.len();
        }
    }
    all
}

/// Returns the changes after which a vehicle stays for half a second.
fn lane_changes(recording: &TrafficRecording, frame: &LaneFrame) -> Vec<LaneChange> {
    let stay = ((0.5 / recording.dt_s).round() as usize).max(1);
    let mut all = Vec::new();
    for (track, placed) in frame.tracks.iter().enumerate() {
        let Some(placed) = placed else { continue };
        // It follows the vehicle that pulls it.
        if recording.tracks[track].class == Class::Trailer {
            continue;
        }
        let mut current: Option<u8> = None;
        let mut at = 0;
        for stretch in placed.lane.chunk_by(|a, b| a == b) {
            // A shorter stay is noise at the line, and `current` stays as it
            // is.
            let long = stay <= stretch.len();
            if let (Some(to), true) = (stretch[0], long) {
                if let Some(from) = current.filter(|from| *from != to) {
                    all.push(LaneChange {
                        track,
                        sample: recording.tracks[track].first_sample + at,
                        from,
                        to,
                    });
                }
                current = Some(to);
            }
            at += stretch.len();
        }
    }
    all
}

fn cut_in(
    recording: &TrafficRecording,
    frame: &LaneFrame,
    leads: &Leads,
    change: &LaneChange,
) -> Option<RecordedCutIn> {
    let before = (IN_LANE_BEFORE_S / recording.dt_s).round() as usize;
    let placed = frame.tracks[change.track].as_ref()?;
    let follower = frame.carriageways[placed.carriageway]
        .tracks
        .iter()
        .copied()
        .find(|i| {
            let track = &recording.tracks[*i];
            let (Some(at), Some(there)) = (
                change.sample.checked_sub(track.first_sample),
                &frame.tracks[*i],
            ) else {
                return false;
            };
            let is_behind = leads.of[*i].get(at).copied().flatten();
            // A vehicle that was not in the lane before changed lanes itself.
            let was = || at.checked_sub(before).and_then(|at| there.lane[at]);
            is_behind.is_some_and(|it| it.track == change.track) && was() == Some(change.to)
        })?;
    let behind = &recording.tracks[follower];
    // At the first sample in the new lane, where the changing vehicle first is
    // the lead.
    let at_line = leads.of[follower][change.sample - behind.first_sample]?;
    // So far ahead, the change demands nothing of the follower.
    if at_line.gap_m > CUT_IN_GAP_M {
        return None;
    }
    let at = change.sample - recording.tracks[change.track].first_sample;
    // Half a second on either side, less at the ends of the track.
    let (a, b) = (
        at.saturating_sub(before / 2),
        (at + before / 2).min(placed.lateral_m.len() - 1),
    );
    let across_m = placed.lateral_m[b] - placed.lateral_m[a];
    Some(RecordedCutIn {
        change: *change,
        follower,
        at_line,
        lateral_mps: across_m.abs() / ((b - a).max(1) as f64 * recording.dt_s),
        is_filled: recording.tracks[change.track].filled[at]
            || behind.filled[change.sample - behind.first_sample],
    })
}
