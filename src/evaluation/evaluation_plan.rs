//! What is asked of an evaluation, and what is found for it.

use crate::adversary::{Ado, AdoKind, EvalRequest, Evaluated, Tried, Tries};
use crate::evaluation::error::EvaluationError;
use crate::experiment::{EgoUnderTest, TestStarts};
use crate::run_dir::RunDir;
use crate::stl::Explanation;
use crate::surrogate::AdaptedRow;
use crate::sysid::{ConditionedAdo, ContextSource, LEAST_RUNS};
use crate::world::Scenario;

/// What to evaluate.
#[derive(Clone, Copy)]
pub struct Evaluation<'a> {
    /// The run of the trained ado.
    pub run: &'a RunDir,
    /// Its world, on the plant to test on.
    pub nominal: &'a Scenario,
    /// The egos that are met.
    pub egos: &'a [EgoUnderTest],
    /// Who plays the ado.
    pub ados: &'a [AdoKind],
    /// Whence a conditional ado knows the egos; `None` for any other.
    pub context: Option<&'a ContextSource>,
    /// Test starts to draw, and the seed of their stream.
    pub starts: (usize, u64),
    /// Most switches of a search to compare with, if any.
    pub search: Option<usize>,
    /// Runs of the trained ado per start: the greedy one, then explored ones.
    pub tries: u64,
    /// Runs of each ego from which a surrogate of it is learned; 0: none is.
    pub runs: u64,
    /// Kinds of stock controllers that an ego may not be likened to.
    pub unknown: &'a [&'a str],
    /// Whether [`super::table::EvaluationTable::keep`] is to follow: what it needs of every ego
    /// is held in memory then.
    pub keeps: bool,
}

impl Evaluation<'_> {
    /// Runs of an ego that go into identifying it.
    pub(super) fn identified_from(&self) -> u64 {
        self.context.map_or(0, ContextSource::runs)
    }

    /// Whether more than who it is is learned of every ego.
    pub(super) fn learns(&self) -> bool {
        self.identified_from() < self.runs
    }

    /// Refuses more to be learned than the runs are enough for.
    pub(super) fn can_learn(&self) -> Result<(), EvaluationError> {
        match self.learns() && self.runs < LEAST_RUNS + self.identified_from() {
            false => Ok(()),
            true => Err(EvaluationError::TooFewRuns { runs: self.runs }),
        }
    }

    pub(super) fn trained<'b>(
        &self,
        ego: &'b EgoUnderTest,
        ado: &'b ConditionedAdo,
        starts: &'b TestStarts,
    ) -> EvalRequest<'b> {
        ego.met_by(Ado::Trained(&*ado.policy, self.run.manifest().seed), starts)
    }

    pub(super) fn several<'b>(
        &self,
        request: EvalRequest<'b>,
        ado: &'b ConditionedAdo,
    ) -> Tries<'b> {
        Tries {
            request,
            policy: &*ado.policy,
            others: &ado.others,
            tries: self.tries,
        }
    }
}

/// Why the first counterexample of an ego is one.
#[derive(Clone, Debug, serde::Serialize)]
pub struct ExplainedCounterexample {
    /// Name of the ego that fails, as rows call it.
    pub ego: String,
    /// Position of the start among the test starts.
    pub start: usize,
    /// The requirement that ψ_ego stands for, if the world names one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
    /// Which leaf decides, when, and with which value.
    #[serde(rename = "explain")]
    pub explanation: Explanation,
}

/// Whose counterexamples they are.
pub(crate) enum FoundBy {
    Trained(Evaluated),
    /// The trained ado's, with several tries per start.
    Tries(Tried),
    /// The ado's that plans in a surrogate of the ego.
    Adapted(AdaptedRow),
    /// The best ado's of a grid world.
    Optimal(Evaluated),
}

impl FoundBy {
    /// What was played.
    pub fn evaluated(&self) -> &Evaluated {
        match self {
            FoundBy::Trained(evaluated) | FoundBy::Optimal(evaluated) => evaluated,
            FoundBy::Tries(tried) => &tried.evaluated,
            FoundBy::Adapted(adapted) => &adapted.evaluated,
        }
    }
}
