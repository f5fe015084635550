//! Speeds of recorded vehicles every 0.5 s.

use brakecheck_driver_model::{DECISION_S, SpeedSeries};

use crate::lane_frame::LaneFrame;
use crate::recording::{Class, TrafficRecording};

/// Fewest decisions of a stretch that is used.
const LEAST_DECISIONS: usize = 4;

/// Returns the unbroken stretches of all vehicles on a carriageway.
///
/// Interpolated samples break a stretch, because the recorder smoothed them.
pub fn speed_series(recording: &TrafficRecording, frame: &LaneFrame) -> Vec<SpeedSeries> {
    let step = ((DECISION_S / recording.dt_s).round() as usize).max(1);
    let mut all = Vec::new();
    for (track, placed) in frame.tracks.iter().enumerate() {
        let Some(placed) = placed else { continue };
        let own = &recording.tracks[track];
        // A trailer has no driver.
        if own.class == Class::Trailer {
            continue;
        }
        let mut at = 0;
        for stretch in own.filled.chunk_by(|a, b| a == b) {
            let range = at..at + stretch.len();
            at = range.end;
            // `filled` is constant within a stretch.
            if stretch[0] {
                continue;
            }
            let speeds_mps: Vec<f64> = own.speed_mps[range].iter().step_by(step).copied().collect();
            if speeds_mps.len() > LEAST_DECISIONS {
                all.push(SpeedSeries {
                    track,
                    carriageway: placed.carriageway,
                    speeds_mps,
                });
            }
        }
    }
    all
}
