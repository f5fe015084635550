//! Experience of an episode under a law of actions.

use crate::rl::End;
use crate::rl::replay::{EpisodeBuffer, Transition};
use crate::rl::soft_backup::SoftBackup;

/// Returns the law's scaled logarithms of so many actions, with which an observation ends.
pub(super) fn logs(obs: &[f32], actions: usize) -> &[f32] {
    &obs[obs.len() - actions..]
}

/// Episode whose observations end with the law of the actions.
#[derive(Clone, Copy)]
pub(super) struct LawfulEpisode<'a> {
    pub(super) buffer: &'a EpisodeBuffer,
    pub(super) end: End,
    /// Length of an observation.
    pub(super) width: usize,
    /// Number of actions.
    pub(super) actions: usize,
}

impl LawfulEpisode<'_> {
    /// Passes the transitions of an episode to `take`.
    ///
    /// The reward of a transition is a lower bound of its value: that of the actions which the
    /// episode took after it, and −1 without a success. A success is found long before all ways
    /// to it are known, and the bound hands its size to all earlier decisions at once (He et al.
    /// 2017). It holds where equal actions have equal results, and is too high by the luck of an
    /// episode where they have not.
    pub(super) fn transitions(self, law: SoftBackup, mut take: impl FnMut(Transition<'_>)) {
        let LawfulEpisode {
            buffer,
            end,
            width,
            actions,
        } = self;
        let row = |t: usize| &buffer.observations[t * width..(t + 1) * width];
        let total: f32 = buffer.rewards.iter().sum();
        let mut bound = if total > 0.0 { 0.0 } else { -1.0 };
        // Backwards, since a bound is made from the later one.
        for t in (0..buffer.actions.len()).rev() {
            let is_last = t + 1 == buffer.actions.len();
            if !is_last {
                let action = buffer.actions[t + 1];
                bound = law.along(logs(row(t + 1), actions)[action], bound);
            }
            take(Transition {
                observation: row(t),
                action: buffer.actions[t],
                reward: bound,
                next: row(t + 1),
                discount: if is_last && end != End::Truncated {
                    0.0
                } else {
                    1.0
                },
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_success_bounds_the_values_of_all_decisions_before_it() {
        // An observation is a number and the logarithms of two actions.
        let law = SoftBackup { floor: 30.0 };
        let log = |p: f64| (0.1 * libm::log(p)) as f32;
        let mut buffer = EpisodeBuffer::default();
        buffer.begin(&[0.0, log(0.5), log(0.5)]);
        buffer.note(0, true, 0.0, &[1.0, log(0.9), log(0.1)]);
        buffer.note(1, true, 0.7, &[2.0, 0.0, 0.0]);
        let mut bounds = Vec::new();
        let take = |it: Transition<'_>| bounds.push((it.observation[0], it.reward, it.discount));
        fn episode(buffer: &EpisodeBuffer, end: End) -> LawfulEpisode<'_> {
            LawfulEpisode {
                buffer,
                end,
                width: 3,
                actions: 2,
            }
        }
        episode(&buffer, End::Terminated).transitions(law, take);
        let first = (libm::log(0.1) / 30.0) as f32;
        assert_eq!(bounds[0], (1.0, 0.0, 0.0));
        assert!((bounds[1].1 - first).abs() < 1e-6 && bounds[1].2 == 1.0);
        // A failure bounds nothing, and an episode that was cut off goes on.
        buffer.rewards[1] = -1.0;
        let mut bounds = Vec::new();
        let take = |it: Transition<'_>| bounds.push((it.reward, it.discount));
        episode(&buffer, End::Truncated).transitions(law, take);
        assert_eq!(bounds, [(-1.0, 1.0); 2]);
    }
}
