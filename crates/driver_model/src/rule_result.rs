//! Result of a rule on recorded vehicles.

use serde::Serialize;

/// Result of a rule on a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RuleResult {
    /// Name of the rule.
    pub rule: String,
    /// Rows of all motor vehicles.
    pub rows: usize,
    /// Recorded rows on which the rule has an answer, without interpolated and overlapping
    /// ones.
    ///
    /// Without a vehicle ahead, a rule about it has none.
    pub rows_evaluated: usize,
    /// Recorded rows with a negative robustness, without interpolated and overlapping ones.
    pub rows_broken: usize,
    /// Vehicles with an episode.
    pub vehicles: usize,
    /// Episodes, which are at least 1 s apart within a vehicle.
    pub episodes: usize,
    /// Episodes left out because all of their rows are interpolated or overlap.
    pub doubtful: usize,
    /// Kilometres driven by all vehicles.
    pub distance_km: f64,
    /// Row with the least robustness, `None` without an episode.
    pub worst: Option<WorstRow>,
}

impl RuleResult {
    /// Returns whether any row says that the rule is kept or broken.
    pub fn is_evaluated(&self) -> bool {
        self.rows_evaluated > 0 || self.episodes > 0
    }

    /// Returns the share of rows with a negative robustness.
    pub fn share(&self) -> f64 {
        self.rows_broken as f64 / self.rows.max(1) as f64
    }

    /// Returns the episodes per 1,000 km.
    pub fn per_1000_km(&self) -> f64 {
        1000.0 * self.episodes as f64 / self.distance_km.max(1e-9)
    }

    /// Returns the result with its rates.
    pub fn summary(&self) -> RuleSummary {
        RuleSummary {
            rule: self.rule.clone(),
            rows_evaluated: self.rows_evaluated,
            share: self.share(),
            vehicles: self.vehicles,
            episodes: self.episodes,
            per_1000_km: self.per_1000_km(),
            left_out: self.doubtful,
            worst: self.worst.clone(),
        }
    }
}

/// Result of a rule with its rates.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RuleSummary {
    /// Name of the rule.
    pub rule: String,
    /// Recorded rows on which the rule has an answer.
    pub rows_evaluated: usize,
    /// Share of rows with a negative robustness.
    pub share: f64,
    /// Vehicles with an episode.
    pub vehicles: usize,
    /// Episodes of violations.
    pub episodes: usize,
    /// Episodes per 1,000 km of all vehicles.
    pub per_1000_km: f64,
    /// Episodes left out because all of their rows are interpolated or overlap.
    pub left_out: usize,
    /// Row with the least robustness, `None` without an episode.
    pub worst: Option<WorstRow>,
}

/// Row of a vehicle with its robustness.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorstRow {
    /// Identity of the vehicle.
    pub id: String,
    /// Identity of its lead.
    pub lead: Option<String>,
    /// Track of the vehicle in the recording.
    pub track: usize,
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// Robustness of the rule.
    pub robustness: f64,
}
