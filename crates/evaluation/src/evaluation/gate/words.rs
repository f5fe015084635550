//! Gate in words: the comparison, remarks and the decision.

use std::fmt::{self, Display, Formatter};

use super::{DecidedGate, Flipped, Gate, GateOn, MoreSevere, NewlyFailingCounts, NotRun};
use crate::run_dir::counted;
use crate::stats::StartOutcome;

impl Display for NewlyFailingCounts {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} preventable, ", self.preventable)?;
        if self.avoidable > 0 {
            write!(f, "{} avoided by other drivers only, ", self.avoidable)?;
        }
        write!(
            f,
            "{} unavoidable, {} unknown",
            self.unavoidable, self.unknown
        )
    }
}

impl Display for DecidedGate {
    /// Writes the decision, and below it the comparison and remarks.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.lines().join("\n"))
    }
}

impl Gate {
    /// Returns a sentence per group of starts that are neither failing nor fixed.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        let has_failures =
            self.both_fail > 0 || !self.newly_failing.is_empty() || !self.newly_fixed.is_empty();
        if self.compared > 0 && !has_failures {
            remarks.push(format!(
                "neither ego fails from any of {}, so this ado tests neither: look for \
                 crashes of `{}` with `brakecheck search`, or train an ado against it",
                counted(self.compared, "start"),
                self.baseline
            ));
        }
        if !self.no_answer.is_empty() {
            let failed = self
                .no_answer
                .iter()
                // Against the baseline the ego must have failed in a way that counts.
                .filter(|it| it.before != StartOutcome::Held)
                .filter(|it| it.before != StartOutcome::Uncounted)
                .count();
            remarks.push(format!(
                "no answer from {}, on which an ado breaks its rule against `{}` ({failed} \
                 of them fail on `{}` and count as neither failing nor fixed)",
                counted(self.no_answer.len(), "start"),
                self.ego,
                self.baseline
            ));
        }
        let was_broken = |it: &&Flipped| it.before == StartOutcome::RuleViolation;
        match self.newly_failing.iter().filter(was_broken).count() {
            0 => {}
            some => remarks.push(format!(
                "{some} of the newly failing have no answer on `{}`: an ado breaks its rule there",
                self.baseline
            )),
        }
        let now = self
            .newly_fixed
            .iter()
            .filter(|it| it.now == StartOutcome::Uncounted);
        match now.count() {
            0 => {}
            some => remarks.push(format!(
                "{some} of the newly fixed still violate the specification, but not so that it counts"
            )),
        }
        let NotRun { ego, baseline } = self.not_run;
        if ego + baseline > 0 {
            remarks.push(format!(
                "not compared: `{}` did not run from {}, `{}` from {baseline}",
                self.ego,
                counted(ego, "start"),
                self.baseline
            ));
        }
        remarks
    }
}

impl DecidedGate {
    /// Returns the decision, the comparison and the remarks, a line each.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!("gate {}", self.decision()), self.comparison()];
        lines.extend(self.remarks());
        lines
    }

    /// Returns a sentence per remark on the comparison.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = self.gate.remarks();
        remarks.extend(self.severity());
        let alone = self.without_adversary.as_deref();
        remarks.extend(alone.and_then(DecidedGate::alone));
        remarks
    }

    /// Returns a sentence on failures without an adversary, `None` if they are the same.
    fn alone(&self) -> Option<String> {
        let failing = self.gate.newly_failing.len();
        let severity = self.severity();
        let failing =
            (failing > 0).then(|| format!("{failing} newly failing ({})", self.newly_failing_by));
        let parts: Vec<String> = failing.into_iter().chain(severity).collect();
        (!parts.is_empty()).then(|| {
            let starts = counted(self.gate.compared, "start");
            format!("without an adversary, {starts}: {}", parts.join("; "))
        })
    }

    fn comparison(&self) -> String {
        let gate = &self.gate;
        let failing = match gate.newly_failing.len() {
            0 => "0 newly failing".to_owned(),
            some => format!("{some} newly failing ({})", self.newly_failing_by),
        };
        let speeds = match (gate.closing_before_mps, gate.closing_after_mps) {
            (Some(before), Some(after)) => format!(
                "; closing there {:.1} / {:.1} m/s before, {:.1} / {:.1} m/s now (median / 90 %)",
                before.median, before.p90, after.median, after.p90
            ),
            _ => String::new(),
        };
        format!(
            "`{}` against `{}`, {}: {failing}, {} newly fixed, {} fail on both{speeds}; \
             exact McNemar p = {:.2e}",
            gate.ego,
            gate.baseline,
            counted(gate.compared, "start"),
            gate.newly_fixed.len(),
            gate.both_fail,
            gate.p_value
        )
    }

    fn severity(&self) -> Option<String> {
        let worst = MoreSevere::worst(&self.gate.more_severe)?;
        let blocks = self.closed_by.contains(&GateOn::Severity);
        let word = if blocks { "" } else { "warning: " };
        Some(format!(
            "{word}{} of the {} that fail on both fail more severely (Δv of the ego up by more \
             than 20 %), the worst from start {}: {:.1} m/s before, {:.1} m/s now",
            self.gate.more_severe.len(),
            self.gate.both_fail,
            worst.start,
            worst.before_mps,
            worst.now_mps
        ))
    }

    /// Returns the decision with its reason, to follow "gate".
    pub fn decision(&self) -> String {
        let reason = |on: &GateOn| {
            let alone = self.without_adversary.as_ref();
            let closing_alone = alone.map_or(0, |alone| alone.gate.closing(*on));
            let starts = match (self.gate.closing(*on), closing_alone) {
                (some, 0) => some.to_string(),
                (some, alone) => format!("{some}, and without an adversary {alone},"),
            };
            let is_one = (self.gate.closing(*on), closing_alone) == (1, 0);
            let noun = if is_one { "start" } else { "starts" };
            let fail = if is_one { "fails" } else { "fail" };
            match on {
                GateOn::UnlessUnavoidable => format!(
                    "{starts} newly failing {noun} that {} not shown to be unavoidable",
                    if is_one { "is" } else { "are" }
                ),
                GateOn::Preventable => format!("{starts} preventable newly failing {noun}"),
                // The baseline of one of the two comparisons leaves nothing else to see.
                GateOn::Severity if self.gate.severity_decides() => format!(
                    "{starts} {noun} that {fail} more severely, since no start is left to fail \
                     newly: the baseline fails from all"
                ),
                GateOn::Severity => format!("{starts} {noun} that {fail} more severely"),
                // `Never` closes no gate, so it is never a reason.
                GateOn::Any | GateOn::Never => format!("{starts} newly failing {noun}"),
            }
        };
        let reasons: Vec<String> = self.closed_by.iter().map(reason).collect();
        match &reasons[..] {
            [] if self.gate.is_unanswered() => {
                "without an answer: no start has a result on both egos with every rule kept"
                    .to_owned()
            }
            [] => "open".to_owned(),
            reasons => format!("closed by {}", reasons.join(", and by ")),
        }
    }
}
