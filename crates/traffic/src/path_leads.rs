//! The vehicle ahead along a vehicle's own path, where there are no lanes.

use std::f64::consts::FRAC_PI_3;

use crate::lead::{LEAD_GAP_M, Lead};
use crate::path::{Path, PathPlace};
use crate::raw::wrapped;
use crate::recording::{RoadUserTrack, TrafficRecording};

/// Distance of the points of a path in metres.
const STEP_M: f64 = 1.0;

/// Motion of a vehicle along its own path, a value per sample.
pub(crate) struct OwnPath {
    path: Path,
    places: Vec<PathPlace>,
}

impl OwnPath {
    /// Returns the path of the box centre, straight ahead of a standing vehicle.
    pub(crate) fn of(track: &RoadUserTrack) -> Option<OwnPath> {
        let points = || track.x_m.iter().zip(&track.y_m).map(|(x, y)| [*x, *y]);
        let ahead = || {
            let (sin, cos) = libm::sincos(*track.heading_rad.first()?);
            let [x, y] = points().next()?;
            Path::through([[x, y], [x + STEP_M * cos, y + STEP_M * sin]], 0.5 * STEP_M)
        };
        // A standing vehicle has no path, but a vehicle ahead of it matters.
        let path = Path::through(points(), STEP_M).or_else(ahead)?;
        let mut piece = 0;
        let place = |point: [f64; 2]| {
            let place = path.place(point, piece);
            piece = place.piece;
            place
        };
        let places = points().map(place).collect();
        Some(OwnPath { path, places })
    }

    /// Returns the front bumper along the path in metres.
    pub(crate) fn front_m(&self, track: &RoadUserTrack) -> Vec<f64> {
        let front = |it: &PathPlace| it.s_m + 0.5 * track.length_m;
        self.places.iter().map(front).collect()
    }

    /// Returns the nearest vehicle on the strip that the vehicle sweeps, per sample.
    ///
    /// It heads the same way within 60°, up to a gap of 120 m.
    pub(crate) fn leads(&self, recording: &TrafficRecording, own: usize) -> Vec<Option<Lead>> {
        let track = &recording.tracks[own];
        let is_together = |i: &usize| {
            let other = &recording.tracks[*i];
            let overlaps =
                other.first_sample < track.end_sample() && track.first_sample < other.end_sample();
            *i != own && other.class.is_in_lanes() && overlaps
        };
        // Collected once per vehicle, since the samples below share it.
        let others: Vec<usize> = (0..recording.tracks.len()).filter(is_together).collect();
        let lead_at = |at: usize| {
            let sample = track.first_sample + at;
            let gaps = others.iter().filter_map(|i| {
                let other = &recording.tracks[*i];
                let there = sample.checked_sub(other.first_sample)?;
                (there < other.len()).then_some(())?;
                let gap_m = self.gap_m((track, at), (other, there))?;
                Some(Lead {
                    track: *i,
                    gap_m,
                    closing_mps: track.speed_mps[at] - other.speed_mps[there],
                })
            });
            gaps.min_by(|a, b| a.gap_m.total_cmp(&b.gap_m))
        };
        (0..track.len()).map(lead_at).collect()
    }

    /// Returns the clearance to a vehicle ahead, `None` if it is elsewhere.
    fn gap_m(&self, own: (&RoadUserTrack, usize), other: (&RoadUserTrack, usize)) -> Option<f64> {
        let ((own, at), (other, there)) = (own, other);
        let (x, y) = (other.x_m[there], other.y_m[there]);
        let reach_m = LEAD_GAP_M + 0.5 * (own.length_m + other.length_m);
        let away_m = libm::hypot(x - own.x_m[at], y - own.y_m[at]);
        // Cheap and before the projection, because most vehicles are far away.
        if away_m > reach_m {
            return None;
        }
        let here = self.places[at];
        let place = self.path.place([x, y], here.piece);
        let [ux, uy] = self.path.direction(place.piece);
        let turned_rad = wrapped(other.heading_rad[there] - libm::atan2(uy, ux)).abs();
        let (sin, cos) = libm::sincos(turned_rad);
        // Half the width of the strip and half the extent of the other box
        // across it.
        let side_m = 0.5 * (own.width_m + other.width_m * cos.abs() + other.length_m * sin.abs());
        let is_on_strip = place.lateral_m.abs() < side_m && turned_rad < FRAC_PI_3;
        let gap_m = place.s_m - here.s_m - 0.5 * (own.length_m + other.length_m);
        // Its centre is ahead, even if the boxes overlap.
        (is_on_strip && place.s_m > here.s_m && gap_m <= LEAD_GAP_M).then_some(gap_m)
    }
}
