//! Comparison of an ego with its predecessor under the trained ado.

use std::collections::BTreeMap;

use super::gate::{Gate, GateContact, GateEgo};
use super::table::EvaluationTable;
use crate::evaluation::error::EvaluationError;
use crate::experiment::{EpisodeLoop, Watch};
use crate::search::{ExperimentCell, StartResult};
use crate::stats::StartOutcome;

impl EvaluationTable<'_> {
    /// Compares every other ego with `baseline`, under the trained ado and without one.
    ///
    /// Every newly failing start is labelled with its avoidability. Requires
    /// [`super::evaluation_plan::Evaluation::keeps`].
    ///
    /// # Errors
    /// Returns an error if two egos have different starts, which cannot be paired.
    pub fn gates(&self, baseline: &str, watch: &Watch<'_>) -> Result<Vec<Gate>, EvaluationError> {
        // An interruption may come before the baseline was played.
        let Some(old) = cell_of(&self.found, baseline) else {
            return Ok(Vec::new());
        };
        let others = self.found.iter().filter(|it| it.ego.name() != baseline);
        let gate = |new: &ExperimentCell| -> Result<Gate, EvaluationError> {
            let mut gate = labelled(new, old, watch)?;
            // A weak ego may fail by itself where the ado cannot act on it.
            let [new_alone, old_alone] =
                [new, old].map(|cell| cell_of(&self.alone, cell.ego.name()));
            if let (Some(new), Some(old)) = (new_alone, old_alone) {
                gate.without_adversary = Some(Box::new(labelled(new, old, watch)?));
            }
            Ok(gate)
        };
        others.map(gate).collect()
    }
}

fn cell_of<'a>(cells: &'a [ExperimentCell], ego: &str) -> Option<&'a ExperimentCell> {
    cells.iter().find(|cell| cell.ego.name() == ego)
}

/// Compares two egos, and labels the newly failing starts.
fn labelled(
    new: &ExperimentCell,
    old: &ExperimentCell,
    watch: &Watch<'_>,
) -> Result<Gate, EvaluationError> {
    // Flips are paired by position, which means nothing on other starts.
    if new.starts.starts != old.starts.starts {
        return Err(EvaluationError::StartsDiffer {
            ego: new.ego.name().to_owned(),
            baseline: old.ego.name().to_owned(),
        });
    }
    let mut gate = compared(new, old);
    gate.outcomes = new.outcomes();
    label(&mut gate, new, watch);
    Ok(gate)
}

/// Compares two egos against the same ado on the same starts.
fn compared(new: &ExperimentCell, old: &ExperimentCell) -> Gate {
    let [new_contacts, old_contacts] = [new, old].map(contacts);
    let [new_outcomes, old_outcomes] = [new, old].map(ExperimentCell::outcomes);
    Gate::of(
        GateEgo {
            name: new.ego.name(),
            outcomes: &new_outcomes,
            contacts: &new_contacts,
        },
        GateEgo {
            name: old.ego.name(),
            outcomes: &old_outcomes,
            contacts: &old_contacts,
        },
    )
}

/// Returns the contacts after the failures of an ego.
fn contacts(of: &ExperimentCell) -> BTreeMap<usize, GateContact> {
    let results = of.results.iter().enumerate();
    let contact = |result: &StartResult| {
        // A contact after a verdict without failure is not the crash of the start.
        let failed = result.outcome == StartOutcome::Solved && !of.row.is_unrepeatable();
        Some(GateContact {
            closing_mps: result.closing_speed_mps.filter(|_| failed)?,
            ego_delta_v_mps: result.impact.map(|impact| impact.ego_delta_v_mps),
        })
    };
    results
        .filter_map(|(start, result)| Some((start, contact(result.as_ref()?)?)))
        .collect()
}

/// Labels every newly failing start with its avoidability.
fn label(gate: &mut Gate, found: &ExperimentCell, watch: &Watch<'_>) {
    let scenario = found.ego.scenario();
    let labels = EpisodeLoop::uncounted(watch).run(
        &gate.newly_failing,
        || scenario.bench(),
        |bench, flipped, _| {
            // Rows have no motion, and the reference drivers need all of it.
            let episode = found.replay(bench, flipped.start);
            Some(scenario.preventability(&episode).avoidability())
        },
    );
    // The loop returns its results in the order of the starts. One that an interruption
    // left out is unknown.
    gate.label(labels.into_iter().map(Option::unwrap_or_default));
}
