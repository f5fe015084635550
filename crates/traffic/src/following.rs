//! The vehicle ahead of every vehicle, at every sample.

use crate::lane_frame::LaneFrame;
use crate::lead::{LEAD_GAP_M, Lead};
use crate::path_leads::OwnPath;
use crate::recording::{Class, TrafficRecording};

/// Leads of all tracks, a value per sample of the track.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Leads {
    /// Lead in the lane per track and sample.
    pub of: Vec<Vec<Option<Lead>>>,
    /// Lead along the own path, only of motor vehicles without lanes.
    pub by_path: Vec<Vec<Option<Lead>>>,
}

impl Leads {
    /// Returns the leads of a track: in its lane, or along its path without lanes.
    pub fn of_track(&self, track: usize) -> &[Option<Lead>] {
        match self.by_path.get(track) {
            Some(leads) if !leads.is_empty() => leads,
            _ => &self.of[track],
        }
    }

    /// Finds the leads along the paths of motor vehicles without lanes.
    fn find_by_path(recording: &TrafficRecording, frame: &LaneFrame) -> Vec<Vec<Option<Lead>>> {
        let tracks = recording.tracks.iter().enumerate();
        let leads = tracks.map(|(i, track)| {
            if frame.tracks[i].is_some() || !track.class.is_motor_vehicle() {
                return Vec::new();
            }
            OwnPath::of(track).map_or_else(Vec::new, |path| path.leads(recording, i))
        });
        leads.collect()
    }

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
            // A sweep over time: only the vehicles that are there are sorted
            // per sample.
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
            // From back to front within a lane, so that neighbours are
            // follower and lead.
            row.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
            for pair in row.windows(2) {
                let (own, lead) = (pair[0], pair[1]);
                let gap_m = lead.2 - recording.tracks[lead.3].length_m - own.2;
                let is_towed = recording.tracks[own.3].class == Class::Trailer;
                if is_towed || (own.0, own.1) != (lead.0, lead.1) || gap_m > LEAD_GAP_M {
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
        Leads {
            of,
            by_path: Leads::find_by_path(recording, frame),
        }
    }
}
