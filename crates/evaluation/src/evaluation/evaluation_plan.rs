//! Request of an evaluation, and the explanation of a failure.

use std::num::NonZeroU64;

use crate::adversary::GridPolicy;
use crate::evaluation::error::EvaluationError;
use crate::experiment::EgoUnderTest;
use crate::run_dir::{AdversaryId, RunDir};
use crate::stl::Explanation;
use crate::surrogate::LEAST_RUNS;
use crate::testbench::Sampling;
use crate::world::Scenario;

/// Request of an evaluation.
#[derive(Clone, Copy)]
pub struct Evaluation<'a> {
    /// Run of the trained ado.
    pub run: &'a RunDir,
    /// World of the run, on the plant to test on.
    pub nominal: &'a Scenario,
    /// Egos under test.
    pub egos: &'a [EgoUnderTest],
    /// Adversaries to evaluate, such as those of an [`AdoWord`](crate::adversary::AdoWord).
    pub ados: &'a [AdversaryId],
    /// Number of test starts and seed of their stream.
    pub starts: (usize, u64),
    /// Largest number of switches of a search for comparison, if any.
    pub search: Option<usize>,
    /// Most runs per start of a search that the trained ado guides. 1: no such search.
    pub tries: u64,
    /// Drawing of the trained ado's actions, for a row of its own.
    pub sampling: Option<Sampling>,
    /// Runs of each ego from which a surrogate is learned. `None`: no surrogate.
    pub runs: Option<NonZeroU64>,
    /// Kinds of stock controllers that are not compared with an ego.
    pub unknown: &'a [&'a str],
    /// True if the results are kept in memory for [`super::table::EvaluationTable::keep`].
    pub keeps: bool,
}

impl<'a> Evaluation<'a> {
    /// Returns a request of no adversary and no start, with one run of the ado per start.
    ///
    /// You fill in what you request, so a new field needs no change where it is not used.
    pub fn new(run: &'a RunDir, nominal: &'a Scenario, egos: &'a [EgoUnderTest]) -> Evaluation<'a> {
        Evaluation {
            run,
            nominal,
            egos,
            ados: &[],
            starts: (0, 0),
            search: None,
            tries: 1,
            sampling: None,
            runs: None,
            unknown: &[],
            keeps: false,
        }
    }
}

impl Evaluation<'_> {
    /// Checks that the runs are enough for learning.
    pub(super) fn can_learn(&self) -> Result<(), EvaluationError> {
        match self.runs.map(NonZeroU64::get) {
            Some(runs) if runs < LEAST_RUNS => Err(EvaluationError::TooFewRuns { runs }),
            _ => Ok(()),
        }
    }

    /// Checks that the optimal ado, if requested, can be made in the world of each ego.
    pub(super) fn can_solve(&self) -> Result<(), EvaluationError> {
        // Asked before the first episode, because a refusal at a later ego would waste
        // the rows.
        if self.ados.contains(&GridPolicy::Optimal.id()) {
            for ego in self.egos {
                GridPolicy::admits_optimal(ego.scenario())?;
            }
        }
        Ok(())
    }
}

/// Explanation of the first counterexample of an ego.
#[derive(Clone, Debug, serde::Serialize)]
pub struct ExplainedCounterexample {
    /// Name of the failing ego in rows.
    pub ego: String,
    /// Position of the start among the test starts.
    pub start: usize,
    /// Requirement behind ψ_ego, if the world names it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
    /// Deciding leaf, with its time and value.
    #[serde(rename = "explain")]
    pub explanation: Explanation,
}
