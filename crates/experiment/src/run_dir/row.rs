//! Row of every table: a rate with its interval and its cost.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Deserializer, Serialize};

use super::adversary_id::{AdversaryId, keys};
use super::calibration::CalibrationWarning;
use super::contact_severity::{ClosingSpeed, ContactSeverity};
use super::repeated_runs::Repeated;
use super::success_contacts::SuccessContacts;
use crate::natural::NaturalnessOfRow;
use crate::rulebook::{JudgeKind, Rulebook};
use crate::scene::Dynamics;
use crate::stats::{Outcomes, StartOutcome};
use crate::testbench::FaultCount;

/// Rate over starts, as every command prints it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Name of the world.
    pub world: String,
    /// Plant of the row.
    pub plant: Dynamics,
    /// Subject of the judgement.
    pub judge: JudgeKind,
    /// Name of the ego: `nominal`, or that of a change.
    pub ego: String,
    /// Adversary, which JSON has as `adversary` and with its caption as `ado`.
    #[serde(flatten, with = "keys")]
    pub ado: AdversaryId,
    /// Method that chose the actions.
    pub method: String,
    /// Seed of the training, for trained ados.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub train_seed: Option<u64>,
    /// Reason why the ado's training is not reliable, if so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warning: Option<CalibrationWarning>,
    /// Seed of the test starts.
    pub start_seed: u64,
    /// Number of evaluated starts, which are not trivial.
    pub starts: usize,
    /// Starts left out, because the nominal ego fails without an adversary.
    pub trivial: usize,
    /// Starts on which this ego fails without an adversary.
    ///
    /// `None` if it was not tested, or is the nominal ego.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fails_alone: Option<FailsAlone>,
    /// Starts solved.
    pub successes: usize,
    /// successes / starts. It is 0 without starts.
    ///
    /// In a partial row it is the least share, successes / all starts in rates. It is NaN,
    /// which JSON has as null, if the ego depends on more than the episode.
    #[serde(deserialize_with = "null_as_nan")]
    pub success_rate: f64,
    /// Wilson's 95 % interval of the success rate. `None` in a partial row.
    pub ci95: Option<[f64; 2]>,
    /// Progress of an interrupted row. `None` if every start is decided.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub partial: Option<Partial>,
    /// Formula that the ego must keep. Empty in rows of earlier versions.
    #[serde(default)]
    pub specification: String,
    /// Violations that count as successes. `None`: every violation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counts: Option<String>,
    /// Exact 95 % upper bound of the rate, if there is no success.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
    /// Share of the search-solved starts that are solved too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recall: Option<f64>,
    /// Starts solved here but not by the search.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beyond_search: Option<usize>,
    /// Share of starts on which a rule was broken, which is no success.
    ///
    /// For a search it is the share of the tried sequences that broke a rule.
    #[serde(deserialize_with = "null_as_nan")]
    pub foul_rate: f64,
    /// Rules that were broken, with the ado that broke each, in the rulebook's order.
    ///
    /// A start counts for every rule that was broken at its verdict. Searches leave it
    /// empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub violations: Vec<BrokenRule>,
    /// Starts on which ψ_ego was violated within the rules, but does not count.
    ///
    /// `None` if every violation counts in this world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncounted: Option<usize>,
    /// Share of all starts that were solved and on which a rule broke between verdict and
    /// contact.
    ///
    /// `None` if it was not recorded.
    #[serde(default)]
    pub foul_before_contact_rate: Option<f64>,
    /// Share of starts that ended in contact.
    #[serde(deserialize_with = "null_as_nan")]
    pub contact_rate: f64,
    /// Closing speed of the contacts, if there were any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing_speed_mps: Option<ClosingSpeed>,
    /// Closing speed of the contacts after a success.
    ///
    /// `None` if there were none, or if it was not recorded apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub success_closing_mps: Option<ClosingSpeed>,
    /// Contacts among the successes. `None` without a success, or if not recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub success_contacts: Option<SuccessContacts>,
    /// Effect of the contacts on the ego, if it was in any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub severity: Option<ContactSeverity>,
    /// Successes by kind, the most frequent first. Empty if none, or not recorded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kinds: Vec<FailureCount>,
    /// Number of groups of similar failures among the successes.
    ///
    /// `None` if there are none, or if they were not compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distinct: Option<usize>,
    /// Rarity of the ados' driving in the successes, among real drivers.
    ///
    /// `None` without a success of an ado in a vehicle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub naturalness: Option<NaturalnessOfRow>,
    /// Starts on which the ego or the physics failed. They are in no rate of this row.
    pub invalid: usize,
    /// These faults by kind.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<FaultCount>,
    /// Result of playing each start several times, if the world requests it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeats: Option<Repeated>,
    /// Mean number of simulations per start.
    pub sims_per_start: f64,
    /// Greatest number of simulations of a start. `None` if it was not recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_sims_per_start: Option<u64>,
    /// Physics steps in total.
    pub physics_steps: u64,
    /// Processor time in total, in s.
    pub cpu_s: f64,
    /// Success with fewer simulations per start, for searches with a budget.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub anytime: Vec<Anytime>,
    /// Sequences that did not carry over from the plant of the pre-screening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unconfirmed: Option<Unconfirmed>,
    /// Outcomes of all starts, in order.
    pub solved: Outcomes,
}

/// Decided starts of a row that was interrupted.
///
/// Starts that are decided early are not like the others, because a success ends a search.
/// A row of such starts therefore has counts and bounds, and no interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Partial {
    /// Starts with a result, invalid starts included.
    pub decided: usize,
    /// Starts that the whole row would have, without trivial starts.
    pub of: usize,
}

/// Starts on which the ego of a row fails with neutral actions of the ados.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailsAlone {
    /// Number of starts.
    pub starts: usize,
    /// True if these starts are left out. Otherwise those of the nominal ego are.
    pub left_out: bool,
}

/// Starts on which an ado broke one of its rules.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BrokenRule {
    /// Name of the ado.
    pub ado: String,
    /// Name of the rule.
    pub rule: String,
    /// Number of starts.
    pub starts: usize,
}

impl BrokenRule {
    /// Counts the rules that were broken on each start. Rules that held are left out.
    pub fn counted<'a>(
        rulebook: &Rulebook,
        broken: impl Iterator<Item = &'a [usize]>,
    ) -> Vec<BrokenRule> {
        let mut counts = vec![0; rulebook.rules.len()];
        for &rule in broken.flatten() {
            counts[rule] += 1;
        }
        let counted = rulebook
            .rules
            .iter()
            .zip(counts)
            .filter(|(_, starts)| *starts > 0);
        counted
            .map(|(rule, starts)| BrokenRule {
                ado: rule.ado.clone(),
                rule: rule.name.clone(),
                starts,
            })
            .collect()
    }
}

impl Display for BrokenRule {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} × {}: `{}`", self.starts, self.ado, self.rule)
    }
}

/// Starts on which the ego failed in one way.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailureCount {
    /// Violated leaf of ψ_ego.
    pub leaf: String,
    /// Agents in contact, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<(String, String)>,
    /// Number of starts.
    pub starts: usize,
}

impl FailureCount {
    /// Counts failures by kind. Equally frequent kinds are sorted by their words.
    pub fn counted(
        failures: impl Iterator<Item = (String, Option<(String, String)>)>,
    ) -> Vec<FailureCount> {
        let mut counts = BTreeMap::new();
        for failure in failures {
            *counts.entry(failure).or_insert(0) += 1;
        }
        let mut kinds: Vec<FailureCount> = counts
            .into_iter()
            .map(|((leaf, contact), starts)| FailureCount {
                leaf,
                contact,
                starts,
            })
            .collect();
        // The sort is stable, so equal counts keep the alphabetical order of
        // the map.
        kinds.sort_by_key(|kind| std::cmp::Reverse(kind.starts));
        kinds
    }
}

impl Display for FailureCount {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} × `{}`", self.starts, self.leaf)?;
        match &self.contact {
            Some((one, other)) => write!(f, ", {one} and {other} touch"),
            None => f.write_str(", no contact"),
        }
    }
}

/// Result of a search after a number of simulations per start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Anytime {
    /// Greatest number of simulations per start.
    pub budget: u64,
    /// Starts solved within the budget.
    pub successes: usize,
    /// successes / starts.
    pub success_rate: f64,
    /// Wilson's 95 % interval of this rate.
    pub ci95: [f64; 2],
    /// Mean simulations per start. An unsolved start costs the complete budget.
    pub sims_per_start: f64,
}

/// Sequences that succeeded in the pre-screening but not on the requested plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unconfirmed {
    /// Number of sequences over all starts.
    pub sequences: u64,
    /// Starts on which there were only such sequences.
    pub starts: usize,
}

impl Row {
    /// Returns the share of the starts on which the ego or the physics failed.
    ///
    /// It refers to all requested starts.
    pub fn invalid_share(&self) -> f64 {
        self.invalid as f64 / (self.starts + self.invalid).max(1) as f64
    }

    /// Returns whether the ego depends on more than the episode.
    ///
    /// The row is no result then.
    pub fn is_unrepeatable(&self) -> bool {
        // `void` puts such a fault before all others.
        let first = self.faults.first();
        first.is_some_and(|fault| fault.kind.is_unrepeatable())
    }

    /// Makes the row no result, because its ego depends on more than the episode.
    ///
    /// All starts that are not trivial become invalid, so that no rate and no verdict can
    /// be read from it. The costs stay.
    pub fn void(&mut self, found: FaultCount) {
        // Ahead of other faults, because it is about the whole row.
        self.faults.insert(0, found);
        let voided = |outcome: &StartOutcome| match outcome {
            StartOutcome::Trivial | StartOutcome::NotReached => *outcome,
            _ => StartOutcome::Invalid,
        };
        self.solved = self.solved.iter().map(voided).collect();
        self.invalid = self.solved.count(StartOutcome::Invalid);
        (self.starts, self.successes) = (0, 0);
        // Not 0, which would read as an ego that no adversary makes fail.
        self.success_rate = f64::NAN;
        self.foul_rate = f64::NAN;
        self.contact_rate = f64::NAN;
        (self.ci95, self.at_most) = (None, None);
        (self.recall, self.beyond_search) = (None, None);
        (self.violations, self.kinds) = (Vec::new(), Vec::new());
        (self.uncounted, self.distinct) = (None, None);
        (self.closing_speed_mps, self.success_closing_mps) = (None, None);
        (self.success_contacts, self.severity) = (None, None);
        (self.naturalness, self.foul_before_contact_rate) = (None, None);
        (self.repeats, self.unconfirmed) = (None, None);
        self.anytime.clear();
    }

    /// Returns four cells about the contacts among the successes.
    ///
    /// They are the share of the successes, the contacts at the front, a flank and the rear
    /// of the ego, the share with the ego at rest or hit from behind, and those that a
    /// reference driver avoids.
    pub fn contact_cells(&self) -> [String; 4] {
        let none = || "–".to_owned();
        // Earlier versions did not count them, and without a success there is nothing to
        // count.
        let Some(of) = self.success_contacts.as_ref() else {
            return [none(), none(), none(), none()];
        };
        let share = |part: usize, whole: usize| match whole {
            0 => none(),
            _ => format!("{:.0} %", 100.0 * part as f64 / whole as f64),
        };
        let [front, side, rear] = of.front_side_rear();
        [
            share(of.contacts, self.successes),
            match of.contacts {
                0 => none(),
                _ => format!("{front}/{side}/{rear}"),
            },
            share(of.without_fault(), of.contacts),
            match of.judged {
                0 => none(),
                judged => format!("{} of {judged}", of.avoided),
            },
        ]
    }

    /// Fills recall and `beyond_search` from the row of a search.
    ///
    /// Both rows must be over the same starts. An interruption of either fills neither,
    /// because the starts that are decided first are the easy ones.
    pub fn compare_with_search(&mut self, search_solved: &Outcomes) {
        use StartOutcome::{NotReached, Solved, Unsolved};
        if self.solved.contains(&NotReached) || search_solved.contains(&NotReached) {
            return;
        }
        let pairs = self.solved.iter().zip(search_solved.iter());
        let (mut both, mut search, mut beyond) = (0usize, 0usize, 0usize);
        for (mine, theirs) in pairs {
            search += usize::from(*theirs == Solved);
            both += usize::from((theirs, mine) == (&Solved, &Solved));
            // Only starts that the search evaluated count as beyond it.
            beyond += usize::from((theirs, mine) == (&Unsolved, &Solved));
        }
        // A search that solves nothing leaves nothing to recall.
        self.recall = (search > 0).then(|| both as f64 / search as f64);
        self.beyond_search = Some(beyond);
    }

    /// Compares all rows of an ego with the last one, which is that of a search.
    pub fn compare_with_last(rows: &mut [Row]) {
        if let Some((search, others)) = rows.split_last_mut() {
            for row in others {
                row.compare_with_search(&search.solved);
            }
        }
    }
}

/// Reads a rate, of which JSON has null if it is unknown.
fn null_as_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests;
