//! Comparison of an ego with its predecessor under the same ado.

use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::table::EvaluationTable;
use crate::evaluation::error::EvaluationError;
use crate::experiment::{EpisodeLoop, Watch};
use crate::run_dir::ClosingSpeed;
use crate::search::ExperimentCell;
use crate::stats::Flips;

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
    pub fn blocks(self, newly_failing: impl IntoIterator<Item = Option<bool>>) -> bool {
        newly_failing.into_iter().any(|preventable| match self {
            GateOn::Preventable => preventable == Some(true),
            GateOn::Any => true,
            GateOn::Never => false,
        })
    }
}

impl Gate {
    /// Returns whether the gate blocks the new ego.
    pub fn blocks(&self, on: GateOn) -> bool {
        on.blocks(self.newly_failing.iter().map(|start| start.preventable))
    }

    /// Compares two egos against the same ado on the same starts.
    fn of(new: &ExperimentCell, old: &ExperimentCell) -> Gate {
        let closing = |of: &ExperimentCell, start: usize| {
            let result = of.results.get(start)?.as_ref();
            result.and_then(|result| result.closing_speed_mps)
        };
        // Preventability is labelled later, because it needs the episode again.
        let flipped = |of: &ExperimentCell, starts: &[usize]| -> Vec<Flipped> {
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
            ego: new.ego.name().to_owned(),
            baseline: old.ego.name().to_owned(),
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
                label(gate, found, watch);
            }
        }
        Ok(gates)
    }

    fn found_of(&self, ego: &str) -> Option<&ExperimentCell> {
        self.found.iter().find(|found| found.ego.name() == ego)
    }

    fn compared(&self, baseline: &str) -> Result<Vec<Gate>, EvaluationError> {
        let Some(old) = self.found_of(baseline) else {
            return Ok(Vec::new());
        };
        let others = self.found.iter();
        others
            .filter(|found| found.ego.name() != baseline)
            .map(|new| {
                if new.starts.starts == old.starts.starts {
                    Ok(Gate::of(new, old))
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

/// Labels every newly failing start as preventable or not.
fn label(gate: &mut Gate, found: &ExperimentCell, watch: &Watch<'_>) {
    let scenario = found.ego.scenario();
    let labels = EpisodeLoop::uncounted(watch).run(
        &gate.newly_failing,
        || scenario.bench(),
        |bench, flipped, _| {
            let episode = found.replay(bench, flipped.start);
            scenario.preventability(&episode).human_model_avoids()
        },
    );
    // The loop returns its results in the order of the starts.
    for (flipped, label) in gate.newly_failing.iter_mut().zip(labels) {
        flipped.preventable = label;
    }
}
