//! One row of every table: a rate with its interval and what it cost.

use serde::{Deserialize, Serialize};

use super::outcome::{Outcomes, StartOutcome};
use super::repeated::Repeated;
use crate::rulebook::JudgeKind;
use crate::scene::Dynamics;
use crate::testbench::FaultCount;

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
    /// What a conditional ado was told of the ego: `true`, `identified`,
    /// `adapted` or `nominal` parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub told: Option<String>,
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
    /// Without any success: the exact 95 % upper bound of the rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
    /// Share of the search-solved starts solved too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recall: Option<f64>,
    /// Solved, but not by search.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beyond_search: Option<usize>,
    /// Share of starts on which a rule was broken, which is no success.
    pub foul_rate: f64,
    /// Starts on which ψ_ego was violated, every rule kept, but not in a way
    /// that counts; `None`: every violation counts in this world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncounted: Option<usize>,
    /// Share of starts that were solved, and where a rule was then broken
    /// between the verdict and the contact; `None`: it was not recorded.
    #[serde(default)]
    pub foul_before_contact_rate: Option<f64>,
    /// Share of starts that ended in contact.
    pub contact_rate: f64,
    /// Closing speed of the contacts, if there were any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing_speed_mps: Option<ClosingSpeed>,
    /// Starts on which the ego or the physics failed: in no rate of this row.
    pub invalid: usize,
    /// Those faults, by kind.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<FaultCount>,
    /// What playing each start several times showed, where the world asks for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeats: Option<Repeated>,
    /// Mean simulations spent per start.
    pub sims_per_start: f64,
    /// Physics steps spent in all.
    pub physics_steps: u64,
    /// Processor time spent in all.
    pub cpu_s: f64,
    /// Success after fewer simulations per start, for searches with a budget.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub anytime: Vec<Anytime>,
    /// What did not carry over from the plant that pre-screened.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unconfirmed: Option<Unconfirmed>,
    /// How each start ended, in order.
    pub solved: Outcomes,
}

/// What a search had reached after so many simulations per start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Anytime {
    /// Simulations per start, at most.
    pub budget: u64,
    /// Starts solved within them.
    pub successes: usize,
    /// successes / starts.
    pub success_rate: f64,
    /// Wilson's 95 % interval of it.
    pub ci95: [f64; 2],
    /// Mean simulations per start; a start not solved costs all of them.
    pub sims_per_start: f64,
}

/// Sequences that succeeded when pre-screened and not on the plant asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unconfirmed {
    /// How many, over all starts.
    pub sequences: u64,
    /// Starts on which there were only such.
    pub starts: usize,
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
    /// Share of the starts asked for on which the ego or the physics failed.
    pub fn invalid_share(&self) -> f64 {
        self.invalid as f64 / (self.starts + self.invalid).max(1) as f64
    }

    /// Fills recall and `beyond_search` from the row of a search.
    ///
    /// Both rows must be over the same starts.
    pub fn compare_with_search(&mut self, search_solved: &Outcomes) {
        use StartOutcome::{Solved, Unsolved};
        let pairs = self.solved.iter().zip(search_solved.iter());
        let (mut both, mut search, mut beyond) = (0usize, 0usize, 0usize);
        for (mine, theirs) in pairs {
            search += usize::from(*theirs == Solved);
            both += usize::from((theirs, mine) == (&Solved, &Solved));
            beyond += usize::from((theirs, mine) == (&Unsolved, &Solved));
        }
        self.recall = (0 < search).then(|| both as f64 / search as f64);
        self.beyond_search = Some(beyond);
    }
}
