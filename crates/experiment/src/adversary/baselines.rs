//! Baselines of a run that the ados of an evaluation need: the heuristic, and replays.

use super::error::AdversaryError;
use super::threshold_rule::{Heuristic, tune_heuristic};
use crate::experiment::Watch;
use crate::run_dir::{AdversaryId, RunDir, Stored};
use crate::world::Scenario;

/// Baselines of a run, made once for all egos of an evaluation.
#[derive(Debug)]
pub struct Baselines {
    /// Tuned rule, if an ado is one.
    pub heuristic: Option<Heuristic>,
    /// Counterexamples of the training, if an ado replays them.
    pub stored: Option<Stored>,
}

impl Baselines {
    /// Makes the baselines that the adversaries need.
    ///
    /// The heuristic is tuned on the run's training starts, and the run's
    /// counterexamples are read.
    ///
    /// # Errors
    /// The world's ado observes nothing, or the run stores no counterexamples.
    pub fn of(
        ados: &[AdversaryId],
        run: &RunDir,
        nominal: &Scenario,
        watch: &Watch<'_>,
    ) -> Result<Baselines, AdversaryError> {
        // The tuning takes thousands of episodes, so only a request pays for it.
        let heuristic = if ados.contains(&AdversaryId::Heuristic) {
            tuned(run, nominal, watch)?
        } else {
            None
        };
        let replays = ados
            .iter()
            .any(|ado| matches!(ado, AdversaryId::Replays { .. }));
        Ok(Baselines {
            heuristic,
            // Reading them parses every line and draws every start again, so only a
            // request pays.
            stored: replays.then(|| run.counterexamples()).transpose()?,
        })
    }
}

fn tuned(
    run: &RunDir,
    nominal: &Scenario,
    watch: &Watch<'_>,
) -> Result<Option<Heuristic>, AdversaryError> {
    let heuristic = tune_heuristic(nominal, run.manifest().seed, watch);
    match &heuristic {
        Some(heuristic) => watch.note(&format!(
            "tuned the heuristic in {:.1} s of processor time: it solves {:.0} % of its training starts",
            heuristic.cost.cpu_s,
            100.0 * heuristic.successes
        )),
        // A stop leaves no rule either, which says nothing about the observation.
        None if watch.stopped() => {}
        None => {
            return Err(AdversaryError::NothingObserved {
                world: nominal.name.clone(),
            });
        }
    }
    Ok(heuristic)
}
