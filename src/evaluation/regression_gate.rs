//! Comparison of an ego with its predecessor under the same ado.

use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::evaluation_plan::FoundBy;
use super::table::{EvaluationTable, FoundCounterexamples};
use crate::adversary::{BestOfNResult, Evaluated};
use crate::evaluation::error::EvaluationError;
use crate::experiment::{EpisodeLoop, TestStarts, Watch};
use crate::run_dir::ClosingSpeed;
use crate::stats::Flips;
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

/// Newly failing starts that block a change.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    VariantArray,
    EnumString,
    IntoStaticStr,
    EnumMessage,
)]
#[strum(serialize_all = "kebab-case")]
pub enum GateOn {
    /// Those that CC_LATCHED or FSM would have avoided.
    #[default]
    Preventable,
    /// All of them.
    Any,
    /// None.
    Never,
}

impl GateOn {
    /// Returns whether newly failing starts block a change, by their preventability.
    pub fn holds_up(self, newly_failing: impl IntoIterator<Item = Option<bool>>) -> bool {
        newly_failing.into_iter().any(|preventable| match self {
            GateOn::Preventable => preventable == Some(true),
            GateOn::Any => true,
            GateOn::Never => false,
        })
    }
}

impl Gate {
    /// Returns whether the gate blocks the new ego.
    pub fn holds_up(&self, on: GateOn) -> bool {
        on.holds_up(self.newly_failing.iter().map(|start| start.preventable))
    }

    /// Compares two evaluations of the same ado over the same starts.
    fn of((ego, new): (&str, &Evaluated), (baseline, old): (&str, &Evaluated)) -> Gate {
        let closing = |of: &Evaluated, start: usize| {
            let outcome = of.outcomes.get(start).copied().flatten();
            outcome.and_then(|outcome| outcome.closing_speed_mps)
        };
        // Preventability is labelled later, because it needs the episode again.
        let flipped = |of: &Evaluated, starts: &[usize]| -> Vec<Flipped> {
            let one = |&start: &usize| Flipped {
                start,
                closing_mps: closing(of, start),
                preventable: None,
            };
            starts.iter().map(one).collect()
        };
        let flips = Flips::of(&new.row.solved, &old.row.solved);
        // Only pairs of contacts are counted, so both lists describe the same starts.
        let both = flips.both_fail.iter();
        let both = both.filter_map(|&start| Some((closing(old, start)?, closing(new, start)?)));
        let (before, after): (Vec<f64>, Vec<f64>) = both.unzip();
        Gate {
            ego: ego.to_owned(),
            baseline: baseline.to_owned(),
            compared: flips.compared,
            newly_failing: flipped(new, &flips.newly_failing),
            newly_fixed: flipped(old, &flips.newly_fixed),
            both_fail: flips.both_fail.len(),
            closing_before_mps: ClosingSpeed::of(before),
            closing_after_mps: ClosingSpeed::of(after),
            p_value: flips.p_value(),
        }
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
            // On a grid no failure is preventable, whatever the ado.
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
