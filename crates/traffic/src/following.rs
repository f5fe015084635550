//! The vehicle ahead of every vehicle, at every sample.

use crate::lane_frame::LaneFrame;
use crate::recording::{Class, TrafficRecording};

/// Greatest gap at which a vehicle ahead counts as the lead.
pub const LEAD_GAP_M: f64 = 120.0;

/// Greatest time to collision that is reported.
pub const TTC_MAX_S: f64 = 100.0;

/// Vehicle ahead in the same lane at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lead {
    /// Position of its track in the recording.
    pub track: usize,
    /// Clearance along the line in metres. It is negative where boxes overlap.
    pub gap_m: f64,
    /// Speed of the follower minus that of the lead.
    pub closing_mps: f64,
}

impl Lead {
    /// Returns the time to collision in seconds, at most 100.
    pub fn ttc_s(&self) -> f64 {
        if self.closing_mps <= 0.0 {
            return TTC_MAX_S;
        }
        (self.gap_m / self.closing_mps).clamp(0.0, TTC_MAX_S)
    }

    /// Returns the constant deceleration that avoids the contact, in m/s².
    ///
    /// It is 0 if the gap does not shrink, and infinite without a gap.
    pub fn needed_mps2(&self) -> f64 {
        brakecheck_driver_model::needed_mps2(self.gap_m, self.closing_mps)
    }
}

/// Leads of all tracks, a value per sample of the track.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Leads {
    /// Lead per track and sample.
    pub of: Vec<Vec<Option<Lead>>>,
}

impl Leads {
    /// Finds the nearest vehicle ahead in the lane, up to a gap of 120 m.
    pub fn find(recording: &TrafficRecording, frame: &LaneFrame) -> Leads {
        let empty = |track: &crate::RoadUserTrack| vec![None; track.len()];
        let mut of: Vec<Vec<Option<Lead>>> = recording.tracks.iter().map(empty).collect();
        let mut by_start: Vec<usize> = (0..recording.tracks.len())
            .filter(|i| frame.tracks[*i].is_some())
            .collect();
        by_start.sort_by_key(|i| recording.tracks[*i].first_sample);
        let (mut next, mut active): (usize, Vec<usize>) = (0, Vec::new());
        // (carriageway, lane, front bumper, track), sorted per sample.
        let mut row: Vec<(usize, u8, f64, usize)> = Vec::new();
        for sample in 0..recording.samples() {
            while let Some(i) = by_start.get(next) {
                if sample < recording.tracks[*i].first_sample {
                    break;
                }
                active.push(*i);
                next += 1;
            }
            active.retain(|i| sample < recording.tracks[*i].end_sample());
            row.clear();
            for i in &active {
                let at = sample - recording.tracks[*i].first_sample;
                let Some(placed) = &frame.tracks[*i] else {
                    continue;
                };
                if let Some(lane) = placed.lane[at] {
                    row.push((placed.carriageway, lane, placed.s_m[at], *i));
                }
            }
            row.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
            for pair in row.windows(2) {
                let (own, lead) = (pair[0], pair[1]);
                let gap_m = lead.2 - recording.tracks[lead.3].length_m - own.2;
                let is_towed = recording.tracks[own.3].class == Class::Trailer;
                if is_towed || (own.0, own.1) != (lead.0, lead.1) || LEAD_GAP_M < gap_m {
                    continue;
                }
                let speed = |i: usize| {
                    let track = &recording.tracks[i];
                    track.speed_mps[sample - track.first_sample]
                };
                of[own.3][sample - recording.tracks[own.3].first_sample] = Some(Lead {
                    track: lead.3,
                    gap_m,
                    closing_mps: speed(own.3) - speed(lead.3),
                });
            }
        }
        Leads { of }
    }
}
