//! Reinforcement learning: environments, policies and the learners.
//!
//! Architecture Invariant: nothing here knows physics or logic. An [`Env`] is
//! a seeded episodic decision problem with a finite set of actions. A [`Learner`]
//! turns decisions into a [`Policy`].
//!
//! Architecture Invariant: no IO and no clock. Progress reports and stop requests
//! go through a callback. A checkpoint is a value.
//!
//! | file | contents | paper |
//! | --- | --- | --- |
//! | `dqn` | deep Q-learning, recipe R | Mnih 2015, van Hasselt 2016 |
//! | `dqfd`, `demonstrations` | deep Q-learning from demonstrations | Hester 2018 |
//! | `traffic`, `traffic_law`, `soft_backup` | the law of actions, given a success | Todorov 2009, Haarnoja 2017 |
//! | `q_table` | tabular Q-learning | Watkins 1989 |
//! | `ppo` | clipped policy gradients with GAE | Schulman 2017, 2016 |
//! | `per_ado` | a learner per ado | Tan 1993 |
//! | `replay` | prioritised replay, n-step returns | Schaul 2016, Watkins 1989 |
//! | `starts` | choice of the start of an episode | |
//! | `kernel`, `transpose`, `loops` | matrix products, transposes, element-wise loops | |
//! | `nn`, `orthogonal`, `adam` | perceptron, its first weights, Adam | |
//! | `sum_tree`, `power` | sums and powers of priorities | |
//! | `bundle` | named tensors, the format of policies and checkpoints | |
//! | `dice` | random numbers of the learners | |
//! | `learner` | common interface of the learners | |
//! | `list` | all learners, with configuration, building and loading | |

pub mod adam;
mod bundle;
mod demonstrations;
mod dice;
mod dqfd;
mod dqn;
#[cfg(test)]
mod example_learner;
pub(crate) mod kernel;
mod learner;
pub mod list;
mod loops;
pub mod nn;
mod orthogonal;
mod per_ado;
mod power;
mod ppo;
mod q_table;
pub mod replay;
mod soft_backup;
mod starts;
pub mod sum_tree;
mod traffic;
mod traffic_law;
#[cfg(test)]
mod traffic_tests;
mod transpose;

pub use bundle::{BundleError, Data, Element, TensorFile};
pub use demonstrations::Imitation;
pub use dice::LearnerRng;
pub use dqfd::DqfdSettings;
pub use dqn::{DqnSettings, Loss};
pub use learner::{
    Choice, ConfigError, Demonstration, EpisodePlan, Learner, Seeding, TrainingCounters,
};
pub use list::{LearnerConfig, LearnerSettings, PerAdoObservation, PerAdoSettings, PerAdoTraining};
pub use list::{fine_tuner, load_policy, load_policy_for};
pub use per_ado::policy_of_part;
pub use ppo::PpoSettings;
pub use q_table::{Bins, LearningRate, QTableSettings};
pub use traffic::TrafficSettings;
pub use traffic_law::{LawFactor, LawOnset, TrafficLaw, interrupted};

use serde::{Deserialize, Serialize};

/// Probabilities of the actions of a decision: under the traffic's law and under the policy.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionOdds {
    /// Law of the traffic.
    pub law: Vec<f64>,
    /// Probabilities with which the policy draws.
    pub own: Vec<f64>,
}

/// Shapes of a decision problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spaces {
    /// Length of an observation.
    pub observation: usize,
    /// Number of actions. An action is an index below it.
    pub actions: usize,
    /// Action without effect (coast, stay).
    pub neutral: usize,
    /// Ados of a joint action: the first is its lowest digit. Empty if unknown.
    pub parts: Vec<PartSpaces>,
}

/// Shapes of one ado's share of a joint decision.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartSpaces {
    /// Name of the ado.
    pub name: String,
    /// Number of its actions.
    pub actions: usize,
    /// Its action without effect.
    pub neutral: usize,
    /// Positions of its observation in the joint observation.
    pub observed: Vec<usize>,
}

/// Kind of end of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The decision problem is over. Nothing follows, and the value is 0.
    Terminated,
    /// Cut off from outside. Learners bootstrap from the last observation.
    Truncated,
    /// Fault of the ego or of the physics. Learners drop the episode.
    Aborted,
}

/// Result of one decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Reward of this decision.
    pub reward: f32,
    /// Kind of end, if the episode is over.
    pub end: Option<End>,
}

/// Seeded episodic decision problem.
pub trait Env {
    /// Returns the shapes of observations and actions.
    fn spaces(&self) -> &Spaces;

    /// Begins episode `index`, whose start is a pure function of the index.
    fn reset(&mut self, index: u64, obs: &mut [f32]);

    /// Takes an action. Must not be called after an end without a reset.
    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step;

    /// Writes the reward of each ado for the decision that gave `step`.
    ///
    /// By default all have the common reward.
    fn part_rewards(&self, step: Step, rewards: &mut [f32]) {
        rewards.fill(step.reward);
    }
}

/// Most draws of an action until one is allowed.
const MOST_DRAWS: usize = 100;

/// Trained decision rule, a pure function of the observation.
pub trait Policy: Send + Sync {
    /// Returns the greedy action. Ties go to the lowest index.
    fn act(&self, obs: &[f32]) -> usize;

    /// Returns the best action of those allowed, by default as if all were.
    fn act_among(&self, obs: &[f32], _allowed: &[bool]) -> usize {
        self.act(obs)
    }

    /// Draws an action: the better it is valued, the likelier.
    ///
    /// Values are divided by `temperature` > 0 before the softmax, so a small one is
    /// nearly greedy. At 1, a policy of PPO draws from its own distribution. `units`
    /// draws from [0, 1). By default the greedy action is returned.
    fn sample(&self, obs: &[f32], _temperature: f64, _units: &mut dyn FnMut() -> f64) -> usize {
        self.act(obs)
    }

    /// Draws an action of those allowed: draws again while a draw is not allowed.
    ///
    /// Each allowed action keeps its likelihood relative to the others. If none of 100
    /// draws is allowed, the best allowed action is returned.
    fn sample_among(
        &self,
        obs: &[f32],
        allowed: &[bool],
        temperature: f64,
        units: &mut dyn FnMut() -> f64,
    ) -> usize {
        let mut draws = (0..MOST_DRAWS).map(|_| self.sample(obs, temperature, units));
        let is_allowed = |action: &usize| allowed.get(*action) == Some(&true);
        let drawn = draws.find(is_allowed);
        drawn.unwrap_or_else(|| self.act_among(obs, allowed))
    }

    /// Returns the temperature at which its actions are drawn. `None`: it plays the best one.
    ///
    /// A policy that imitates traffic is no single action per state.
    fn drawn_at(&self) -> Option<f64> {
        None
    }

    /// Returns the probabilities of all actions. `None` for a policy without a law.
    fn odds(&self, _obs: &[f32]) -> Option<ActionOdds> {
        None
    }

    /// Returns V(s), the expected return from here (Theorems 1 and 2).
    fn value(&self, obs: &[f32]) -> f32;

    /// Returns Q(s, ·), the expected return of every action. `None` without such values.
    fn action_values(&self, _obs: &[f32]) -> Option<Vec<f32>> {
        None
    }
}

/// Report of a learner after an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnerReport {
    /// Decisions taken so far.
    pub decisions: u64,
    /// Episodes finished so far, without aborted episodes.
    pub episodes: u64,
    /// Episodes dropped because they were aborted.
    pub aborted: u64,
    /// Return of the episode just finished.
    pub episode_return: f32,
    /// Current exploration rate.
    pub exploration: f32,
    /// Losses of the updates since the last report.
    pub losses: Losses,
}

/// Losses of some updates of a learner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Losses {
    /// Sum of the mean losses of the updates.
    pub sum: f64,
    /// Number of updates.
    pub updates: u64,
}

impl Losses {
    /// Adds an update with its mean loss. A loss that is not finite is left out.
    pub fn add(&mut self, loss: f64) {
        // JSON has no such number, and a run must stay readable.
        if loss.is_finite() {
            self.sum += loss;
            self.updates += 1;
        }
    }
}

/// Answer of the progress callback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Continue training.
    Continue,
    /// Stop at the end of this episode. The learner can be saved and resumed.
    Stop,
}
