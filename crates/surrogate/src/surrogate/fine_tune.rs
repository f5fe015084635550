//! Training of the ado's policy inside the surrogate.

use std::sync::Arc;

use super::model::Surrogate;
use super::model_driver::{ModelDriverConfig, ModelDriverSlot};
use super::surrogate_fit::MEMBERS;
use super::surrogate_sim::ModelBench;
use crate::experiment::Watch;
use crate::rl::{Control, Env, Spaces, Step, TensorFile, fine_tuner};
use crate::seed::Purpose;
use crate::testbench::Gym;
use crate::world::DriveScenario;

/// Decisions per training.
const DECISIONS: u64 = 30_000;

/// Training starts against the surrogate, with another member in every episode.
///
/// The ado then relies only on behaviour that all members share.
struct Inside {
    gym: Gym,
    driver_slot: ModelDriverSlot,
    surrogate: Arc<Surrogate>,
}

impl Env for Inside {
    fn spaces(&self) -> &Spaces {
        self.gym.spaces()
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.driver_slot.set(ModelDriverConfig {
            surrogate: Some(Arc::clone(&self.surrogate)),
            // The episode index selects the member, so equal requests repeat the training.
            member: Some(index as usize % MEMBERS),
            ..ModelDriverConfig::default()
        });
        self.gym.reset(index, obs);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.gym.step(action, obs)
    }
}

/// Trains the ado inside the surrogate in the place of the ego of `world`.
///
/// Returns `None` if stopped, or if the policy cannot be trained further because it is not
/// from deep Q-learning. Equal requests give equal policies.
pub(super) fn fine_tuned(
    world: DriveScenario<'_>,
    policy: Option<&TensorFile>,
    surrogate: &Arc<Surrogate>,
    seed: u64,
    watch: &Watch<'_>,
) -> Option<TensorFile> {
    let ModelBench {
        bench, driver_slot, ..
    } = ModelBench::quick(world);
    let mut learner = fine_tuner(bench.spaces(), DECISIONS, seed, policy?)?;
    let mut inside = Inside {
        gym: Gym::new(bench, Purpose::Train, seed),
        driver_slot,
        surrogate: Arc::clone(surrogate),
    };
    learner.train(&mut inside, &mut |_| {
        if watch.stopped() {
            Control::Stop
        } else {
            Control::Continue
        }
    });
    // A policy from a stopped training would depend on the time of the stop.
    learner.finished().then(|| learner.policy_bundle())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::nn::Mlp;
    use crate::rl::{DqnSettings, LearnerConfig, Policy, PpoSettings, load_policy};
    use crate::surrogate::model::OUTPUTS;
    use crate::surrogate::surrogate_sim::width_of;
    use crate::testbench::{Aftermath, PolicyActor, play};
    use crate::world::Scenario;

    /// Surrogate that always answers `change_mps2`.
    fn surrogate_of(world: DriveScenario<'_>, change_mps2: f64) -> Arc<Surrogate> {
        let width = width_of(world);
        // In a single layer the biases precede the weights.
        let mut net = Mlp::zeros(&[width, OUTPUTS]);
        net.parameters_mut()[0] = 1.0;
        Arc::new(Surrogate::of_members(
            vec![net.clone(), net],
            [change_mps2, 0.0],
            [-8.0, 2.0],
        ))
    }

    /// Counts the starts, of 20, on which a policy makes the surrogate fail.
    fn solved(world: DriveScenario<'_>, surrogate: &Arc<Surrogate>, policy: &dyn Policy) -> usize {
        let ModelBench {
            bench, driver_slot, ..
        } = ModelBench::quick(world);
        let mut gym = Gym::new(bench, Purpose::Calibration, 2);
        let is_success = |index: &u64| {
            let key = gym.key(*index);
            let bench = gym.bench();
            let (start, noise) = (bench.draw(key), bench.noise_of(key));
            driver_slot.set(ModelDriverConfig {
                surrogate: Some(Arc::clone(surrogate)),
                ..ModelDriverConfig::default()
            });
            let mut actor = PolicyActor(policy);
            let episode = play(bench, &start, noise, &mut actor, Aftermath::Skip);
            episode.verdict.is_success()
        };
        (0..20).filter(is_success).count()
    }

    fn unlearned(world: &Scenario, learner: LearnerConfig) -> TensorFile {
        learner.build(world.spaces(), 3).policy_bundle()
    }

    #[test]
    fn an_ado_learns_what_the_ego_in_the_surrogate_does() {
        let scenario = Scenario::shipped("acc").expect("shipped").expect("sound");
        let world = scenario.drive().expect("driven");
        let watch = Watch::unwatched();
        let before = unlearned(
            &world,
            LearnerConfig::new(DqnSettings::default()).expect("sound"),
        );
        // The first keeps its acceleration and runs into a braking vehicle. The second
        // always brakes hard and fails from the nearest starts only.
        let keeps = surrogate_of(world, 0.0);
        let brakes = surrogate_of(world, -1.0);
        let learn = |policy: &TensorFile, ego: &Arc<Surrogate>| {
            fine_tuned(world, Some(policy), ego, 5, &watch)
        };
        let solves = |kept: &TensorFile, ego| {
            let policy = load_policy(kept).expect("a policy");
            solved(world, ego, &*policy)
        };
        let kept = learn(&before, &keeps).expect("deep Q-learning");
        let [first, after, braking] = [(&before, &keeps), (&kept, &keeps), (&kept, &brakes)]
            .map(|(policy, ego)| solves(policy, ego));
        assert!(first < 10 && after >= 16, "{first}, then {after}");
        assert!(braking < 8, "{braking}");
        assert_eq!(learn(&before, &keeps).as_ref(), Some(&kept));
        assert_ne!(learn(&before, &brakes), Some(kept));

        let other = unlearned(
            &world,
            LearnerConfig::new(PpoSettings::default()).expect("sound"),
        );
        assert!(learn(&other, &keeps).is_none(), "of another learner");
        assert!(fine_tuned(world, None, &keeps, 5, &watch).is_none());
        let lane = Scenario::shipped("cut_in")
            .expect("shipped")
            .expect("sound");
        let stranger = unlearned(
            &lane,
            LearnerConfig::new(DqnSettings::default()).expect("sound"),
        );
        assert!(learn(&stranger, &keeps).is_none(), "of other observations");
    }
}
