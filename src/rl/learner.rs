//! The learner-neutral surface: configuration, state, and loading a policy.

use serde::{Deserialize, Serialize};

use super::bundle::{Bundle, BundleError};
use super::dqn::{self, Dqn, DqnConfig};
use super::ppo::{self, Ppo, PpoConfig};
use super::q_table::{self, QTable, QTableConfig};
use super::{Control, Env, Policy, Progress, Spaces};

/// How much of what a learner was asked to do is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tally {
    /// Decisions to train for.
    pub asked: u64,
    /// Decisions taken.
    pub decisions: u64,
    /// Episodes finished.
    pub episodes: u64,
    /// Episodes dropped for faults of the environment.
    pub aborted: u64,
}

impl Tally {
    /// Nothing done yet.
    pub fn new(asked: u64) -> Tally {
        Tally {
            asked,
            decisions: 0,
            episodes: 0,
            aborted: 0,
        }
    }

    /// Episodes begun: the index of the next start.
    pub(super) fn begun(&self) -> u64 {
        self.episodes + self.aborted
    }

    pub(super) fn save(&self, bundle: &mut Bundle) {
        let counters = vec![self.decisions, self.episodes, self.aborted];
        bundle.put("counters", &[3], counters);
    }

    /// What [`Tally::save`] wrote, of a training for as many decisions.
    pub(super) fn restore(&mut self, bundle: &Bundle) -> Result<(), BundleError> {
        let counters = bundle.get::<u64>("counters", &[3])?;
        (self.decisions, self.episodes, self.aborted) = (counters[0], counters[1], counters[2]);
        Ok(())
    }
}

/// A learner at work: a configuration turned into state.
pub trait Learner: Send {
    /// Plays one episode, learning on the way; returns its return.
    fn episode(&mut self, env: &mut dyn Env) -> f32;

    /// What is done so far.
    fn tally(&self) -> &Tally;

    /// How likely an action is exploratory now.
    fn exploration(&self) -> f64;

    /// Trains until the configured decisions are taken or `observer` says
    /// [`Control::Stop`].
    ///
    /// `observer` is called after every episode; the episode in which the last
    /// decision falls is played to its end. `env` must be the same problem at
    /// every call.
    fn train(&mut self, env: &mut dyn Env, observer: &mut dyn FnMut(&Progress) -> Control) {
        while !self.finished() {
            let episode_return = self.episode(env);
            let tally = self.tally();
            let progress = Progress {
                decisions: tally.decisions,
                episodes: tally.episodes,
                aborted: tally.aborted,
                episode_return,
                exploration: self.exploration() as f32,
            };
            if observer(&progress) == Control::Stop {
                return;
            }
        }
    }

    /// Decisions taken so far.
    fn decisions(&self) -> u64 {
        self.tally().decisions
    }

    /// Whether the configured decisions are taken.
    fn finished(&self) -> bool {
        self.tally().asked <= self.tally().decisions
    }

    /// The greedy policy learned so far.
    fn policy(&self) -> Box<dyn Policy>;

    /// The same policy, to be kept; [`load_policy`] reads it.
    fn policy_bundle(&self) -> Bundle;

    /// Everything that training needs to go on as if never interrupted.
    fn checkpoint(&self) -> Bundle;
}

/// Which learner, with every hyperparameter: the `learner` of a world file.
///
/// ```
/// use brakecheck::rl::LearnerConfig;
///
/// let ron = ron::Options::default()
///     .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
/// let learner: LearnerConfig = ron.from_str("Dqn(decisions: 50_000)")?;
/// assert_eq!(learner.decisions(), 50_000);
/// # Ok::<(), ron::error::SpannedError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum LearnerConfig {
    /// Deep Q-learning: the default, for driving.
    Dqn(DqnConfig),
    /// Tabular Q-learning: for small or binned worlds.
    QTable(QTableConfig),
    /// Proximal policy optimisation.
    Ppo(PpoConfig),
}

impl Default for LearnerConfig {
    fn default() -> Self {
        LearnerConfig::Dqn(DqnConfig::default())
    }
}

impl LearnerConfig {
    /// Decisions to train for.
    pub fn decisions(&self) -> u64 {
        match self {
            LearnerConfig::Dqn(config) => config.decisions,
            LearnerConfig::QTable(config) => config.decisions,
            LearnerConfig::Ppo(config) => config.decisions,
        }
    }

    /// The same, with another number of decisions.
    pub fn with_decisions(mut self, decisions: u64) -> Self {
        match &mut self {
            LearnerConfig::Dqn(config) => config.decisions = decisions,
            LearnerConfig::QTable(config) => config.decisions = decisions,
            LearnerConfig::Ppo(config) => config.decisions = decisions,
        }
        self
    }

    /// The name of the learner, as in a world file.
    pub fn name(&self) -> &'static str {
        match self {
            LearnerConfig::Dqn(_) => "Dqn",
            LearnerConfig::QTable(_) => "QTable",
            LearnerConfig::Ppo(_) => "Ppo",
        }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of range, and what would be right.
    pub fn validate(&self) -> Result<(), ConfigError> {
        match self {
            LearnerConfig::Dqn(config) => config.validate(),
            LearnerConfig::QTable(config) => config.validate(),
            LearnerConfig::Ppo(config) => config.validate(),
        }
    }

    /// A learner that has seen nothing; equal seeds learn equally.
    pub fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        match self {
            LearnerConfig::Dqn(config) => Box::new(Dqn::new(config, spaces, seed)),
            LearnerConfig::QTable(config) => Box::new(QTable::new(config, spaces, seed)),
            LearnerConfig::Ppo(config) => Box::new(Ppo::new(config, spaces, seed)),
        }
    }

    /// A learner that starts from a policy kept earlier (fine-tuning).
    ///
    /// # Errors
    /// When the policy is of another learner, or its shapes are others.
    pub fn build_from(
        &self,
        spaces: &Spaces,
        seed: u64,
        policy: &Bundle,
    ) -> Result<Box<dyn Learner>, BundleError> {
        Ok(match self {
            LearnerConfig::Dqn(config) => Box::new(Dqn::from_policy(config, spaces, seed, policy)?),
            LearnerConfig::QTable(config) => {
                Box::new(QTable::from_policy(config, spaces, seed, policy)?)
            }
            LearnerConfig::Ppo(config) => Box::new(Ppo::from_policy(config, spaces, seed, policy)?),
        })
    }

    /// A learner that goes on from a checkpoint.
    ///
    /// # Errors
    /// When the checkpoint is of another learner, or its shapes are others.
    pub fn restore(
        &self,
        spaces: &Spaces,
        checkpoint: &Bundle,
    ) -> Result<Box<dyn Learner>, BundleError> {
        Ok(match self {
            LearnerConfig::Dqn(config) => Box::new(Dqn::restore(config, spaces, checkpoint)?),
            LearnerConfig::QTable(config) => Box::new(QTable::restore(config, spaces, checkpoint)?),
            LearnerConfig::Ppo(config) => Box::new(Ppo::restore(config, spaces, checkpoint)?),
        })
    }
}

/// The policy of any learner, from what [`Learner::policy_bundle`] gave.
///
/// # Errors
/// When the bundle is no policy, or its shapes do not fit each other.
pub fn load_policy(bundle: &Bundle) -> Result<Box<dyn Policy>, BundleError> {
    Ok(load_shaped(bundle)?.0)
}

/// The same, for a world with these spaces.
///
/// # Errors
/// When the bundle is no policy, or one for other observations or actions.
pub fn load_policy_for(spaces: &Spaces, bundle: &Bundle) -> Result<Box<dyn Policy>, BundleError> {
    let (policy, shape) = load_shaped(bundle)?;
    let expected = [spaces.observation, spaces.actions];
    expect_sizes("the policy's observation and actions", &shape, &expected)?;
    Ok(policy)
}

/// A policy and its observation length and number of actions.
fn load_shaped(bundle: &Bundle) -> Result<(Box<dyn Policy>, [usize; 2]), BundleError> {
    match bundle.meta() {
        dqn::POLICY => {
            let policy = dqn::QPolicy::load(bundle)?;
            let shape = policy.shape();
            Ok((Box::new(policy), shape))
        }
        q_table::POLICY => {
            let policy = q_table::TablePolicy::load(bundle)?;
            let shape = policy.shape();
            Ok((Box::new(policy), shape))
        }
        ppo::POLICY => {
            let policy = ppo::ActorCritic::load(bundle)?;
            let shape = policy.shape();
            Ok((Box::new(policy), shape))
        }
        other => Err(BundleError::Mismatch {
            what: "the kind of the bundle",
            expected: format!(
                "`{}`, `{}` or `{}`",
                dqn::POLICY,
                q_table::POLICY,
                ppo::POLICY
            ),
            found: format!("`{other}`"),
        }),
    }
}

/// A hyperparameter that is out of range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("learner field `{field}` {why}")]
pub struct ConfigError {
    /// The field, as in a world file.
    pub field: &'static str,
    /// What is wrong with it.
    pub why: String,
    /// What would be right.
    pub help: String,
}

/// Refuses a number outside of [low, high], and NaN.
pub(super) fn within(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), ConfigError> {
    if low <= value && value <= high {
        return Ok(());
    }
    Err(ConfigError {
        field,
        why: format!("is {value}"),
        help: format!("give a number from {low} to {high}"),
    })
}

/// Refuses a bundle of another kind.
pub(super) fn expect_kind(bundle: &Bundle, kind: &'static str) -> Result<(), BundleError> {
    if bundle.meta() == kind {
        return Ok(());
    }
    Err(BundleError::Mismatch {
        what: "the kind of the bundle",
        expected: format!("`{kind}`"),
        found: format!("`{}`", bundle.meta()),
    })
}

/// Refuses a network of other sizes than configured.
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

/// ε of ε-greedy exploration: falls between `ends` over a share of the training.
pub(super) fn epsilon(tally: &Tally, ends: (f64, f64), share: f64) -> f64 {
    linear(ends.0, ends.1, tally.decisions, share * tally.asked as f64)
}

/// From `start` to `end` in a straight line over the first `span` decisions.
pub(super) fn linear(start: f64, end: f64, decisions: u64, span: f64) -> f64 {
    let decisions = decisions as f64;
    if decisions < span {
        start + (end - start) * (decisions / span)
    } else {
        end
    }
}
