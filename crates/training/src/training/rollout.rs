//! Greedy episodes of an ado on starts of a training.

use super::training_egos::TrainingGym;
use crate::experiment::{EpisodeLoop, Watch};
use crate::rl::{Env, Policy};
use crate::seed::{self, Purpose};
use crate::testbench::Sampling;
use crate::world::Scenario;
use rand::RngExt;

/// Result of one greedy episode of an ado.
#[derive(Clone, Default)]
pub(super) struct GreedyEpisode {
    /// Actions of a success, in which the ego failed and all rules were kept.
    pub success: Option<Vec<usize>>,
    pub physics_steps: u64,
    pub cpu_s: f64,
}

/// Stream of the starts of a training.
#[derive(Clone, Copy)]
pub(super) struct TrainingStarts<'a> {
    pub scenario: &'a Scenario,
    pub purpose: Purpose,
    pub seed: u64,
}

impl<'a> TrainingStarts<'a> {
    fn gym(&self, watch: &Watch<'_>) -> TrainingGym<'a> {
        let mut gym = TrainingGym::new(self.scenario, self.purpose, self.seed);
        // An ego that does not run would look like one that never fails.
        gym.inner().tell_faults(watch.faults.clone());
        gym
    }

    /// Plays the starts with these indices greedily. `None` if stopped.
    pub(super) fn successes(
        &self,
        indices: &[u64],
        policy: &dyn Policy,
        watch: &Watch<'_>,
    ) -> Option<Vec<GreedyEpisode>> {
        let all = EpisodeLoop::counted(watch, indices.len());
        let gym = || self.gym(watch);
        let played = all.run(indices, gym, |gym, &index, turn| {
            let before = gym.inner().spent().physics_steps;
            let success = succeeds(gym, index, &mut |obs| policy.act(obs));
            Some(GreedyEpisode {
                success,
                physics_steps: gym.inner().spent().physics_steps - before,
                cpu_s: turn.cpu_s(),
            })
        });
        // Episodes are missing only after a stop, which gives no result.
        let episodes = played.into_iter().map(Option::unwrap_or_default);
        (!watch.stopped()).then(|| episodes.collect())
    }

    /// Plays some starts with drawn actions, each until the first success.
    ///
    /// Returns whether some draw succeeds, the episodes and the cost of each start. `None`
    /// if stopped.
    pub(super) fn drawn_successes(
        &self,
        indices: &[u64],
        policy: &dyn Policy,
        sampling: Sampling,
        watch: &Watch<'_>,
    ) -> Option<Vec<(bool, u64, GreedyEpisode)>> {
        let all = EpisodeLoop::counted(watch, indices.len());
        let gym = || self.gym(watch);
        let played = all.run(indices, gym, |gym, &index, turn| {
            let before = gym.inner().spent().physics_steps;
            let (mut success, mut draws) = (None, 0);
            while success.is_none() && draws < u64::from(sampling.draws) && !watch.stopped() {
                // Equal draws on any number of threads.
                let mut dice = seed::generator("drawn calibration", &[index, draws]);
                let mut units = || dice.random::<f64>();
                let mut act = |obs: &[f32]| policy.sample(obs, sampling.temperature, &mut units);
                success = succeeds(gym, index, &mut act);
                draws += 1;
            }
            let episode = GreedyEpisode {
                physics_steps: gym.inner().spent().physics_steps - before,
                cpu_s: turn.cpu_s(),
                // Drawn successes are only counted, and no learner is shown them.
                success: None,
            };
            Some((success.is_some(), draws, episode))
        });
        let episodes = played.into_iter().map(Option::unwrap_or_default);
        (!watch.stopped()).then(|| episodes.collect())
    }
}

/// Returns the actions of a success of an ado.
///
/// Under Definition 4 exactly the successes have a reward above 0.
fn succeeds(
    gym: &mut TrainingGym<'_>,
    index: u64,
    act: &mut dyn FnMut(&[f32]) -> usize,
) -> Option<Vec<usize>> {
    let mut obs = vec![0.0; gym.spaces().observation];
    gym.reset(index, &mut obs);
    let (mut total, mut actions) = (0.0, Vec::new());
    loop {
        let action = act(&obs);
        actions.push(action);
        let step = gym.step(action, &mut obs);
        total += step.reward;
        if step.end.is_some() {
            return (total > 0.0).then_some(actions);
        }
    }
}
