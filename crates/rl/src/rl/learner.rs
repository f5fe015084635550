//! Common interface of all learners and of their settings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bundle::{BundleError, TensorFile};
use super::starts::EpisodeStart;
use super::{Control, Env, LearnerReport, Losses, Policy, Spaces, Step};

/// Progress of a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrainingCounters {
    /// Decisions to train for.
    pub requested: u64,
    /// Decisions taken.
    pub decisions: u64,
    /// Episodes finished.
    pub episodes: u64,
    /// Episodes dropped for faults of the environment.
    pub aborted: u64,
}

impl TrainingCounters {
    /// Creates the tally of a training that has not begun.
    pub fn new(requested: u64) -> TrainingCounters {
        TrainingCounters {
            requested,
            decisions: 0,
            episodes: 0,
            aborted: 0,
        }
    }

    /// Returns the number of episodes begun, which is the index of the next start.
    pub(super) fn begun(&self) -> u64 {
        // Aborted episodes count, so that the start that made a fault is not played again.
        self.episodes + self.aborted
    }

    pub(super) fn save(&self, bundle: &mut TensorFile) {
        let counters = vec![self.decisions, self.episodes, self.aborted];
        bundle.put("counters", &[3], counters);
    }

    /// Restores the counters of [`TrainingCounters::save`]. `requested` is left as it is.
    pub(super) fn restore(&mut self, bundle: &TensorFile) -> Result<(), BundleError> {
        let counters = bundle.get::<u64>("counters", &[3])?;
        (self.decisions, self.episodes, self.aborted) = (counters[0], counters[1], counters[2]);
        Ok(())
    }
}

/// Successful episode: its start and its actions.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Demonstration {
    /// Episode index with which to reset the environment.
    pub index: u64,
    /// Actions to the end of the episode.
    pub actions: Vec<usize>,
}

/// Beginning of an episode: its start and the actions that are played first.
#[derive(Clone, Debug, PartialEq)]
pub struct EpisodePlan {
    pub(super) start: EpisodeStart,
    /// Actions of the first decisions, in order.
    pub(super) first: Vec<usize>,
}

impl EpisodePlan {
    /// Creates the plan of an episode that a learner decides from its beginning.
    pub(super) fn of(index: u64) -> EpisodePlan {
        EpisodePlan {
            start: EpisodeStart::once(index),
            first: Vec::new(),
        }
    }
}

/// Choice of the action of one decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The learner's own action, which may be exploratory.
    Own,
    /// The best action it knows.
    Greedy,
    /// This action, of the beginning of a success or of a demonstration.
    Given(usize),
}

/// Learner at work: a configuration with its training state.
///
/// An episode is [`Learner::plan`], [`Learner::begin`], and [`Learner::act`] and
/// [`Learner::learn`] in turn. [`Learner::episode`] plays it in an environment.
pub trait Learner: Send {
    /// Chooses the start of the next episode.
    fn plan(&mut self) -> EpisodePlan;

    /// Begins an episode at its first observation.
    fn begin(&mut self, plan: &EpisodePlan, obs: &[f32]);

    /// Returns the action of a decision.
    fn act(&mut self, obs: &[f32], choice: Choice) -> usize;

    /// Learns from the result of the last decision and the observation after it.
    fn learn(&mut self, step: Step, obs: &[f32]);

    /// Rewards of the parts of the last decision, to be filled before it is learned.
    ///
    /// `None`: the learner uses the common reward.
    fn part_rewards(&mut self) -> Option<&mut [f32]> {
        None
    }

    /// Plays an episode, learns on the way and returns the episode's return.
    fn episode(&mut self, env: &mut dyn Env) -> f32 {
        let plan = self.plan();
        let mut obs = vec![0.0; env.spaces().observation];
        env.reset(plan.start.index, &mut obs);
        self.begin(&plan, &obs);
        let mut first = plan.first.iter();
        let mut total = 0.0;
        loop {
            let choice = first.next().map_or(Choice::Own, |&it| Choice::Given(it));
            let action = self.act(&obs, choice);
            let step = env.step(action, &mut obs);
            // The common reward is the episode's return, whatever the parts are paid.
            total += step.reward;
            if let Some(rewards) = self.part_rewards() {
                env.part_rewards(step, rewards);
            }
            self.learn(step, &obs);
            if step.end.is_some() {
                return total;
            }
        }
    }

    /// Demonstrates successes to a learner before its first episode.
    ///
    /// Returns the number of demonstrations that succeed in `env` and are kept.
    /// Learners that use no demonstrations return 0.
    fn demonstrate(&mut self, _env: &mut dyn Env, _shown: &[Demonstration]) -> usize {
        0
    }

    /// Extends the training by `decisions` beyond the configured number.
    ///
    /// Learners that cannot adapt their schedule ignore it.
    fn extend(&mut self, _decisions: u64) {}

    /// Returns the progress so far.
    fn tally(&self) -> &TrainingCounters;

    /// Returns the current probability of an exploratory action.
    fn exploration(&self) -> f64;

    /// Returns the losses of the updates since the last call, and forgets them.
    ///
    /// A learner without a loss returns none.
    fn take_losses(&mut self) -> Losses {
        Losses::default()
    }

    /// Trains until the configured decisions are taken or the observer stops it.
    ///
    /// `observer` is called after every episode and may return [`Control::Stop`].
    /// The episode of the last decision is played to its end. `env` must be the same
    /// problem at every call.
    fn train(&mut self, env: &mut dyn Env, observer: &mut dyn FnMut(&LearnerReport) -> Control) {
        while !self.finished() {
            let episode_return = self.episode(env);
            let losses = self.take_losses();
            let tally = self.tally();
            let progress = LearnerReport {
                decisions: tally.decisions,
                episodes: tally.episodes,
                aborted: tally.aborted,
                episode_return,
                exploration: self.exploration() as f32,
                losses,
            };
            if observer(&progress) == Control::Stop {
                // Between episodes, the only place where a checkpoint is complete.
                return;
            }
        }
    }

    /// Returns the number of decisions taken so far.
    fn decisions(&self) -> u64 {
        self.tally().decisions
    }

    /// Returns true once the configured decisions are taken.
    fn finished(&self) -> bool {
        self.tally().requested <= self.tally().decisions
    }

    /// Returns the greedy policy learned so far.
    fn policy(&self) -> Box<dyn Policy>;

    /// Returns the same policy as a bundle, which a run directory stores.
    fn policy_bundle(&self) -> TensorFile;

    /// Returns the state from which training continues as if never interrupted.
    fn checkpoint(&self) -> TensorFile;
}

/// Hyperparameter out of range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}; {help}", self.what())]
pub struct ConfigError {
    /// Name of the field, as in a world file.
    pub field: &'static str,
    /// Problem with the value.
    pub why: String,
    /// Valid range, in words.
    pub help: String,
}

impl ConfigError {
    /// Returns the field and its problem in words.
    pub fn what(&self) -> String {
        format!("learner field `{}` {}", self.field, self.why)
    }
}

/// Refuses a number outside [low, high], and NaN.
pub(super) fn within(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), ConfigError> {
    // NaN fails both comparisons.
    if low <= value && value <= high {
        return Ok(());
    }
    Err(ConfigError {
        field,
        why: format!("is {value}"),
        help: format!("give a number from {low} to {high}"),
    })
}

/// Refuses hidden layers that are too many or too wide.
pub(super) fn within_widths(hidden: &[usize]) -> Result<(), ConfigError> {
    // The greatest widths already take 64 MB between two layers, in each copy of the
    // network.
    within("hidden", hidden.len() as f64, 1.0, 8.0)?;
    let mut widths = hidden.iter();
    widths.try_for_each(|width| within("hidden", *width as f64, 1.0, 4096.0))
}

/// Returns the sizes of a network's layers, from its inputs to its outputs.
pub(super) fn layers(inputs: usize, hidden: &[usize], outputs: usize) -> Vec<usize> {
    [&[inputs], hidden, &[outputs]].concat()
}

/// Refuses a bundle of another kind.
pub(super) fn expect_kind(bundle: &TensorFile, kind: &'static str) -> Result<(), BundleError> {
    if bundle.meta() == kind {
        return Ok(());
    }
    Err(BundleError::Mismatch {
        what: "the kind of the bundle",
        expected: format!("`{kind}`"),
        found: format!("`{}`", bundle.meta()),
    })
}

/// Refuses a network of other sizes than expected.
pub(super) fn expect_sizes(
    what: &'static str,
    found: &[usize],
    expected: &[usize],
) -> Result<(), BundleError> {
    if found == expected {
        return Ok(());
    }
    Err(BundleError::Mismatch {
        what,
        expected: format!("{expected:?}"),
        found: format!("{found:?}"),
    })
}

/// Returns ε, which falls between `ends` over a share of the training.
pub(super) fn epsilon(tally: &TrainingCounters, ends: (f64, f64), share: f64) -> f64 {
    linear(
        ends.0,
        ends.1,
        tally.decisions,
        share * tally.requested as f64,
    )
}

/// Interpolates from `start` to `end` over the first `span` decisions.
pub(super) fn linear(start: f64, end: f64, decisions: u64, span: f64) -> f64 {
    let decisions = decisions as f64;
    // Strict, so that a span of 0 divides nothing.
    if decisions < span {
        start + (end - start) * (decisions / span)
    } else {
        end
    }
}

/// Interface that the settings of a learner implement for the list.
///
/// The caller ([`super::LearnerConfig`]) checks settings before they build
/// anything, and passes bundles of the right kind only.
pub(super) trait LearnerKind {
    /// Kinds of its bundles: policies, then checkpoints.
    fn bundles(&self) -> [&'static str; 2];

    /// Refuses the first field out of range, other than `decisions`.
    fn check(&self) -> Result<(), ConfigError>;

    /// Discount γ per decision.
    fn discount(&self) -> f64;

    /// Creates an untrained learner.
    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner>;

    /// Creates a learner that starts from a kept policy.
    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &TensorFile) -> Built;

    /// Restores a learner from a checkpoint.
    fn restore(&self, spaces: &Spaces, checkpoint: &TensorFile) -> Built;

    /// Search for demonstrations before the training, `None` for no search.
    fn seeding(&self) -> Option<&Seeding> {
        None
    }

    /// Factor on the decisions up to which an unsuccessful training goes on.
    fn longest(&self) -> f64 {
        1.0
    }

    /// Restricts the training to exactly the configured decisions.
    fn fix(&mut self) {}

    /// Makes `times` fewer updates in as many decisions.
    fn space_updates(&mut self, _times: u64) {}

    /// Loads a kept policy, with its observation length and number of actions.
    fn load(&self, policy: &TensorFile) -> Shaped;
}

pub(super) type Built = Result<Box<dyn Learner>, BundleError>;
pub(super) type Shaped = Result<(Box<dyn Policy>, [usize; 2]), BundleError>;

/// Settings of the search for demonstrations.
///
/// It tries action sequences with few switches on training starts that no
/// episode of the learner begins from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Seeding {
    /// Greatest number of starts searched (200).
    pub starts: usize,
    /// Greatest number of simulations (300000), and at most 2 per decision.
    ///
    /// If the ego cannot be copied, a hundredth of it.
    pub simulations: u64,
}

impl Default for Seeding {
    fn default() -> Self {
        Seeding {
            starts: 200,
            simulations: 300_000,
        }
    }
}
