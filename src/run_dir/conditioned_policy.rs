//! Policies of conditional ados, which receive the parameters of the ego.

use super::{RunDir, RunError};
use crate::rl::{Policy, TensorFile};
use crate::world::{EgoSample, Scenario, TrainingEgos};

/// Policy with the ego's parameters appended to every observation.
struct ConditionedPolicy {
    policy: Box<dyn Policy>,
    told: Vec<f32>,
}

impl ConditionedPolicy {
    fn with<T>(&self, obs: &[f32], ask: impl FnOnce(&dyn Policy, &[f32]) -> T) -> T {
        ask(&*self.policy, &[obs, &self.told].concat())
    }
}

impl Policy for ConditionedPolicy {
    fn act(&self, obs: &[f32]) -> usize {
        self.with(obs, |policy, whole| policy.act(whole))
    }

    fn value(&self, obs: &[f32]) -> f32 {
        self.with(obs, |policy, whole| policy.value(whole))
    }
}

impl RunDir {
    /// Returns the trained ado. A conditional ado is conditioned on `member`.
    ///
    /// # Errors
    ///
    /// Returns an error if training has not finished, or the file is damaged.
    pub fn policy_told(&self, member: &EgoSample) -> Result<Box<dyn Policy>, RunError> {
        let scenario = self.scenario()?;
        self.told(&scenario, &self.policy_bundle()?, member)
    }

    /// Returns the trained ado once per member, conditioned on that member.
    ///
    /// # Errors
    ///
    /// Returns an error if training has not finished, or the file is damaged.
    pub fn policies_told(&self, members: &[EgoSample]) -> Result<Vec<Box<dyn Policy>>, RunError> {
        let (scenario, bundle) = (self.scenario()?, self.policy_bundle()?);
        let told = members.iter();
        told.map(|member| self.told(&scenario, &bundle, member))
            .collect()
    }

    fn told(
        &self,
        scenario: &Scenario,
        bundle: &TensorFile,
        member: &EgoSample,
    ) -> Result<Box<dyn Policy>, RunError> {
        let policy = self.shaped_policy(scenario, bundle)?;
        Ok(match (scenario.against, scenario.family()) {
            (TrainingEgos::Conditioned, Some(family)) => Box::new(ConditionedPolicy {
                policy,
                told: family.told(member),
            }),
            _ => policy,
        })
    }
}
