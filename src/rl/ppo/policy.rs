//! What proximal policy optimisation keeps.

use super::POLICY;
use crate::rl::Policy;
use crate::rl::bundle::{Bundle, BundleError};
use crate::rl::learner::{expect_kind, expect_sizes};
use crate::rl::nn::{Mlp, argmax};

/// The actor's likeliest action, and the critic's value.
#[derive(Clone, Debug, PartialEq)]
pub struct ActorCritic {
    pub(super) actor: Mlp,
    pub(super) critic: Mlp,
}

impl ActorCritic {
    /// Reads what [`Learner::policy_bundle`] of a [`Ppo`] gave.
    ///
    /// # Errors
    /// When the bundle is no policy of this kind, or misshapen.
    pub fn load(bundle: &Bundle) -> Result<ActorCritic, BundleError> {
        expect_kind(bundle, POLICY)?;
        let (actor, critic) = (Mlp::load("actor", bundle)?, Mlp::load("critic", bundle)?);
        let found = [critic.inputs(), critic.outputs()];
        expect_sizes(
            "the critic's inputs and outputs",
            &found,
            &[actor.inputs(), 1],
        )?;
        Ok(ActorCritic { actor, critic })
    }

    /// Observation length and number of actions.
    pub fn shape(&self) -> [usize; 2] {
        [self.actor.inputs(), self.actor.outputs()]
    }
}

impl Policy for ActorCritic {
    fn act(&self, obs: &[f32]) -> usize {
        self.actor.evaluate(obs, argmax)
    }

    fn value(&self, obs: &[f32]) -> f32 {
        self.critic.evaluate(obs, |value| value[0])
    }
}
