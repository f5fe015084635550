//! World with a surrogate in the place of its ego.

use std::sync::Arc;

use super::learn::{LearnEgoRequest, learn_ego};
use super::model_driver::{ModelDriverConfig, ModelDriverSlot};
use super::surrogate_error::SurrogateError;
use crate::experiment::Watch;
use crate::rl::Policy;
use crate::sim::PlantKind;
use crate::world::Scenario;

/// World with a surrogate in the place of its ego.
#[derive(Clone, Debug)]
pub struct SurrogateWorld {
    /// World, in which the surrogate drives.
    pub scenario: Scenario,
    /// Error of the surrogate. `None`: no run was long enough.
    pub error: Option<SurrogateError>,
}

/// Ado that follows no policy.
struct NeutralPolicy(usize);

impl Policy for NeutralPolicy {
    fn act(&self, _: &[f32]) -> usize {
        self.0
    }

    fn value(&self, _: &[f32]) -> f32 {
        0.0
    }
}

impl SurrogateWorld {
    /// Learns the ego of a world from `runs` runs of it, and returns a world on a plant.
    ///
    /// `policy` is that of a trained ado, if any, which shows the surrogate more
    /// dangerous situations. `None`: stopped, no driven world, or the ego never ran.
    pub fn learned(
        ego: &Scenario,
        policy: Option<&dyn Policy>,
        runs: u64,
        seed: u64,
        plant: PlantKind,
        watch: &Watch<'_>,
    ) -> Option<SurrogateWorld> {
        let neutral = NeutralPolicy(ego.spaces().neutral);
        let policy = policy.unwrap_or(&neutral);
        let request = LearnEgoRequest::new(ego, ego.drive()?, policy, runs).seed(seed);
        let learned = learn_ego(&request, watch)?;
        let slot = ModelDriverSlot::default();
        slot.set(ModelDriverConfig {
            surrogate: Some(Arc::clone(&learned.surrogate)),
            ..ModelDriverConfig::default()
        });
        Some(SurrogateWorld {
            // Every driver takes the same part, so threads do not disturb each other.
            scenario: ego.as_model(plant, slot.factory()),
            error: learned.from.error,
        })
    }
}
