//! A conditional ado is played by telling it which ego it meets.

use super::{RunDir, RunError};
use crate::rl::{Bundle, Policy};
use crate::world::{Against, Member, Scenario};

/// A policy with what it is told appended to every observation.
struct Told {
    policy: Box<dyn Policy>,
    told: Vec<f32>,
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

impl RunDir {
    /// The trained ado; a conditional one is told that it meets `member`.
    ///
    /// # Errors
    /// There is none yet, or its file is damaged.
    pub fn policy_told(&self, member: &Member) -> Result<Box<dyn Policy>, RunError> {
        let scenario = self.scenario()?;
        self.told(&scenario, &self.policy_bundle()?, member)
    }

    /// The trained ado once per member, told that it meets that one.
    ///
    /// # Errors
    /// There is none yet, or its file is damaged.
    pub fn policies_told(&self, members: &[Member]) -> Result<Vec<Box<dyn Policy>>, RunError> {
        let (scenario, bundle) = (self.scenario()?, self.policy_bundle()?);
        let told = members.iter();
        told.map(|member| self.told(&scenario, &bundle, member))
            .collect()
    }

    fn told(
        &self,
        scenario: &Scenario,
        bundle: &Bundle,
        member: &Member,
    ) -> Result<Box<dyn Policy>, RunError> {
        let policy = self.shaped_policy(scenario, bundle)?;
        Ok(match (scenario.against, scenario.family()) {
            (Against::Conditional, Some(family)) => Box::new(Told {
                policy,
                told: family.told(member),
            }),
            _ => policy,
        })
    }
}
