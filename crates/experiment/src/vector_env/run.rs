//! What is known of the episode of one environment.

use crate::rl::End;
use crate::rulebook::{Rulebook, Verdict};
use crate::seed::StartKey;

/// Episode of one environment.
#[derive(Debug)]
pub(super) struct EnvRun {
    /// Key of its start, `None` before the first episode and for a start without one.
    pub(super) key: Option<StartKey>,
    /// Joint actions so far.
    pub(super) actions: Vec<u32>,
    pub(super) verdict: Option<Verdict>,
    /// True once a step has reported the end.
    pub(super) is_over: bool,
    /// ρ(ψ_ego) at the end, NaN before and after a fault.
    pub(super) robustness: f64,
}

impl EnvRun {
    /// Creates runs of at most `decisions` decisions that have not begun.
    pub(super) fn several(runs: usize, decisions: usize) -> Vec<EnvRun> {
        // All lists of actions one after the other in memory, and none of them grows.
        (0..runs).map(|_| EnvRun::new(decisions)).collect()
    }

    fn new(decisions: usize) -> EnvRun {
        EnvRun {
            key: None,
            actions: Vec::with_capacity(decisions),
            verdict: None,
            // Before the first episode, an environment stands still as after its last.
            is_over: true,
            robustness: f64::NAN,
        }
    }

    /// Begins an episode, of a key if it has one.
    pub(super) fn begin(&mut self, key: Option<StartKey>) {
        self.key = key;
        self.actions.clear();
        self.verdict = None;
        self.is_over = false;
        self.robustness = f64::NAN;
    }

    /// Returns reward and end of a step, and notes that the episode is over.
    pub(super) fn report(&mut self, rulebook: &Rulebook) -> (f64, Option<End>) {
        let Some(verdict) = self.verdict else {
            return (0.0, None);
        };
        self.is_over = true;
        match rulebook.reward_of(&verdict) {
            Some(reward) => (reward, Some(End::Terminated)),
            // An invalid episode has no reward.
            None => (0.0, Some(End::Aborted)),
        }
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<EnvRun>() + self.actions.capacity() * size_of::<u32>()
    }
}
