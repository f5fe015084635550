//! Reinforcement learning: environments, policies and the learners.
//!
//! Architecture Invariant: nothing here knows physics or logic. An [`Env`] is
//! a seeded episodic decision problem with a finite set of actions; a
//! [`Learner`] turns decisions into a [`Policy`].
//!
//! Architecture Invariant: no IO and no clock. Progress and the wish to stop
//! go through a callback; a checkpoint is a value.
//!
//! | file | what | paper |
//! | --- | --- | --- |
//! | `dqn` | deep Q-learning, recipe R | Mnih 2015, van Hasselt 2016 |
//! | `dqfd`, `demonstrations` | the same, that begins with successes shown to it | Hester 2018 |
//! | `q_table` | tabular Q-learning | Watkins 1989 |
//! | `ppo` | clipped policy gradients with GAE | Schulman 2017, 2016 |
//! | `replay` | prioritised replay, n-step returns | Schaul 2016, Watkins 1989 |
//! | `seeding` | what is looked for before the first episode | |
//! | `starts` | which start an episode begins from | |
//! | `kernel`, `nn` | matrix products, perceptron, Adam | |
//! | `bundle` | named tensors: how policies and checkpoints are kept | |
//! | `dice` | the learners' random numbers | |
//! | `learner` | the learner-neutral surface | |
//! | `list` | all learners; configuring, building and loading them | |

mod bundle;
mod demonstrations;
mod dice;
mod dqfd;
mod dqn;
pub mod kernel;
mod kind;
mod learner;
mod list;
pub mod nn;
mod paid;
mod ppo;
mod q_table;
pub mod replay;
mod seeding;
mod starts;

pub use bundle::{Bundle, BundleError, Data, Element};
pub use demonstrations::Imitation;
pub use dice::Dice;
pub use dqfd::DqfdSettings;
pub use dqn::{DqnSettings, Loss};
pub use learner::{ConfigError, Demonstration, Learner, Tally};
pub(crate) use list::fine_tuner;
pub use list::{LearnerConfig, LearnerSettings, load_policy, load_policy_for};
pub use ppo::PpoSettings;
pub use q_table::{Bins, LearningRate, QTableSettings};
pub use seeding::Seeding;

/// The shapes of a decision problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spaces {
    /// Length of an observation.
    pub observation: usize,
    /// Number of actions; an action is an index below it.
    pub actions: usize,
    /// The action that leaves things alone (coast, stay).
    pub neutral: usize,
}

/// How an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The decision problem is over: nothing follows, the value is 0.
    Terminated,
    /// Cut off from outside: learners bootstrap from the last observation.
    Truncated,
    /// A fault (of the ego, of the physics): learners drop the episode.
    Aborted,
}

/// What one decision brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The reward, paid for this decision.
    pub reward: f32,
    /// Set when the episode is over.
    pub end: Option<End>,
}

/// A seeded episodic decision problem.
pub trait Env {
    /// Shapes of observations and actions.
    fn spaces(&self) -> &Spaces;

    /// Begins the episode number `index`; its start is a pure function of it.
    fn reset(&mut self, index: u64, obs: &mut [f32]);

    /// Takes one action. Must not be called after an end without a reset.
    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step;
}

/// A trained decision rule: a pure function of the observation.
pub trait Policy: Send + Sync {
    /// The greedy action; ties go to the lowest index.
    fn act(&self, obs: &[f32]) -> usize;

    /// V(s), the expected return from here (Theorems 1 and 2).
    fn value(&self, obs: &[f32]) -> f32;
}

/// What a learner reports after an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnerReport {
    /// Decisions taken so far.
    pub decisions: u64,
    /// Episodes finished so far (aborted ones not counted).
    pub episodes: u64,
    /// Episodes dropped because they were aborted.
    pub aborted: u64,
    /// Return of the episode just finished.
    pub episode_return: f32,
    /// The exploration rate now in force.
    pub exploration: f32,
}

/// Whether to go on, answered by the progress callback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop at this episode's end; the learner can be checkpointed and resumed.
    Stop,
}
