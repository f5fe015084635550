//! Share of followed time by time gap and closing speed.

use serde::{Deserialize, Serialize};

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
        // As in the counts of recordings, so that a standing follower has a
        // finite time gap.
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
    /// Returns the share of followed time at least as tight as a start.
    ///
    /// It is read at the next larger time gap and the next smaller closing speed, so it
    /// is an upper bound. Time gaps beyond the table are everyday: the share is 1.
    pub fn rarity_of(&self, start: &StartState) -> StartRarity {
        let time_gap_s = start.time_gap_s();
        // The tolerances are those of values on the grid itself, which
        // rounding moves off it.
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
