//! Comparison of an ego with its predecessor under the same ado.

use serde::Serialize;

use super::evaluation_plan::FoundBy;
use super::table::{EvaluationTable, FoundCounterexamples};
use crate::adversary::{BestOfNResult, Evaluated};
use crate::evaluation::error::EvaluationError;
use crate::experiment::{EpisodeLoop, TestStarts, Watch};
use crate::run_dir::ClosingSpeed;
use crate::stats::StartOutcome;
use crate::stats::mcnemar;
use crate::testbench::Testbench;

/// Start with another outcome on the new ego.
#[derive(Clone, Debug, Serialize)]
pub struct Flipped {
    /// Position of the start.
    pub start: usize,
    /// Closing speed on the ego that fails, if it ends in contact.
    pub closing_mps: Option<f64>,
    /// True if CC_LATCHED or FSM in that ego's place would have avoided the failure.
    ///
    /// `None`: such an encounter cannot be judged.
    pub preventable: Option<bool>,
}

/// Comparison of a new ego with a baseline under the trained ado, start by start.
#[derive(Clone, Debug, Serialize)]
pub struct Gate {
    /// Name of the new ego.
    pub ego: String,
    /// Name of the baseline ego.
    pub baseline: String,
    /// Starts that are valid and not trivial for both.
    pub compared: usize,
    /// Starts from which the new ego fails and the baseline does not.
    pub newly_failing: Vec<Flipped>,
    /// Starts from which the baseline fails and the new ego does not.
    pub newly_fixed: Vec<Flipped>,
    /// Starts from which both fail.
    pub both_fail: usize,
    /// Closing speeds of the baseline where both fail in contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing_before_mps: Option<ClosingSpeed>,
    /// Closing speeds of the new ego on the same starts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing_after_mps: Option<ClosingSpeed>,
    /// Exact two-sided p-value of McNemar's test on the flipped starts.
    pub p_value: f64,
}

impl Gate {
    /// Returns whether a newly failing start was avoidable for CC_LATCHED or FSM.
    pub fn is_newly_preventable(&self) -> bool {
        let mut starts = self.newly_failing.iter();
        starts.any(|start| start.preventable == Some(true))
    }

    /// Compares two evaluations of the same ado over the same starts.
    fn of((ego, new): (&str, &Evaluated), (baseline, old): (&str, &Evaluated)) -> Gate {
        let mut gate = Gate {
            ego: ego.to_owned(),
            baseline: baseline.to_owned(),
            compared: 0,
            newly_failing: Vec::new(),
            newly_fixed: Vec::new(),
            both_fail: 0,
            closing_before_mps: None,
            closing_after_mps: None,
            p_value: 1.0,
        };
        let closing = |of: &Evaluated, start: usize| {
            let outcome = of.outcomes.get(start).copied().flatten();
            outcome.and_then(|outcome| outcome.closing_speed_mps)
        };
        let (mut before, mut after) = (Vec::new(), Vec::new());
        let pairs = new.row.solved.iter().zip(old.row.solved.iter());
        for (start, (new_one, old_one)) in pairs.enumerate() {
            use StartOutcome::{Solved, Unsolved};
            let flipped = |of| Flipped {
                start,
                closing_mps: closing(of, start),
                preventable: None,
            };
            match (new_one, old_one) {
                (Solved, Unsolved) => gate.newly_failing.push(flipped(new)),
                (Unsolved, Solved) => gate.newly_fixed.push(flipped(old)),
                (Solved, Solved) => {
                    // Only pairs of contacts are counted, so both lists describe the same starts.
                    gate.both_fail += 1;
                    if let (Some(was), Some(is)) = (closing(old, start), closing(new, start)) {
                        before.push(was);
                        // Preventability is labelled later, because it needs the episode again.
                        after.push(is);
                    }
                }
                (Unsolved, Unsolved) => {}
                // Trivial and invalid starts show no difference between the egos.
                _ => continue,
            }
            gate.compared += 1;
        }
        gate.closing_before_mps = ClosingSpeed::of(before);
        gate.closing_after_mps = ClosingSpeed::of(after);
        gate.p_value = mcnemar(gate.newly_failing.len(), gate.newly_fixed.len());
        gate
    }
}

impl EvaluationTable<'_> {
    /// Compares every other ego with `baseline` under the trained ado.
    ///
    /// Requires [`super::evaluation_plan::Evaluation::keeps`].
    ///
    /// # Errors
    /// Returns an error if two egos have different starts, which cannot be paired.
    pub fn gates(&self, baseline: &str, watch: &Watch<'_>) -> Result<Vec<Gate>, EvaluationError> {
        let mut gates = self.compared(baseline)?;
        for gate in &mut gates {
            if let Some(found) = self.found_of(&gate.ego) {
                self.label(gate, found, watch);
            }
        }
        Ok(gates)
    }

    fn found_of(&self, ego: &str) -> Option<&FoundCounterexamples<'_>> {
        self.found.iter().find(|found| found.ego.name() == ego)
    }

    /// Returns the starts on which an ego was played.
    fn starts_of<'s>(&'s self, found: &'s FoundCounterexamples<'_>) -> &'s TestStarts {
        found.starts.as_ref().unwrap_or(&self.starts)
    }

    /// Labels every newly failing start as preventable or not.
    fn label(&self, gate: &mut Gate, found: &FoundCounterexamples<'_>, watch: &Watch<'_>) {
        let scenario = found.ego.scenario();
        let starts = self.starts_of(found);
        let trained = self.asked.trained(found.ego, &found.ado, starts);
        let play = |bench: &mut Testbench, start: usize| match &found.by {
            FoundBy::Tries(BestOfNResult { winners, .. }) => {
                let tries = self.asked.several(trained, &found.ado);
                // The winning try is repeated, because earlier tries from this start did not succeed.
                tries.play(bench, start, winners[start].unwrap_or(0))
            }
            FoundBy::Adapted(adapted) => adapted.play(bench, starts, start),
            // On a map of cells no failure is preventable, whatever ado plays.
            FoundBy::Trained(_) | FoundBy::Optimal(_) => trained.play(bench, start),
        };
        let labels = EpisodeLoop::uncounted(watch).run(
            &gate.newly_failing,
            || scenario.bench(),
            |bench, flipped, _| {
                let evaluated = found.by.evaluated();
                let mut play = |bench: &mut Testbench, start| play(bench, start);
                let episode = evaluated.again(&trained, bench, flipped.start, &mut play);
                scenario.preventability(&episode).human_model_avoids()
            },
        );
        // The loop returns its results in the order of the starts.
        for (flipped, label) in gate.newly_failing.iter_mut().zip(labels) {
            flipped.preventable = label;
        }
    }

    fn compared(&self, baseline: &str) -> Result<Vec<Gate>, EvaluationError> {
        let Some(old) = self.found_of(baseline) else {
            return Ok(Vec::new());
        };
        let others = self
            .found
            .iter()
            .filter(|found| found.ego.name() != baseline);
        others
            .map(|new| {
                if self.starts_of(new).starts == self.starts_of(old).starts {
                    Ok(Gate::of(
                        (new.ego.name(), new.by.evaluated()),
                        (baseline, old.by.evaluated()),
                    ))
                } else {
                    Err(EvaluationError::StartsDiffer {
                        ego: new.ego.name().to_owned(),
                        baseline: baseline.to_owned(),
                    })
                }
            })
            .collect()
    }
}
