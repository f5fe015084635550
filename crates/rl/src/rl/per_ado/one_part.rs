//! Demonstrations as one of several ados sees them.

use crate::rl::{Env, Spaces, Step};

/// Decision problem of one ado while the others play a demonstration.
pub(super) struct OnePart<'a> {
    pub(super) env: &'a mut dyn Env,
    pub(super) spaces: Spaces,
    pub(super) part: usize,
    pub(super) observed: Vec<usize>,
    /// Joint actions of the demonstration.
    pub(super) actions: Vec<usize>,
    pub(super) at: usize,
    pub(super) joint: Vec<f32>,
    pub(super) rewards: Vec<f32>,
}

impl OnePart<'_> {
    fn see(&self, obs: &mut [f32]) {
        for (own, &at) in obs.iter_mut().zip(&self.observed) {
            *own = self.joint[at];
        }
    }
}

impl Env for OnePart<'_> {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.at = 0;
        self.env.reset(index, &mut self.joint);
        self.see(obs);
    }

    /// Plays the joint action of the demonstration, of which the own action is a part.
    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        // Invariant: a learner demonstrates the actions it was given, in order.
        let joint = self.actions.get(self.at).copied().unwrap_or(action);
        self.at += 1;
        let step = self.env.step(joint, &mut self.joint);
        self.env.part_rewards(step, &mut self.rewards);
        self.see(obs);
        Step {
            // The end is that of the joint episode, because no ado leaves it alone.
            reward: self.rewards[self.part],
            ..step
        }
    }
}
