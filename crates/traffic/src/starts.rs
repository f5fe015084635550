//! Share of followed time by time gap and closing speed.

use serde::{Deserialize, Serialize};

use crate::analysis::Analysis;

/// State of a follower at the start of a test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StartState {
    /// Speed of the follower in m/s.
    pub speed_mps: f64,
    /// Clearance to the vehicle ahead in metres.
    pub gap_m: f64,
    /// Speed of the follower minus that of the vehicle ahead, in m/s.
    pub closing_mps: f64,
}

impl StartState {
    /// Returns the clearance over the own speed, in seconds.
    pub fn time_gap_s(&self) -> f64 {
        self.gap_m / self.speed_mps.max(0.1)
    }
}

/// Shares of followed time, at most a time gap and at least a closing speed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartTable {
    /// Time gaps in seconds, ascending.
    pub time_gaps_s: Vec<f64>,
    /// Closing speeds in m/s, ascending.
    pub closings_mps: Vec<f64>,
    /// Share of samples per time gap and closing speed.
    pub shares: Vec<Vec<f64>>,
    /// Number of followers, the independent observations.
    pub followers: usize,
    /// Followed time in hours.
    pub hours: f64,
}

/// Share of followed time that is at least as tight as a start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StartRarity {
    /// Share of followed time.
    pub share: f64,
    /// Upper bound by the rule of three over followers, if the share is 0.
    pub at_most: Option<f64>,
}

impl StartTable {
    /// Counts the followed samples of recordings, without interpolated ones.
    pub fn fit(analyses: &[Analysis]) -> StartTable {
        let time_gaps_s: Vec<f64> = (1..=20).map(|i| 0.2 * f64::from(i)).collect();
        let closings_mps: Vec<f64> = (-4..=15).map(f64::from).collect();
        let mut counts = vec![vec![0_usize; closings_mps.len()]; time_gaps_s.len()];
        let (mut all, mut followers, mut hours) = (0_usize, 0, 0.0);
        for analysis in analyses {
            for (track, leads) in analysis.recording.tracks.iter().zip(&analysis.leads.of) {
                let mut seen = 0_usize;
                for (i, lead) in leads.iter().enumerate() {
                    let Some(lead) = lead.filter(|it| 0.0 <= it.gap_m && !track.filled[i]) else {
                        continue;
                    };
                    seen += 1;
                    let time_gap_s = lead.gap_m / track.speed_mps[i].max(0.1);
                    let gap = time_gaps_s.partition_point(|it| *it < time_gap_s);
                    // Number of closing speeds at or below the recorded one.
                    let closing = closings_mps.partition_point(|it| *it <= lead.closing_mps);
                    if let (Some(row), Some(at)) = (counts.get_mut(gap), closing.checked_sub(1)) {
                        row[at] += 1;
                    }
                }
                all += seen;
                followers += usize::from(0 < seen);
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

    /// Returns the share of followed time at least as tight as a start.
    ///
    /// It is read at the next larger time gap and the next smaller closing speed, so it
    /// is an upper bound. Time gaps beyond the table are everyday: the share is 1.
    pub fn rarity_of(&self, start: &StartState) -> StartRarity {
        let time_gap_s = start.time_gap_s();
        let gap = self
            .time_gaps_s
            .partition_point(|it| *it < time_gap_s - 1e-9);
        let closing = self
            .closings_mps
            .partition_point(|it| *it <= start.closing_mps + 1e-9);
        let Some(row) = self.shares.get(gap) else {
            return StartRarity {
                share: 1.0,
                at_most: None,
            };
        };
        // Below the least closing speed, the share of the time gap alone is not listed.
        let share = row.get(closing.saturating_sub(1)).copied().unwrap_or(1.0);
        StartRarity {
            share,
            at_most: (share == 0.0).then(|| 3.0 / self.followers.max(1) as f64),
        }
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
