//! One row of every table: a rate with its interval and what it cost.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use super::calibration::CalibrationWarning;
use super::outcome::{Outcomes, StartOutcome};
use super::repeated::Repeated;
use crate::rulebook::JudgeKind;
use crate::scene::Dynamics;
use crate::severity::{CrashKind, Impact, RiskCurve};
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
    /// What a conditional ado was conditioned on: `true`, `identified`,
    /// `adapted` or `nominal` parameters of the ego; `told` before 0.2.0.
    #[serde(alias = "told", default, skip_serializing_if = "Option::is_none")]
    pub context: Option<String>,
    /// Why the ado's training cannot be relied on, if so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warning: Option<CalibrationWarning>,
    /// Seed of the test starts.
    pub start_seed: u64,
    /// Starts evaluated: those that are not trivial.
    pub starts: usize,
    /// Starts left out because the nominal ego fails without an adversary.
    pub trivial: usize,
    /// On how many starts this very ego fails without an adversary; `None`: it
    /// was not asked, or is the nominal one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fails_alone: Option<FailsAlone>,
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
    /// Share of starts on which a rule was broken, which is no success; of a
    /// search the share of the sequences it tried in which a rule was broken.
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
    /// Closing speed of the contacts after a success; `None`: there were none, or
    /// it was not recorded apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub success_closing_mps: Option<ClosingSpeed>,
    /// What the contacts do to the ego, if it has part in any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub severity: Option<ContactSeverity>,
    /// The successes by kind, most frequent first; empty: none, or not recorded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kinds: Vec<FailureKind>,
    /// Groups of alike failures among the successes; `None`: there are none, or
    /// they were not compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distinct: Option<usize>,
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

/// Starts on which the ego of a row fails while the ados take the neutral action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailsAlone {
    /// Number of them.
    pub starts: usize,
    /// Whether those are the starts left out; else the nominal ego's are.
    pub left_out: bool,
}

/// Starts on which the ego failed in one way.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailureKind {
    /// The leaf of ψ_ego that was violated.
    pub leaf: String,
    /// Who touched, if anybody did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<(String, String)>,
    /// On how many starts.
    pub starts: usize,
}

impl FailureKind {
    /// The failures one by one, counted; equally frequent ones by their words.
    pub fn counted(
        failures: impl Iterator<Item = (String, Option<(String, String)>)>,
    ) -> Vec<FailureKind> {
        let mut counts = BTreeMap::new();
        for failure in failures {
            *counts.entry(failure).or_insert(0) += 1;
        }
        let kinds = counts.into_iter();
        let mut kinds: Vec<FailureKind> = kinds
            .map(|((leaf, contact), starts)| FailureKind {
                leaf,
                contact,
                starts,
            })
            .collect();
        kinds.sort_by_key(|kind| std::cmp::Reverse(kind.starts));
        kinds
    }
}

impl Display for FailureKind {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} × `{}`", self.starts, self.leaf)?;
        match &self.contact {
            Some((one, other)) => write!(f, ", {one} and {other} touch"),
            None => f.write_str(", no contact"),
        }
    }
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

/// What the contacts of a row do to the ego.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactSeverity {
    /// Share of the contacts of each kind; they sum up to 1.
    pub kinds: BTreeMap<CrashKind, f64>,
    /// Share of the contacts in which somebody ran into the ego's rear.
    pub struck_from_behind: f64,
    /// Median of the ego's Δv.
    pub ego_delta_v_mps: f64,
    /// The greatest injury risk of each curve that applies to any.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub max_injury_risk: BTreeMap<RiskCurve, f64>,
}

impl ContactSeverity {
    /// Of a list of contacts; `None` when it is empty.
    pub fn of(impacts: &[Impact]) -> Option<ContactSeverity> {
        let all = impacts.len().max(1) as f64;
        let delta_v = impacts.iter().map(|impact| impact.ego_delta_v_mps);
        let delta_v = ClosingSpeed::of(delta_v.collect())?;
        let mut kinds: BTreeMap<CrashKind, f64> = BTreeMap::new();
        let mut max_injury_risk = BTreeMap::new();
        for impact in impacts {
            *kinds.entry(impact.kind).or_default() += 1.0;
            if let Some(risk) = impact.injury_risk() {
                let most = max_injury_risk.entry(risk.curve).or_insert(0.0);
                *most = risk.probability.max(*most);
            }
        }
        kinds.values_mut().for_each(|count| *count /= all);
        let behind = impacts
            .iter()
            .filter(|impact| impact.is_struck_from_behind());
        Some(ContactSeverity {
            kinds,
            struck_from_behind: behind.count() as f64 / all,
            ego_delta_v_mps: delta_v.median,
            max_injury_risk,
        })
    }
}

impl Display for ContactSeverity {
    /// Kinds, Δv and the greatest risk in one line.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for (n, (kind, share)) in self.kinds.iter().enumerate() {
            let comma = if n == 0 { "" } else { ", " };
            write!(f, "{comma}{:.0} % {}", 100.0 * share, kind.word())?;
        }
        if 0.0 < self.struck_from_behind {
            let share = 100.0 * self.struck_from_behind;
            write!(f, " ({share:.0} % with the ego struck from behind)")?;
        }
        write!(
            f,
            "; Δv of the ego {:.1} m/s (median)",
            self.ego_delta_v_mps
        )?;
        for (curve, risk) in &self.max_injury_risk {
            let percent = 100.0 * risk;
            write!(f, "; at most {percent:.1} % risk of {}", curve.about())?;
        }
        if self.max_injury_risk.is_empty() {
            write!(f, "; injury risk not computed")?;
        }
        Ok(())
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
