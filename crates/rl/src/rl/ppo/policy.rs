//! Kept policy of proximal policy optimisation.

use crate::rl::Policy;
use crate::rl::bundle::{BundleError, TensorFile};
use crate::rl::learner::expect_sizes;
use crate::rl::nn::{Mlp, argmax, argmax_among, sample};

/// Policy of the actor's likeliest action and the critic's value.
pub(super) struct ActorCritic {
    pub(super) actor: Mlp,
    pub(super) critic: Mlp,
}

impl ActorCritic {
    pub(super) fn load(bundle: &TensorFile) -> Result<ActorCritic, BundleError> {
        let (actor, critic) = (Mlp::load("actor", bundle)?, Mlp::load("critic", bundle)?);
        let found = [critic.inputs(), critic.outputs()];
        expect_sizes(
            "the critic's inputs and outputs",
            &found,
            &[actor.inputs(), 1],
        )?;
        Ok(ActorCritic { actor, critic })
    }
}

impl Policy for ActorCritic {
    fn act(&self, obs: &[f32]) -> usize {
        self.actor.evaluate(obs, argmax)
    }

    fn act_among(&self, obs: &[f32], allowed: &[bool]) -> usize {
        let best = |values: &[f32]| argmax_among(values, allowed);
        self.actor.evaluate(obs, best)
    }

    fn sample(&self, obs: &[f32], temperature: f64, units: &mut dyn FnMut() -> f64) -> usize {
        self.actor
            .evaluate(obs, |logits| sample(logits, temperature, units))
    }

    fn value(&self, obs: &[f32]) -> f32 {
        self.critic.evaluate(obs, |value| value[0])
    }
}
