//! Training against a family, with another ego in every episode.

use super::goals::GoalTracker;
use crate::rl::{End, Env, Spaces, Step};
use crate::seed::Purpose;
use crate::testbench::Gym;
use crate::world::{Scenario, TrainingEgos};

/// Decision problem of a training: its starts and, in a family, its egos.
///
/// The member of an episode is a pure function of the episode's key, so that a
/// repeated start has the same ego again.
pub struct TrainingGym<'a> {
    scenario: &'a Scenario,
    gym: Gym,
    /// Parameters of the ego, which follow the world's own observation.
    context: Vec<f32>,
    /// Length of the world's own observation.
    seen: usize,
    spaces: Spaces,
    /// Goals that add to the reward of successes by Definition 4.
    goals: Option<GoalTracker>,
}

impl<'a> TrainingGym<'a> {
    /// Creates a gym of the training starts of `seed`, against the egos of `scenario`.
    pub fn new(scenario: &'a Scenario, purpose: Purpose, seed: u64) -> TrainingGym<'a> {
        TrainingGym {
            scenario,
            gym: Gym::new(scenario.bench(), purpose, seed),
            context: Vec::new(),
            seen: scenario.world().spaces().observation,
            spaces: scenario.spaces(),
            goals: None,
        }
    }

    /// Rewards successes by these goals.
    ///
    /// Each success is then played to its contact, with the last action held, so that
    /// its severity and its difference from the others are known.
    pub fn reward_by(&mut self, goals: GoalTracker) {
        self.gym.play_aftermath();
        self.goals = Some(goals);
    }

    /// Returns the goals with their counts so far.
    pub fn goals(&self) -> Option<&GoalTracker> {
        self.goals.as_ref()
    }

    /// Returns the gym, for its counts and its kept successes.
    pub fn inner(&mut self) -> &mut Gym {
        &mut self.gym
    }

    /// Puts the member of an episode on the bench, if there is a family.
    fn place_member(&mut self, index: u64) {
        let against = self.scenario.against;
        let Some(family) = self.scenario.family().filter(|_| !against.is_nominal()) else {
            return;
        };
        let member = family.draw(&self.scenario.name, self.gym.key(index));
        self.scenario
            .place_member(&family.variant(&member), self.gym.bench());
        if against == TrainingEgos::Conditioned {
            self.context = family.context_of(&member);
        }
    }
}

impl Env for TrainingGym<'_> {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.place_member(index);
        let (seen, context) = obs.split_at_mut(self.seen);
        self.gym.reset(index, seen);
        context.copy_from_slice(&self.context);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        let (seen, context) = obs.split_at_mut(self.seen);
        let mut step = self.gym.step(action, seen);
        if step.end == Some(End::Terminated)
            && let Some(goals) = &mut self.goals
            && let Some(episode) = self.gym.success()
        {
            step.reward = self.gym.reward_for(goals.share(self.scenario, &episode));
        }
        context.copy_from_slice(&self.context);
        step
    }
}
