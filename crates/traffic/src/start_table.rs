//! Share of followed time by time gap and closing speed, counted in recordings.

use brakecheck_driver_model::StartTable;

use crate::analysis::Analysis;

/// Counts the followed samples of recordings, without interpolated ones.
pub fn start_table(analyses: &[Analysis]) -> StartTable {
    let time_gaps_s: Vec<f64> = (1..=20).map(|i| 0.2 * f64::from(i)).collect();
    let closings_mps: Vec<f64> = (-4..=15).map(f64::from).collect();
    let mut counts = vec![vec![0_usize; closings_mps.len()]; time_gaps_s.len()];
    let (mut all, mut followers, mut hours) = (0_usize, 0, 0.0);
    for analysis in analyses {
        for (track, leads) in analysis.recording.tracks.iter().zip(&analysis.leads.of) {
            let mut seen = 0_usize;
            for (i, lead) in leads.iter().enumerate() {
                // Negative gaps and interpolated samples are artefacts of the
                // recorder.
                let Some(lead) = lead.filter(|it| it.gap_m >= 0.0 && !track.filled[i]) else {
                    continue;
                };
                seen += 1;
                // A standing follower has a finite time gap.
                let time_gap_s = lead.gap_m / track.speed_mps[i].max(0.1);
                let gap = time_gaps_s.partition_point(|it| *it < time_gap_s);
                // Number of closing speeds at or below the recorded one.
                let closing = closings_mps.partition_point(|it| *it <= lead.closing_mps);
                // Samples beyond the table count in `all`, so that its shares
                // are of all followed time.
                if let (Some(row), Some(at)) = (counts.get_mut(gap), closing.checked_sub(1)) {
                    row[at] += 1;
                }
            }
            all += seen;
            followers += usize::from(seen > 0);
            hours += seen as f64 * analysis.recording.dt_s / 3600.0;
        }
    }
    StartTable {
        shares: cumulated(counts, all),
        time_gaps_s,
        closings_mps,
        followers,
        hours,
    }
}

/// Sums over smaller time gaps and larger closing speeds.
fn cumulated(counts: Vec<Vec<usize>>, all: usize) -> Vec<Vec<f64>> {
    let mut sums: Vec<Vec<usize>> = counts;
    for row in &mut sums {
        for at in (0..row.len().saturating_sub(1)).rev() {
            row[at] += row[at + 1];
        }
    }
    // After the rows, so that a cell sums a whole rectangle of the table.
    for gap in 1..sums.len() {
        for at in 0..sums[gap].len() {
            sums[gap][at] += sums[gap - 1][at];
        }
    }
    let share = |count: usize| count as f64 / all.max(1) as f64;
    sums.into_iter()
        .map(|row| row.into_iter().map(share).collect())
        .collect()
}
