//! Decision of a gate: the starts that close it, and the reasons.
//!
//! `brakecheck gate` and the gates of campaigns share it.

mod as_json;
mod gate_on;
mod result;
mod words;

pub use gate_on::GateOn;
pub use result::{gate_page, gate_table, gates_verdict};

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::preventability::Avoidability;
use crate::run_dir::ClosingSpeed;
use crate::stats::{Flips, StartOutcome};

/// Factor of the ego's Δv above which a failure is more severe than the baseline's.
const MORE_SEVERE: f64 = 1.2;

/// Contact after a failure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GateContact {
    /// Closing speed.
    pub closing_mps: f64,
    /// Change of the ego's velocity. `None`: the ego has no part in the contact.
    pub ego_delta_v_mps: Option<f64>,
}

/// Results of an ego for a gate.
#[derive(Clone, Copy)]
pub struct GateEgo<'a> {
    /// Name of the ego.
    pub name: &'a str,
    /// Outcome per start.
    pub outcomes: &'a [StartOutcome],
    /// Contacts by position of the start.
    pub contacts: &'a BTreeMap<usize, GateContact>,
}

/// Start with another outcome on the new ego.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Flipped {
    /// Position of the start.
    pub start: usize,
    /// Outcome on the baseline ego.
    #[serde(with = "as_json::word")]
    pub before: StartOutcome,
    /// Outcome on the new ego.
    #[serde(with = "as_json::word")]
    pub now: StartOutcome,
    /// Closing speed on the ego that fails, if it ends in contact.
    pub closing_mps: Option<f64>,
    /// Avoidability of a newly failing start.
    #[serde(flatten, with = "as_json::avoidability")]
    pub avoidability: Avoidability,
}

/// Start that fails on both egos, and more severely on the new one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MoreSevere {
    /// Position of the start.
    pub start: usize,
    /// Δv of the baseline ego, 0 without a contact of the ego.
    pub before_mps: f64,
    /// Δv of the new ego.
    pub now_mps: f64,
}

/// Counts of newly failing starts by the avoidability of the crash.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NewlyFailingCounts {
    /// CC_LATCHED or FSM avoids it.
    pub preventable: usize,
    /// Only other reference drivers or full braking without delay avoid it.
    pub avoidable: usize,
    /// None of them avoids it.
    pub unavoidable: usize,
    /// The drivers do not apply, or were not asked.
    pub unknown: usize,
}

/// Number of starts that an ego did not run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NotRun {
    /// Starts of the new ego.
    pub ego: usize,
    /// Starts of the baseline ego.
    pub baseline: usize,
}

/// Comparison of a new ego with a baseline under the same ado, start by start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gate {
    /// Name of the new ego.
    pub ego: String,
    /// Name of the baseline ego.
    pub baseline: String,
    /// Starts that are valid for both, and not trivial for both.
    pub compared: usize,
    /// Starts of these on which no ado breaks its rule.
    pub answered: usize,
    /// Starts from which the new ego fails and the baseline does not.
    pub newly_failing: Vec<Flipped>,
    /// Starts from which the baseline fails and the new ego does not.
    pub newly_fixed: Vec<Flipped>,
    /// Starts on which an ado breaks its rule against the new ego only.
    pub no_answer: Vec<Flipped>,
    /// Starts that an ego did not run.
    pub not_run: NotRun,
    /// Starts from which both fail.
    pub both_fail: usize,
    /// Starts of these with Δv up by more than 20 %.
    pub more_severe: Vec<MoreSevere>,
    /// Number of these with Δv down as much.
    pub less_severe: usize,
    /// Number of starts from which the baseline does not fail, with all rules kept.
    pub baseline_passes: usize,
    /// Closing speeds of the baseline where both fail in contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closing_before_mps: Option<ClosingSpeed>,
    /// Closing speeds of the new ego on the same starts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closing_after_mps: Option<ClosingSpeed>,
    /// Exact two-sided p-value of McNemar's test on the flipped starts with an answer.
    pub p_value: f64,
    /// Outcome on the new ego per start. Empty in gates of campaigns.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        with = "as_json::words"
    )]
    pub outcomes: Vec<StartOutcome>,
    /// The same comparison while the ados take their neutral action, if it was made.
    #[serde(skip)]
    pub without_adversary: Option<Box<Gate>>,
}

/// Gate with its decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DecidedGate {
    /// Comparison that is decided.
    #[serde(flatten)]
    pub gate: Gate,
    /// Newly failing starts by avoidability.
    pub newly_failing_by: NewlyFailingCounts,
    /// Values of `--on` by which the gate was decided.
    #[serde(with = "as_json::words")]
    pub on: Vec<GateOn>,
    /// Values of `--on` that close the gate, with an adversary or without. Empty: it is open.
    #[serde(with = "as_json::words")]
    pub closed_by: Vec<GateOn>,
    /// The decision while the ados take their neutral action, if it was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    without_adversary: Option<Box<DecidedGate>>,
}

impl Gate {
    /// Compares two egos against the same ado on the same starts.
    ///
    /// The crashes are not labelled yet ([`Gate::label`]).
    pub fn of(new: GateEgo<'_>, old: GateEgo<'_>) -> Gate {
        let flips = Flips::of(new.outcomes, old.outcomes);
        let flipped = |starts: &[usize], failing: GateEgo<'_>| -> Vec<Flipped> {
            let one = |&start: &usize| Flipped {
                start,
                before: old.outcomes[start],
                now: new.outcomes[start],
                closing_mps: failing.contacts.get(&start).map(|it| it.closing_mps),
                // Labels take replays by other drivers, which follow once the flips are
                // known.
                avoidability: Avoidability::Unknown,
            };
            starts.iter().map(one).collect()
        };
        // Only pairs of contacts are counted, so both lists describe the same starts.
        let both = flips.both_fail.iter();
        let closing = |of: GateEgo<'_>, start| Some(of.contacts.get(start)?.closing_mps);
        let both = both.filter_map(|start| Some((closing(old, start)?, closing(new, start)?)));
        let (before, after): (Vec<f64>, Vec<f64>) = both.unzip();
        let compare = |one, other| {
            let starts = flips.both_fail.iter();
            starts.filter_map(move |&start| MoreSevere::of(start, one, other))
        };
        // A start on which an ado breaks its rule, or that did not run, shows nothing.
        let passes =
            |it: &&StartOutcome| matches!(it, StartOutcome::Held | StartOutcome::Uncounted);
        Gate {
            ego: new.name.to_owned(),
            baseline: old.name.to_owned(),
            compared: flips.compared,
            answered: flips.answered,
            newly_failing: flipped(&flips.newly_failing, new),
            newly_fixed: flipped(&flips.newly_fixed, old),
            no_answer: flipped(&flips.no_answer, old),
            not_run: NotRun {
                ego: flips.new_not_run,
                baseline: flips.old_not_run,
            },
            both_fail: flips.both_fail.len(),
            more_severe: compare(new, old).collect(),
            less_severe: compare(old, new).count(),
            baseline_passes: old.outcomes.iter().filter(passes).count(),
            closing_before_mps: ClosingSpeed::of(before),
            closing_after_mps: ClosingSpeed::of(after),
            p_value: flips.p_value(),
            outcomes: Vec::new(),
            without_adversary: None,
        }
    }

    /// Labels the newly failing starts, in order.
    pub fn label(&mut self, labels: impl IntoIterator<Item = Avoidability>) {
        for (flipped, label) in self.newly_failing.iter_mut().zip(labels) {
            flipped.avoidability = label;
        }
    }

    /// Returns the newly failing starts by avoidability.
    pub fn newly_failing_by(&self) -> NewlyFailingCounts {
        let mut counts = NewlyFailingCounts::default();
        for flipped in &self.newly_failing {
            let count = match flipped.avoidability {
                Avoidability::Preventable => &mut counts.preventable,
                Avoidability::Avoidable => &mut counts.avoidable,
                Avoidability::Unavoidable => &mut counts.unavoidable,
                Avoidability::Unknown => &mut counts.unknown,
            };
            *count += 1;
        }
        counts
    }

    /// Returns the number of starts that close the gate for a reason.
    fn closing(&self, on: GateOn) -> usize {
        let counts = self.newly_failing_by();
        match on {
            // Unknown is no excuse, so only unavoidable crashes are excluded.
            GateOn::UnlessUnavoidable => self.newly_failing.len() - counts.unavoidable,
            GateOn::Preventable => counts.preventable,
            GateOn::Any => self.newly_failing.len(),
            GateOn::Never => 0,
            GateOn::Severity => self.more_severe.len(),
        }
    }

    /// Returns whether severity closes a gate in which no start can fail newly.
    ///
    /// The baseline fails from every start then, so a worse ego shows in its
    /// contacts only. It is worse if more starts become more severe than become
    /// less severe or are fixed.
    fn severity_decides(&self) -> bool {
        // A fixed start is the greatest fall of severity.
        let better = self.less_severe + self.newly_fixed.len();
        self.baseline_passes == 0 && self.more_severe.len() > better
    }

    /// Returns whether no start has an answer on both egos.
    pub fn is_unanswered(&self) -> bool {
        // A newly failing start is an answer, even where the baseline has none.
        self.answered == 0 && self.newly_failing.is_empty()
    }

    /// Decides the gate for some reasons, of which any closes it.
    pub fn decided(mut self, on: &[GateOn]) -> DecidedGate {
        let undecided = self.without_adversary.take();
        let alone = undecided.map(|gate| Box::new(gate.decided(on)));
        let closes_alone = |on: &GateOn| alone.as_ref().is_some_and(|it| it.closed_by.contains(on));
        let requested = requested(on);
        let mut closed_by: Vec<GateOn> = requested
            .iter()
            .copied()
            .filter(|on| self.closing(*on) > 0 || closes_alone(on))
            .collect();
        // Reasons that were chosen by name are taken by their word.
        let by_default = requested.contains(&GateOn::UnlessUnavoidable);
        let by_severity = self.severity_decides() || closes_alone(&GateOn::Severity);
        if by_default && by_severity && !closed_by.contains(&GateOn::Severity) {
            closed_by.push(GateOn::Severity);
        }
        DecidedGate {
            newly_failing_by: self.newly_failing_by(),
            on: requested,
            closed_by,
            without_adversary: alone,
            gate: self,
        }
    }
}

impl DecidedGate {
    /// Returns a contradiction in a gate that was read, `None` without one.
    pub fn contradiction(&self) -> Option<String> {
        let gate = &self.gate;
        // Checked first, because the decision below is made from the starts and
        // not from the counts.
        if self.newly_failing_by != gate.newly_failing_by() {
            return Some("`newly_failing_by` does not count `newly_failing`".to_owned());
        }
        // A file may have been edited, so its decision is made anew from its starts.
        let again = self.undecided().decided(&self.on);
        if again.closed_by != self.closed_by {
            let words = |all: &[GateOn]| {
                let words: Vec<&str> = all.iter().map(<&str>::from).collect();
                format!("[{}]", words.join(", "))
            };
            return Some(format!(
                "`closed_by` is {}, but `on` and the starts give {}",
                words(&self.closed_by),
                words(&again.closed_by)
            ));
        }
        let alone = self.without_adversary.as_ref();
        if let Some(why) = alone.and_then(|alone| alone.contradiction()) {
            return Some(format!("`without_adversary`: {why}"));
        }
        let changed = [&gate.newly_failing, &gate.newly_fixed, &gate.no_answer];
        let changed: usize = changed.iter().map(|starts| starts.len()).sum();
        (gate.compared < changed.max(gate.both_fail))
            .then(|| "`compared` has fewer starts than the changes".to_owned())
    }

    /// Returns the comparison before its decision.
    fn undecided(&self) -> Gate {
        let alone = self.without_adversary.as_ref();
        Gate {
            without_adversary: alone.map(|alone| Box::new(alone.undecided())),
            ..self.gate.clone()
        }
    }

    /// Returns whether the gate blocks the new ego.
    pub fn is_closed(&self) -> bool {
        !self.closed_by.is_empty()
    }
}

/// Returns the reasons, with the default one if none is about newly failing starts.
fn requested(on: &[GateOn]) -> Vec<GateOn> {
    let mut all: Vec<GateOn> = Vec::new();
    // Severity is an addition, and alone it must not open the gate for new failures.
    if on.iter().all(|on| *on == GateOn::Severity) {
        all.push(GateOn::default());
    }
    for on in on {
        if !all.contains(on) {
            all.push(*on);
        }
    }
    all
}

impl MoreSevere {
    /// Compares the failures of a start. `None`: the new one is not more severe.
    fn of(start: usize, new: GateEgo<'_>, old: GateEgo<'_>) -> Option<MoreSevere> {
        // Without a contact of the ego its velocity does not change.
        let delta_v_mps = |of: GateEgo<'_>| {
            let contact = of.contacts.get(&start);
            contact.and_then(|it| it.ego_delta_v_mps).unwrap_or(0.0)
        };
        let (before_mps, now_mps) = (delta_v_mps(old), delta_v_mps(new));
        // A product and no quotient, because the baseline's Δv may be 0.
        (now_mps > MORE_SEVERE * before_mps).then_some(MoreSevere {
            start,
            before_mps,
            now_mps,
        })
    }

    /// Returns the greatest rise of Δv.
    fn worst(all: &[MoreSevere]) -> Option<MoreSevere> {
        let rise = |one: &MoreSevere| one.now_mps - one.before_mps;
        let all = all.iter().copied();
        // Strictly greater, so that the first of equal starts is named.
        all.reduce(|a, b| if rise(&b) > rise(&a) { b } else { a })
    }
}

#[cfg(test)]
mod tests;
