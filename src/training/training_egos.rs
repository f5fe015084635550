//! Training against a family: another ego in every episode.

use super::goals::GoalTracker;
use crate::rl::{End, Env, Spaces, Step};
use crate::seed::Purpose;
use crate::testbench::Gym;
use crate::world::{Scenario, TrainingEgos};

/// The decision problem of a training: starts and, in a family, egos.
///
/// The member of an episode is a pure function of the episode's key, so that a
/// start tried again meets the same ego again.
pub struct TrainingGym<'a> {
    scenario: &'a Scenario,
    gym: Gym,
    /// What follows the world's own observation.
    told: Vec<f32>,
    /// Length of the world's own observation.
    seen: usize,
    spaces: Spaces,
    /// What successes are paid by beside Definition 4.
    goals: Option<GoalTracker>,
}

impl<'a> TrainingGym<'a> {
    /// Training starts of `seed`, against what `scenario` says.
    pub fn new(scenario: &'a Scenario, purpose: Purpose, seed: u64) -> TrainingGym<'a> {
        TrainingGym {
            scenario,
            gym: Gym::new(scenario.bench(), purpose, seed),
            told: Vec::new(),
            seen: scenario.world().spaces().observation,
            spaces: scenario.spaces(),
            goals: None,
        }
    }

    /// Pays successes by these goals; each is played on to its contact then, the
    /// last action held, which shows how severe and how distinct it is.
    pub fn pay_by(&mut self, goals: GoalTracker) {
        self.gym.play_aftermath();
        self.goals = Some(goals);
    }

    /// What the goals have counted so far.
    pub fn goals(&self) -> Option<&GoalTracker> {
        self.goals.as_ref()
    }

    /// The gym of the ego that is met, for what it counts and keeps.
    pub fn inner(&mut self) -> &mut Gym {
        &mut self.gym
    }

    /// Puts the member of an episode on the bench, if there is a family.
    fn meet(&mut self, index: u64) {
        let against = self.scenario.against;
        let Some(family) = self.scenario.family().filter(|_| !against.is_nominal()) else {
            return;
        };
        let member = family.draw(&self.scenario.name, self.gym.key(index));
        if let Some(scene) = self.scenario.scene_of(&family.variant(&member)) {
            self.gym.bench().replace_scene(scene);
        }
        if against == TrainingEgos::Conditioned {
            self.told = family.told(&member);
        }
    }
}

impl Env for TrainingGym<'_> {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.meet(index);
        let (seen, told) = obs.split_at_mut(self.seen);
        self.gym.reset(index, seen);
        told.copy_from_slice(&self.told);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        let (seen, told) = obs.split_at_mut(self.seen);
        let mut step = self.gym.step(action, seen);
        if step.end == Some(End::Terminated)
            && let Some(goals) = &mut self.goals
            && let Some(episode) = self.gym.success()
        {
            step.reward = self.gym.reward_for(goals.share(self.scenario, &episode));
        }
        told.copy_from_slice(&self.told);
        step
    }
}
