//! Conformance check of a policy.

use super::Nonconformities;
use super::env::shapes;
use super::recorded::{StepNumbers, Subject, examine};
use crate::rl::{LearnerRng, Policy, Spaces};

/// Number of observations of an episode.
const OBSERVATIONS: usize = 100;

/// Checks that a policy is a pure function of the observation.
///
/// Its actions must exist and its values must be finite. Both must be equal in
/// any order of calls and on any thread.
///
/// # Errors
/// The broken promises, each with the first step that shows it.
pub fn check_policy(policy: &dyn Policy, spaces: &Spaces) -> Result<(), Nonconformities> {
    examine(|| PolicyCheck { policy, spaces })
}

struct PolicyCheck<'a> {
    policy: &'a dyn Policy,
    spaces: &'a Spaces,
}

impl PolicyCheck<'_> {
    fn answer(&self, episode: u64, step: usize) -> StepNumbers {
        // Derived from episode and step alone, so the order of calls has no
        // effect.
        // An episode has fewer than 1000 steps, so no two steps share a seed.
        let mut dice = LearnerRng::new(1000 * episode + step as u64);
        // The middle, the usual range, and values far outside of it.
        let wide = [0.0, 1.0, 1.0, 1.0, 50.0][step % 5];
        let mut draw = |_| (wide * (2.0 * dice.unit() - 1.0)) as f32;
        let obs: Vec<f32> = (0..self.spaces.observation).map(&mut draw).collect();
        vec![
            self.policy.act(&obs) as f64,
            f64::from(self.policy.value(&obs)),
        ]
    }
}

impl Subject for PolicyCheck<'_> {
    fn names(&self) -> Vec<String> {
        ["action", "value"].map(str::to_owned).into()
    }

    fn shapes(&self) -> Option<String> {
        shapes(self.spaces)
    }

    fn begin(&mut self, episode: u64) -> StepNumbers {
        self.answer(episode, 0)
    }

    fn step(&mut self, episode: u64, step: usize) -> Option<StepNumbers> {
        (step < OBSERVATIONS).then(|| self.answer(episode, step))
    }

    fn flaw(&self, at: usize, value: f64) -> Option<String> {
        let actions = self.spaces.actions;
        // The action is a `usize`, so only its upper end can be violated.
        let none = at == 0 && actions as f64 <= value;
        none.then(|| format!("is {value}, and there are {actions}"))
    }
}
