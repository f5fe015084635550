//! One ado on an ego and on the one before it: what fails newly, what is mended.

use serde::Serialize;

use super::evaluation_plan::FoundBy;
use super::table::{EvaluationTable, Found};
use crate::adversary::{Evaluated, Tried};
use crate::evaluation::error::EvaluationError;
use crate::experiment::{EpisodeLoop, TestStarts, Watch};
use crate::run_dir::ClosingSpeed;
use crate::stats::StartOutcome;
use crate::stats::mcnemar;
use crate::testbench::Testbench;

/// A start whose outcome is another on the new ego.
#[derive(Clone, Debug, Serialize)]
pub struct Flipped {
    /// Position of the start.
    pub start: usize,
    /// Closing speed on the ego that fails there, if it ends in contact.
    pub closing_mps: Option<f64>,
    /// Whether CC_LATCHED or FSM in that ego's place would have avoided it;
    /// `None`: nobody judges such an encounter.
    pub preventable: Option<bool>,
}

/// The trained ado on a new ego against a baseline, start by start.
#[derive(Clone, Debug, Serialize)]
pub struct Gate {
    /// The new ego.
    pub ego: String,
    /// The one it is compared with.
    pub baseline: String,
    /// Starts that tell something of both.
    pub compared: usize,
    /// Starts from which the new ego fails and the baseline does not.
    pub newly_failing: Vec<Flipped>,
    /// Starts from which the baseline fails and the new ego does not.
    pub newly_fixed: Vec<Flipped>,
    /// Starts from which both fail.
    pub both_fail: usize,
    /// Where both fail in contact: closing speeds of the baseline.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing_before_mps: Option<ClosingSpeed>,
    /// The same of the new ego.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing_after_mps: Option<ClosingSpeed>,
    /// Exact two-sided p-value of McNemar's test on the flipped starts.
    pub p_value: f64,
}

impl Gate {
    /// Whether a start fails newly that CC_LATCHED or FSM would have survived.
    pub fn is_newly_preventable(&self) -> bool {
        let mut starts = self.newly_failing.iter();
        starts.any(|start| start.preventable == Some(true))
    }

    /// Compares two evaluations of one ado over the same starts.
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
                    gate.both_fail += 1;
                    if let (Some(was), Some(is)) = (closing(old, start), closing(new, start)) {
                        before.push(was);
                        after.push(is);
                    }
                }
                (Unsolved, Unsolved) => {}
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
    /// Compares every other ego with `baseline`, by what the trained ado did to
    /// them; needs [`super::evaluation_plan::Evaluation::keeps`].
    ///
    /// # Errors
    /// Two egos do not start alike, so that nothing pairs their starts.
    pub fn gates(&self, baseline: &str, watch: &Watch<'_>) -> Result<Vec<Gate>, EvaluationError> {
        let mut gates = self.compared(baseline)?;
        for gate in &mut gates {
            if let Some(found) = self.found_of(&gate.ego) {
                self.label(gate, found, watch);
            }
        }
        Ok(gates)
    }

    fn found_of(&self, ego: &str) -> Option<&Found<'_>> {
        self.found.iter().find(|found| found.ego.name() == ego)
    }

    /// The starts from which an ego was met.
    fn starts_of<'s>(&'s self, found: &'s Found<'_>) -> &'s TestStarts {
        found.starts.as_ref().unwrap_or(&self.starts)
    }

    /// Says of every newly failing start whether it was preventable.
    fn label(&self, gate: &mut Gate, found: &Found<'_>, watch: &Watch<'_>) {
        let scenario = found.ego.scenario();
        let starts = self.starts_of(found);
        let trained = self.asked.trained(found.ego, &found.ado, starts);
        let play = |bench: &mut Testbench, start: usize| match &found.by {
            FoundBy::Tries(Tried { winners, .. }) => {
                let tries = self.asked.several(trained, &found.ado);
                tries.play(bench, start, winners[start].unwrap_or(0))
            }
            FoundBy::Adapted(adapted) => adapted.play(bench, starts, start),
            // On a map of cells nothing is preventable, whoever plays.
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
            .map(
                |new| match self.starts_of(new).starts == self.starts_of(old).starts {
                    true => Ok(Gate::of(
                        (new.ego.name(), new.by.evaluated()),
                        (baseline, old.by.evaluated()),
                    )),
                    false => Err(EvaluationError::StartsDiffer {
                        ego: new.ego.name().to_owned(),
                        baseline: baseline.to_owned(),
                    }),
                },
            )
            .collect()
    }
}
