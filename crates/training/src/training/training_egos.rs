//! Training against a family, with another ego in every episode.

use super::goals::GoalTracker;
use crate::experiment::{Audience, ShownEpisode};
use crate::rl::{End, Env, Spaces, Step};
use crate::scene::drive::EgoVariant;
use crate::seed::Purpose;
use crate::testbench::Gym;
use crate::world::Scenario;

/// Decision problem of a training: its starts and, in a family, its egos.
///
/// The member of an episode is a pure function of the episode's key, so that a
/// repeated start has the same ego again.
pub struct TrainingGym<'a> {
    scenario: &'a Scenario,
    gym: Gym,
    /// Goals that add to the reward of successes by Definition 4.
    goals: Option<GoalTracker>,
    /// Index of the running episode.
    index: u64,
    audience: Option<&'a dyn Audience>,
}

impl<'a> TrainingGym<'a> {
    /// Creates a gym of the training starts of `seed`, against the egos of `scenario`.
    pub fn new(scenario: &'a Scenario, purpose: Purpose, seed: u64) -> TrainingGym<'a> {
        TrainingGym {
            scenario,
            gym: Gym::new(scenario.bench(), purpose, seed),
            goals: None,
            index: 0,
            audience: None,
        }
    }

    /// Shows episodes to a viewer, whenever it is ready for one.
    pub fn show_to(&mut self, audience: Option<&'a dyn Audience>) {
        self.audience = audience;
    }

    /// Shows the episode that has just ended with a reward.
    fn show(&mut self, audience: &dyn Audience, reward: f32) {
        // Invariant: an episode that has just ended has a verdict.
        let Some(episode) = self.gym.ended_episode() else {
            return;
        };
        let member = self
            .scenario
            .drive()
            .zip(self.member(self.index))
            .map(|(driving, variant)| driving.with_member(&variant));
        let last = self.gym.spent().decisions;
        // The count includes this episode, whose first decision follows those before it.
        let first = last.saturating_sub(episode.actions.len() as u64) + 1;
        audience.episode(&ShownEpisode {
            scenario: member.as_ref().unwrap_or(self.scenario),
            episode: &episode,
            caption: &format!("training after {last} decisions, return {reward:+.3}"),
            decisions: Some((first, last)),
        });
    }

    /// Rewards successes by these goals.
    ///
    /// Each success is then played to its contact, with the last action held, so that
    /// its severity and its difference from the others are known.
    pub fn reward_by(&mut self, goals: GoalTracker) {
        // A goal may judge the contact, which comes after the verdict.
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

    /// Draws the member of an episode, if there is a family.
    fn member(&self, index: u64) -> Option<EgoVariant> {
        // Without a family, the bench keeps the ego that it was made with.
        let nominal = self.scenario.against.is_nominal();
        let family = self.scenario.family().filter(|_| !nominal)?;
        let member = family.draw(&self.scenario.name, self.gym.key(index));
        Some(family.variant(&member))
    }

    /// Puts the member of an episode on the bench, if there is a family.
    fn place_member(&mut self, index: u64) {
        if let Some(variant) = self.member(index) {
            self.scenario.place_member(&variant, self.gym.bench());
        }
    }
}

impl Env for TrainingGym<'_> {
    fn spaces(&self) -> &Spaces {
        self.gym.spaces()
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.index = index;
        self.place_member(index);
        self.gym.reset(index, obs);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        let mut step = self.gym.step(action, obs);
        if step.end == Some(End::Terminated)
            && let Some(goals) = &mut self.goals
            && let Some(episode) = self.gym.success()
        {
            step.reward = self.gym.reward_for(goals.share(self.scenario, &episode));
            // Some goals play failures again, which costs steps of the training.
            let mut spent = self.gym.spent();
            spent.physics_steps += goals.take_physics_steps();
            self.gym.count_from(spent);
        }
        if step.end == Some(End::Terminated)
            && let Some(audience) = self.audience.filter(|audience| audience.is_ready())
        {
            self.show(audience, step.reward);
        }
        step
    }

    fn part_rewards(&self, step: Step, rewards: &mut [f32]) {
        self.gym.part_rewards(step, rewards);
    }
}
