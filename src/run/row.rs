//! One row of every table: a rate with its interval and what it cost.

use serde::{Deserialize, Serialize};

use crate::rulebook::JudgeKind;
use crate::scene::Dynamics;

/// A rate over starts, as every verb prints it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Name of the world.
    pub world: String,
    /// Which physics.
    pub plant: Dynamics,
    /// What was judged.
    pub judge: JudgeKind,
    /// Which ego: `nominal`, or the name of a change.
    pub ego: String,
    /// Which ado, or `search`.
    pub ado: String,
    /// How actions were chosen.
    pub method: String,
    /// Seed of the training, for trained ados.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub train_seed: Option<u64>,
    /// Seed of the test starts.
    pub start_seed: u64,
    /// Starts evaluated: those that are not trivial.
    pub starts: usize,
    /// Starts left out because the nominal ego fails without an adversary.
    pub trivial: usize,
    /// Starts solved.
    pub successes: usize,
    /// successes / starts; 0 without starts.
    pub success_rate: f64,
    /// Wilson's 95 % interval of the success rate.
    pub ci95: [f64; 2],
    /// Share of the search-solved starts solved too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recall: Option<f64>,
    /// Solved, but not by search.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beyond_search: Option<usize>,
    /// Share of starts on which a rule was broken.
    pub foul_rate: f64,
    /// Share of starts that ended in contact.
    pub contact_rate: f64,
    /// Closing speed of the contacts, if there were any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing_speed_mps: Option<ClosingSpeed>,
    /// Episodes with a fault of ego or physics.
    pub invalid: usize,
    /// Mean simulations spent per start.
    pub sims_per_start: f64,
    /// Physics steps spent in all.
    pub physics_steps: u64,
    /// Processor time spent in all.
    pub cpu_s: f64,
    /// Per start in order: 1 solved, 0 not, t trivial.
    pub solved: String,
}

/// Closing speeds over all contacts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClosingSpeed {
    /// Median.
    pub median: f64,
    /// 90th percentile.
    pub p90: f64,
}

impl ClosingSpeed {
    /// Of a list of speeds; `None` when it is empty.
    pub fn of(mut speeds_mps: Vec<f64>) -> Option<ClosingSpeed> {
        if speeds_mps.is_empty() {
            return None;
        }
        speeds_mps.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let rank = (share * (speeds_mps.len() - 1) as f64).round() as usize;
            speeds_mps[rank]
        };
        Some(ClosingSpeed {
            median: at(0.5),
            p90: at(0.9),
        })
    }
}

impl Row {
    /// Fills recall and `beyond_search` from the row of a search.
    ///
    /// Both rows must be over the same starts.
    pub fn compare_with_search(&mut self, search_solved: &str) {
        let pairs = self.solved.bytes().zip(search_solved.bytes());
        let (mut both, mut search, mut beyond) = (0usize, 0usize, 0usize);
        for (mine, theirs) in pairs {
            search += usize::from(theirs == b'1');
            both += usize::from(theirs == b'1' && mine == b'1');
            beyond += usize::from(theirs == b'0' && mine == b'1');
        }
        self.recall = (0 < search).then(|| both as f64 / search as f64);
        self.beyond_search = Some(beyond);
    }
}

/// Wilson's 95 % score interval of `successes` out of `n`; [0, 1] for n = 0.
pub fn wilson(successes: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    const Z: f64 = 1.959_963_984_540_054;
    let (n, p) = (n as f64, successes as f64 / n as f64);
    let z2 = Z * Z;
    let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_agrees_with_published_values() {
        // Newcombe 1998, Table I: 81 of 263, and 0 of 20.
        let [lo, hi] = wilson(81, 263);
        assert!((lo - 0.2553).abs() < 1e-4 && (hi - 0.3662).abs() < 1e-4);
        let [lo, hi] = wilson(0, 20);
        assert!(lo == 0.0 && (hi - 0.1611).abs() < 1e-4);
    }
}
