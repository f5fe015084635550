//! What a conditional ado is best told of an ego: strategy optimisation.
//!
//! A conditional ado knows a whole family of strategies, one for every member
//! it can be told. Which of them suits an ego need not be the one for the
//! nearest member, least of all for an ego outside of the family. So some
//! members are told in turn on starts that are never reported, and the one under
//! which the ado's mean reward (Definition 4) is best is kept. The policy itself
//! stays as it is (Yu, Liu and Turk 2019, "Policy transfer with strategy
//! optimization").
//!
//! Cross-entropy search proposes the members; those that look best are raced on
//! more starts, and the first member stays unless another beats it there by more
//! than one standard error.

mod contest;

pub use self::contest::Adapted;
use self::contest::{RewardAndSuccess, SuccessiveHalving};
use crate::experiment::{EpisodeLoop, Watch, WorkItem};
use crate::rl::Policy;
use crate::run_dir::{RunDir, RunError};
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Aftermath, PolicyActor, Testbench};
use crate::world::{EgoSample, Family, Scenario};

/// Simulations with which docs/lab/reuse.md was measured: 22 members a generation.
pub const ENOUGH_SIMULATIONS: u64 = 600;
/// With fewer, hardly a member would be proposed.
pub const LEAST_SIMULATIONS: u64 = 200;

/// Calibration starts from here on are for this alone.
const FIRST_START: u64 = 1 << 32;

/// Whose strategy is chosen against whom.
#[derive(Clone, Copy)]
pub struct AdaptRequest<'a> {
    /// The run of a conditional ado.
    pub run: &'a RunDir,
    /// The family it was trained against.
    pub family: &'a Family,
    /// The ego, which is only run.
    pub ego: &'a Scenario,
    /// What the ado would be told otherwise.
    pub first: &'a EgoSample,
    /// Simulations of the ego, at most; [`LEAST_SIMULATIONS`] at least.
    pub simulations: u64,
    /// Seed of the starts and of the search.
    pub seed: u64,
}

/// Looks for what the ado is best told of an ego. `None`: stopped from outside.
///
/// Equal requests give equal answers, on any number of threads.
///
/// # Errors
/// The run has no policy, or its file is damaged.
pub fn adapt(request: &AdaptRequest<'_>, watch: &Watch<'_>) -> Result<Option<Adapted>, RunError> {
    let contest = SuccessiveHalving {
        family: request.family,
        first: request.first,
        simulations: request.simulations,
        seed: request.seed,
        tell: &|members| {
            let policies = request.run.policies_told(members)?;
            Ok(policies.into_iter().map(ConditionedAgent).collect())
        },
        meet: &|pairs| meet(request, pairs, watch),
    };
    contest.run(&watch.progress)
}

/// An ado that was told a member.
struct ConditionedAgent(Box<dyn Policy>);

/// Lets ados play one calibration start each. `None`: stopped.
fn meet(
    request: &AdaptRequest<'_>,
    pairs: &[(&ConditionedAgent, u64)],
    watch: &Watch<'_>,
) -> Option<Vec<RewardAndSuccess>> {
    let play_one =
        |bench: &mut Testbench, &(ado, index): &(&ConditionedAgent, u64), _: &WorkItem| {
            let key = StartKey {
                purpose: Purpose::Calibration,
                seed: request.seed,
                index: FIRST_START + index,
            };
            let (start, noise) = (bench.draw(key), bench.noise_of(key));
            let mut actor = PolicyActor(&*ado.0);
            let (from, at) = ((&start, noise), index as usize);
            let verdict = watch
                .play(bench, from, at, &mut actor, Aftermath::Skip)
                .verdict;
            let reward = request.ego.rulebook().reward_of(&verdict);
            Some((reward, verdict.is_success()))
        };
    let all = EpisodeLoop::uncounted(watch);
    let played = all.run(pairs, || request.ego.bench(), play_one);
    played.into_iter().collect()
}
