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
    let step = DECISION_S / recording.dt_s;
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
            let speeds_mps = resampled(&own.speed_mps[range], step);
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

/// Returns the values of a series at every multiple of a step, in samples.
fn resampled(series: &[f64], step: f64) -> Vec<f64> {
    let last = series.len().saturating_sub(1) as f64;
    // A hundredth of a sample forgives rounding of the sample time.
    let count = ((last + 0.01) / step).floor() as usize + 1;
    let at = |index: usize| {
        let place = (index as f64 * step).min(last);
        let (before, after) = (
            series[place.floor() as usize],
            series[place.ceil() as usize],
        );
        // At 25 Hz every second half second lies between two samples.
        let share = place - place.floor();
        if share.min(1.0 - share) < 0.01 {
            series[place.round() as usize]
        } else {
            before + share * (after - before)
        }
    };
    (0..count).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_half_a_second_apart_at_any_rate() {
        // 2 m/s² for 4 s: 1 m/s per half second.
        for rate_hz in [10.0, 25.0, 5.0, 29.97, 100.0] {
            let count = (4.0 * rate_hz) as usize + 1;
            let speeds: Vec<f64> = (0..count).map(|i| 2.0 * i as f64 / rate_hz).collect();
            let found = resampled(&speeds, DECISION_S * rate_hz);
            assert!((8..=9).contains(&found.len()), "{rate_hz} Hz: {found:?}");
            for (index, speed) in found.iter().enumerate() {
                assert!(
                    (speed - index as f64).abs() < 1e-3,
                    "{rate_hz} Hz: {found:?}"
                );
            }
        }
        assert_eq!(resampled(&[1.0, 2.0, 3.0, 4.0], 2.0), [1.0, 3.0]);
    }
}
