//! What a kept counterexample says of itself, besides how to play it again.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::preventability::Preventability;
use crate::severity::{Impact, InjuryRisk};
use crate::testbench::Episode;

/// What is known of a counterexample: how bad, how minimal, why, how robust.
///
/// Everything in it follows from the episode; it is kept because it takes many
/// episodes to find out. `docs/crashes.md` explains the words.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct About {
    /// What the contact does to the ego; `None`: no contact that it has part in.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub severity: Option<Severity>,
    /// What shrinking did; `None`: it is as it was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shrunk: Option<Shrunk>,
    /// Why the ego fails.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<Why>,
    /// Whether it is still there when it is replayed slightly differently;
    /// `None`: nothing of the world can be varied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub persistence: Option<Persistence>,
    /// Which reference drivers avoid it; `None`: no contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preventability: Option<Preventability>,
    /// Counterexamples that are like this one, itself included; `None`: they
    /// were not compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cluster: Option<usize>,
    /// Runs of the ego that all this took; `None`: a stock ego, whose runs are
    /// not counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ego_runs: Option<EgoRuns>,
}

/// Runs of an ego for questions about one counterexample: a program's, or those
/// of the user's own type.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EgoRuns {
    /// Runs of the ego.
    pub runs: u64,
    /// Whether most of them began in the middle, from a copy of the ego.
    #[serde(default)]
    pub copied: bool,
    /// Why they ended before every question was answered; `None`: all were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended: Option<NotAsked>,
}

/// Reason for which a question about an ego was not asked, or not to its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum NotAsked {
    /// Runs with the same seed and actions diverge from this time on.
    NotDeterministic {
        /// Time of the first command that differs, in s.
        at_s: f64,
    },
    /// The limit of runs per counterexample was reached.
    RunLimit {
        /// That limit.
        runs: u64,
    },
    /// The command was interrupted.
    Interrupted,
    /// The ego failed to run.
    EgoFailed,
    /// Only the commands of the ego are there, and not the ego.
    CommandsOnly,
    /// The ado only ever takes its neutral action.
    NothingDone,
    /// An earlier version kept the file.
    EarlierVersion,
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
                "the limit of {runs} runs was reached; `--keep-runs` raises it"
            ),
            NotAsked::Interrupted => f.write_str("the command was interrupted"),
            NotAsked::EgoFailed => f.write_str("the ego failed to run"),
            NotAsked::CommandsOnly => f.write_str("only the ego's commands are known here"),
            NotAsked::NothingDone => f.write_str("the ado only takes its neutral action"),
            NotAsked::EarlierVersion => f.write_str("an earlier version kept this file"),
        }
    }
}

impl Display for EgoRuns {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let plural = if self.runs == 1 { "" } else { "s" };
        write!(f, "{} run{plural} of the ego", self.runs)?;
        if self.copied {
            f.write_str(", most of them begun from a copy of it")?;
        }
        match &self.ended {
            Some(reason) => write!(f, "; not all is known: {reason}"),
            None => Ok(()),
        }
    }
}

/// How severe a contact is for the ego.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Severity {
    /// Approach speed along the contact normal.
    pub closing_speed_mps: f64,
    /// Kind, sides, speeds and Δv.
    pub impact: Impact,
    /// The injury risk; `None`: not computed, as no published curve applies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub injury_risk: Option<InjuryRisk>,
}

impl Severity {
    /// That of an episode, if it ends in a contact in which the ego has part.
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

/// How much an ado does: what shrinking makes less of, first things first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Effort {
    /// Decisions that differ from the one before.
    pub switches: usize,
    /// Σ over the decisions of how far the action is from the neutral one, each
    /// 0 to 1 (`World::action_distance`).
    pub deviation: f64,
    /// The first decision that is not neutral; `None`: all are.
    pub first: Option<usize>,
}

impl Effort {
    /// Whether it is less: fewer switches; of equal ones a smaller deviation; of
    /// equal ones a later first deviation.
    pub fn is_less_than(&self, other: &Effort) -> bool {
        self.order(other).is_lt()
    }

    /// The order of [`Effort::is_less_than`].
    pub fn order(&self, other: &Effort) -> std::cmp::Ordering {
        // Sums of equal distances in another order may differ in the last bits.
        let rounded = |effort: &Effort| (effort.deviation * 1e9).round();
        let first = |effort: &Effort| effort.first.unwrap_or(usize::MAX);
        self.switches
            .cmp(&other.switches)
            .then(rounded(self).total_cmp(&rounded(other)))
            .then(first(other).cmp(&first(self)))
    }
}

impl Display for Effort {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (switches, deviation) = (self.switches, self.deviation);
        let plural = if switches == 1 { "" } else { "es" };
        write!(f, "{switches} switch{plural}, Σ {deviation:.2}")?;
        match self.first {
            Some(first) => write!(f, " from decision {first} on"),
            None => Ok(()),
        }
    }
}

/// What shrinking did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shrunk {
    /// As it was found.
    pub before: Effort,
    /// As it is kept.
    pub after: Effort,
}

impl Display for Shrunk {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Shrunk { before, after } = self;
        match before == after {
            true => write!(f, "not shrunk: {after}"),
            false => write!(f, "shrunk from {before} to {after}"),
        }
    }
}

/// Why the ego fails: the leaf, what the ado did, and what the ego could still do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Why {
    /// The sub-formula of ψ_ego that decides.
    pub leaf: String,
    /// When it does.
    pub leaf_s: f64,
    /// The action of the ado without which there is no failure; `None`: no single
    /// one decides it, or the question was not asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decisive: Option<Decisive>,
    /// Why `decisive` was not asked for; `None`: it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_asked: Option<NotAsked>,
    /// Until when another driver avoids it; `None`: nobody was asked, since the
    /// world is not driven.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_chance: Option<LastChance>,
}

/// The earliest action without which there is no failure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decisive {
    /// What it is, in words.
    pub action: String,
    /// When it begins.
    pub from_s: f64,
    /// When the neutral action would have to end; later ones stay as recorded.
    pub until_s: f64,
}

/// The last sample from which another driver, in the ego's place, avoids it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LastChance {
    /// Who that is.
    pub driver: String,
    /// When it takes over; `None`: it avoids it from no sample on.
    pub at_s: Option<f64>,
    /// When ψ_ego is violated.
    pub violated_s: f64,
}

impl Display for Why {
    /// One sentence.
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
        let Some(chance) = &self.last_chance else {
            return f.write_str(".");
        };
        let driver = &chance.driver;
        match chance.at_s {
            Some(at_s) => {
                // Both are times of samples: what is below 0 is rounding.
                let left_s = (chance.violated_s - at_s).max(0.0);
                write!(
                    f,
                    "; {driver} avoids it until {at_s:.2} s, {left_s:.2} s before."
                )
            }
            None => write!(f, "; {driver} does not avoid it from any sample on."),
        }
    }
}

/// Whether it still fails when something small is different.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Persistence {
    /// Every variation that was played.
    pub variations: Vec<Variation>,
}

/// One replay with something different.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Variation {
    /// What is different.
    pub name: String,
    /// Whether the ego still fails; `None`: it or the physics did not run.
    pub fails: Option<bool>,
}

impl Persistence {
    /// Share of the variations that ran in which the ego still fails; 0 of none.
    pub fn share(&self) -> f64 {
        let ran = self.variations.iter().filter_map(|one| one.fails);
        let failing = ran.clone().filter(|fails| *fails).count();
        failing as f64 / ran.count().max(1) as f64
    }
}

impl Display for Persistence {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (all, share) = (self.variations.len(), 100.0 * self.share());
        write!(f, "still fails in {share:.0} % of {all} variations")?;
        let gone = self.variations.iter().filter(|one| one.fails != Some(true));
        let gone: Vec<&str> = gone.map(|one| one.name.as_str()).collect();
        match gone.is_empty() {
            true => Ok(()),
            false => write!(f, ", not with {}", gone.join(", ")),
        }
    }
}

impl Display for About {
    /// One line per thing that is known.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut lines: Vec<String> = vec![match &self.severity {
            Some(severity) => severity.to_string(),
            None => "no contact of the ego".to_owned(),
        }];
        lines.extend(self.why.as_ref().map(ToString::to_string));
        lines.extend(self.preventability.as_ref().map(ToString::to_string));
        lines.extend(self.shrunk.as_ref().map(ToString::to_string));
        lines.extend(self.persistence.as_ref().map(ToString::to_string));
        lines.extend(self.ego_runs.as_ref().map(|runs| match &self.shrunk {
            Some(_) => format!("minimized and labelled with {runs}"),
            None => format!("labelled with {runs}"),
        }));
        lines.extend(self.cluster.map(|size| match size {
            1 => "like no other".to_owned(),
            size => format!("one of {size} that are alike"),
        }));
        f.write_str(&lines.join("\n"))
    }
}
