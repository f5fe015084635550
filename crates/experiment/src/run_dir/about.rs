//! Facts about a kept counterexample, besides the data that replays it.

use std::fmt::{self, Display, Formatter};

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::counted;
use crate::natural::Naturalness;
use crate::preventability::Preventability;
use crate::scene::AfterContact;
use crate::severity::{Impact, InjuryRisk};
use crate::testbench::Episode;
use crate::world::EncounterRate;

/// Facts about a counterexample: severity, size, cause and robustness.
///
/// All of them follow from the episode. They are kept because they take many
/// episodes to compute. `docs/reference/crash-labels.md` defines the terms.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct About {
    /// Effect of the contact on the ego. `None` without a contact of the ego.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub severity: Option<Severity>,
    /// Motion after the contact. `None` without a contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after_contact: Option<AfterContact>,
    /// Result of shrinking. `None` if the counterexample is as it was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shrunk: Option<Shrunk>,
    /// Cause of the ego's failure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<Why>,
    /// Persistence under slightly different replays.
    ///
    /// `None` if nothing in the world can be varied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub persistence: Option<Persistence>,
    /// Reference drivers that avoid the contact. `None` without a contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preventability: Option<Preventability>,
    /// Rarity of the ados' driving among real drivers. `None` if none drives a vehicle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub naturalness: Option<Naturalness>,
    /// Likelihood in the traffic that the ado was trained as. `None` for other ados.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traffic: Option<TrafficLikelihood>,
    /// Number of similar counterexamples, including itself.
    ///
    /// `None` if they were not compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cluster: Option<usize>,
    /// Runs of the ego that these facts took.
    ///
    /// `None` for a stock ego, whose runs are not counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ego_runs: Option<EgoRuns>,
}

/// Likelihood of a crash in declared traffic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrafficLikelihood {
    /// Origin of the traffic.
    pub source: String,
    /// Decadic logarithm of the probability of the ados' actions, from their start.
    pub log10_probability: f64,
    /// Kind of failure: the contact, and the ados' manoeuvre.
    pub kind: String,
    /// Probability of this kind per run of the traffic, with all rules kept.
    pub per_run: f64,
    /// 95 % interval of `per_run`, if the kinds found are all.
    pub interval: [f64; 2],
    /// Effective number of failures behind it.
    pub ess: f64,
    /// Encounters like a run, if the traffic declares them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure: Option<EncounterRate>,
}

impl Display for TrafficLikelihood {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let [lo, hi] = self.interval;
        write!(
            f,
            "in the traffic “{}”, actions of probability 10^{:.1}; this kind has {:.2e} per run \
             (95 %: {lo:.2e} … {hi:.2e})",
            self.source, self.log10_probability, self.per_run
        )?;
        match self.exposure {
            Some(rate) => {
                let all = self.per_run * rate.encounters();
                write!(f, ", {all:.2e} {}", rate.unit())
            }
            None => Ok(()),
        }
    }
}

/// Runs of an ego for the facts about one counterexample.
///
/// The ego is a program, or a type of the user.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EgoRuns {
    /// Number of runs of the ego.
    pub runs: u64,
    /// True if most runs began in the middle, from a copy of the ego.
    #[serde(default)]
    pub copied: bool,
    /// Reason why the runs ended early. `None` if every question was answered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended: Option<NotAsked>,
}

/// Reason why a question about an ego was not asked, or not answered completely.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum NotAsked {
    /// Runs with the same seed and actions diverge from this time on.
    NotDeterministic {
        /// Time of the first command that differs, in s.
        at_s: f64,
    },
    /// The limit of runs per counterexample was reached.
    RunLimit {
        /// Limit of runs.
        runs: u64,
    },
    /// The command was interrupted.
    Interrupted,
    /// The ego failed to run.
    EgoFailed,
    /// The file contains the commands of the ego but not the ego.
    CommandsOnly,
    /// The ado only takes its neutral action.
    NothingDone,
    /// The replays give no answer.
    NoAnswer(NoAnswer),
}

/// Result of replays with a change, such as another driver.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// The failure is avoided.
    Avoided,
    /// The failure is not avoided.
    NotAvoided,
    /// The replays give no answer.
    NoAnswer(NoAnswer),
}

/// Reason why replays give no answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum NoAnswer {
    /// An ado breaks one of its rules in the replay.
    RuleBroken {
        /// Name of the rule.
        rule: String,
    },
    /// The ego or the physics fails in the replay.
    Fault,
    /// The replay of the actions and that of the recorded motion differ.
    ReplaysDiffer,
    /// Full braking avoids the contact, but not the violation of ψ_ego.
    OnlyContact,
    /// Full braking avoids the contact from no sample, but a reference driver does.
    OnlyDriver {
        /// Name of the driver.
        driver: String,
    },
    /// An earlier version kept the label and did not distinguish broken rules.
    EarlierVersion,
}

impl NoAnswer {
    fn earlier_version() -> Option<NoAnswer> {
        Some(NoAnswer::EarlierVersion)
    }
}

impl Display for NoAnswer {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            NoAnswer::RuleBroken { rule } => write!(f, "the ado breaks `{rule}` in the replay"),
            NoAnswer::Fault => f.write_str("the ego or the physics fails in the replay"),
            NoAnswer::ReplaysDiffer => {
                f.write_str("it depends on how the ado goes on after the record")
            }
            NoAnswer::OnlyContact => {
                f.write_str("it avoids the contact, but not the violation before it")
            }
            NoAnswer::OnlyDriver { driver } => {
                write!(f, "it does not, but {driver}, which brakes less, does")
            }
            NoAnswer::EarlierVersion => f.write_str(
                "an earlier version did not record why, so run `brakecheck replay FILE --expect \
                 recorded --refine`",
            ),
        }
    }
}

impl Display for NotAsked {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            NotAsked::NotDeterministic { at_s } => write!(
                f,
                "the ego is not deterministic: same-seed runs diverge at {at_s:.2} s, so give the \
                 world `repeats: 5`"
            ),
            NotAsked::RunLimit { runs } => write!(
                f,
                "the limit of {runs} runs was reached; `--keep DIR,runs=N` raises it"
            ),
            NotAsked::Interrupted => f.write_str("the command was interrupted"),
            NotAsked::EgoFailed => f.write_str("the ego failed to run"),
            NotAsked::CommandsOnly => f.write_str("only the ego's commands are known here"),
            NotAsked::NothingDone => f.write_str("the ado only takes its neutral action"),
            NotAsked::NoAnswer(reason) => reason.fmt(f),
        }
    }
}

impl Display for EgoRuns {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} of the ego", counted(self.runs, "run"))?;
        if self.copied {
            f.write_str(", most of them begun from a copy of it")?;
        }
        match &self.ended {
            Some(reason) => write!(f, "; not all is known: {reason}"),
            None => Ok(()),
        }
    }
}

/// Severity of a contact for the ego.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Severity {
    /// Approach speed along the contact normal.
    pub closing_speed_mps: f64,
    /// Kind, sides, speeds and Δv.
    pub impact: Impact,
    /// Injury risk. `None` if no published curve applies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub injury_risk: Option<InjuryRisk>,
}

impl Severity {
    /// Returns the severity of an episode that ends in a contact of the ego.
    pub fn of(episode: &Episode) -> Option<Severity> {
        let touch = episode.contact.as_ref()?;
        let impact = touch.impact?;
        Some(Severity {
            closing_speed_mps: touch.closing_speed_mps,
            impact,
            injury_risk: impact.injury_risk(),
        })
    }
}

impl Display for Severity {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let closing_mps = self.closing_speed_mps;
        write!(f, "{}, closing at {closing_mps:.1} m/s", self.impact)?;
        match &self.injury_risk {
            Some(risk) => write!(f, ", risk {risk}"),
            None => f.write_str(", injury risk not computed"),
        }
    }
}

/// Effort of an ado up to the failure, which shrinking reduces in the order of the fields.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Effort {
    /// Number of decisions that differ from the previous decision.
    pub switches: usize,
    /// Sum of the distances of all actions from the neutral action.
    ///
    /// Each distance is within 0 ..= 1 (`World::action_distance`).
    pub deviation: f64,
    /// First decision that is not neutral. `None` if all are.
    pub first: Option<usize>,
}

impl Effort {
    /// Returns true for less effort than `other`.
    ///
    /// Fewer switches come first, then a smaller deviation, then a later first
    /// deviation.
    pub fn is_less_than(&self, other: &Effort) -> bool {
        self.order(other).is_lt()
    }

    /// Returns the order of [`Effort::is_less_than`].
    pub fn order(&self, other: &Effort) -> std::cmp::Ordering {
        // Sums of equal distances in another order may differ in the last bits.
        let rounded = |effort: &Effort| (effort.deviation * 1e9).round();
        // Without any deviation, the first deviation is later than any
        // decision.
        let first = |effort: &Effort| effort.first.unwrap_or(usize::MAX);
        self.switches
            .cmp(&other.switches)
            .then(rounded(self).total_cmp(&rounded(other)))
            .then(first(other).cmp(&first(self)))
    }
}

impl Display for Effort {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let switches = counted(self.switches, "switch");
        write!(f, "{switches}, Σ {:.2}", self.deviation)?;
        match self.first {
            Some(first) => write!(f, " from decision {first} on"),
            None => Ok(()),
        }
    }
}

/// Result of shrinking.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shrunk {
    /// Effort as found.
    pub before: Effort,
    /// Effort as kept.
    pub after: Effort,
}

impl Display for Shrunk {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Shrunk { before, after } = self;
        if before == after {
            write!(f, "not shrunk: {after}")
        } else {
            write!(f, "shrunk from {before} to {after}")
        }
    }
}

/// Cause of the failure: the leaf, the ado's action, and the ego's last chance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Why {
    /// Sub-formula of ψ_ego that decides.
    pub leaf: String,
    /// Time of its violation, in s.
    pub leaf_s: f64,
    /// Action of the ado without which there is no failure.
    ///
    /// `None` if no single action decides it, or the question was not asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decisive: Option<DecisiveSpan>,
    /// Reason why `decisive` was not determined. `None` if it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_asked: Option<NotAsked>,
    /// Last time at which another driver avoids the failure.
    ///
    /// `None` for a world without driving.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_chance: Option<LastChance>,
}

/// Earliest action without which there is no failure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DecisiveSpan {
    /// Action in words.
    pub action: String,
    /// Start of the action, in s.
    pub from_s: f64,
    /// Required end of the neutral action, in s. Later actions stay as recorded.
    pub until_s: f64,
}

/// Last sample from which another driver in the ego's place avoids the failure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LastChance {
    /// Name of the driver.
    pub driver: String,
    /// Time of its takeover, in s. `None` without a sample from which it avoids the failure.
    pub at_s: Option<f64>,
    /// Time of the violation of ψ_ego, in s.
    pub violated_s: f64,
    /// Reason why some sample after `at_s` has no answer. `None` if all have one.
    #[serde(default = "NoAnswer::earlier_version")]
    pub no_answer: Option<NoAnswer>,
    /// Last takeover that avoids the contact in the recorded motion, in s.
    ///
    /// `None` if no sample does, or if it was not determined.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact_s: Option<f64>,
}

impl LastChance {
    /// Returns whether the driver avoids the failure from any sample on.
    pub fn answer(&self) -> Answer {
        match (self.at_s, &self.no_answer) {
            // A takeover that works is an answer, whatever other samples lack.
            (Some(_), _) => Answer::Avoided,
            (None, None) => Answer::NotAvoided,
            (None, Some(reason)) => Answer::NoAnswer(reason.clone()),
        }
    }
}

impl Display for LastChance {
    /// Writes a clause.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let driver = &self.driver;
        match (self.at_s, self.answer()) {
            (Some(at_s), _) => {
                // Both are times of samples, so a value below 0 is rounding.
                let left_s = (self.violated_s - at_s).max(0.0);
                // Later samples without an answer may avoid it, too.
                let at_least = match self.no_answer {
                    // A file of an earlier version has no gaps on record, which is no
                    // sign of one.
                    None | Some(NoAnswer::EarlierVersion) => "",
                    Some(_) => "at least ",
                };
                write!(
                    f,
                    "{driver} avoids it until {at_least}{at_s:.2} s, {left_s:.2} s before"
                )
            }
            (None, Answer::NoAnswer(reason)) => {
                write!(f, "no answer whether {driver} avoids it: {reason}")?;
                match self.contact_s {
                    Some(contact_s) => write!(
                        f,
                        " (in the recorded motion, it avoids the contact until {contact_s:.2} s)"
                    ),
                    None => Ok(()),
                }
            }
            (None, _) => write!(f, "{driver} does not avoid it from any sample on"),
        }
    }
}

impl Display for Why {
    /// Writes one sentence.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (leaf, at_s) = (&self.leaf, self.leaf_s);
        write!(f, "`{leaf}` is violated at {at_s:.2} s")?;
        match (&self.decisive, &self.not_asked) {
            (Some(decisive), _) => {
                let (action, from_s, until_s) =
                    (&decisive.action, decisive.from_s, decisive.until_s);
                write!(
                    f,
                    "; it takes the ado's {action} from {from_s:.2} to {until_s:.2} s"
                )?;
            }
            (None, None) => f.write_str("; no single action of the ado decides it")?,
            (None, Some(NotAsked::NothingDone)) => {
                f.write_str("; it takes no action of the ado")?;
            }
            (None, Some(reason)) => write!(
                f,
                "; whether an action of the ado decides it is not known ({reason})"
            )?,
        }
        match &self.last_chance {
            Some(chance) => write!(f, "; {chance}."),
            None => f.write_str("."),
        }
    }
}

/// Persistence of a failure under small variations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Persistence {
    /// Variations that were played.
    pub variations: Vec<Variation>,
}

/// Replay with one variation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Variation {
    /// Name of the variation.
    pub name: String,
    /// True if the ego still fails. `None` without an answer.
    pub fails: Option<bool>,
    /// Reason why the replay gives no answer. `None` if it gives one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_answer: Option<NoAnswer>,
}

impl Persistence {
    /// Returns the share of the variations in which the ego still fails.
    ///
    /// Only variations with an answer count. Without any, the share is 0.
    pub fn share(&self) -> f64 {
        self.failing() as f64 / self.answered().max(1) as f64
    }

    /// Returns the number of variations in which the ego still fails.
    pub fn failing(&self) -> usize {
        let variations = self.variations.iter();
        variations.filter(|one| one.fails == Some(true)).count()
    }

    /// Returns the number of variations with an answer.
    pub fn answered(&self) -> usize {
        let variations = self.variations.iter();
        variations.filter(|one| one.fails.is_some()).count()
    }
}

impl Display for Persistence {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (all, share) = (self.variations.len(), 100.0 * self.share());
        match self.answered() {
            // A share over no answers is 0, which would read as a failure that is gone.
            0 => write!(f, "no answer in {all} variations")?,
            answered => write!(f, "still fails in {share:.0} % of {answered} variations")?,
        }
        let named = |fails: Option<bool>| {
            let some = self.variations.iter().filter(|one| one.fails == fails);
            some.map(|one| one.name.as_str()).collect::<Vec<_>>()
        };
        let gone = named(Some(false));
        if !gone.is_empty() {
            write!(f, ", not with {}", gone.join(", "))?;
        }
        // Every variation without an answer is listed with its reason.
        let mut unanswered: IndexMap<String, Vec<&str>> = IndexMap::new();
        for one in self.variations.iter().filter(|one| one.fails.is_none()) {
            // Earlier versions gave no reason, and only a fault left them without an
            // answer.
            let reason = one.no_answer.as_ref().unwrap_or(&NoAnswer::Fault);
            let names = unanswered.entry(reason.to_string()).or_default();
            names.push(&one.name);
        }
        for (reason, names) in unanswered {
            write!(f, "; no answer with {}: {reason}", names.join(", "))?;
        }
        Ok(())
    }
}

impl Display for About {
    /// Writes one line per known fact.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // Each report opens with the contact, so a reader sees that there was none.
        let mut lines: Vec<String> = vec![match &self.severity {
            Some(severity) => severity.to_string(),
            None => "no contact of the ego".to_owned(),
        }];
        lines.extend(self.after_contact.iter().flat_map(AfterContact::sentences));
        lines.extend(self.why.as_ref().map(ToString::to_string));
        lines.extend(self.preventability.as_ref().map(ToString::to_string));
        lines.extend(self.naturalness.as_ref().map(ToString::to_string));
        lines.extend(self.traffic.as_ref().map(ToString::to_string));
        lines.extend(self.shrunk.as_ref().map(ToString::to_string));
        lines.extend(self.persistence.as_ref().map(ToString::to_string));
        lines.extend(self.ego_runs.as_ref().map(|runs| match &self.shrunk {
            Some(_) => format!("minimized and labelled with {runs}"),
            None => format!("labelled with {runs}"),
        }));
        lines.extend(self.cluster.map(|size| match size {
            1 => "no similar counterexample".to_owned(),
            size => format!("one of {size} similar counterexamples"),
        }));
        f.write_str(&lines.join("\n"))
    }
}
