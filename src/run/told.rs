//! A conditional ado is played by telling it which ego it meets.

use crate::rl::Policy;

/// A policy with what it is told appended to every observation.
pub(super) struct Told {
    pub(super) policy: Box<dyn Policy>,
    pub(super) told: Vec<f32>,
}

impl Told {
    fn with<T>(&self, obs: &[f32], ask: impl FnOnce(&dyn Policy, &[f32]) -> T) -> T {
        ask(&*self.policy, &[obs, &self.told].concat())
    }
}

impl Policy for Told {
    fn act(&self, obs: &[f32]) -> usize {
        self.with(obs, |policy, whole| policy.act(whole))
    }

    fn value(&self, obs: &[f32]) -> f32 {
        self.with(obs, |policy, whole| policy.value(whole))
    }
}
