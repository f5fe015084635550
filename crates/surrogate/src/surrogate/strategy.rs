//! Strategies of an ado from a start on.
//!
//! A start can be planned again with the motion recorded in its earlier runs.
//! The ego is assumed to be deterministic: equal inputs give equal answers.
//! While the ado repeats the actions of an earlier run, the ego's motion is known.
//! The surrogate predicts only the part after the actions differ.
//! A later departure leaves less to predict.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use super::model::Surrogate;
use super::surrogate_sim::{ModelBench, RunPrefix, VARIATIONS};
use crate::rl::Policy;
use crate::testbench::NoisyStart;

/// Behaviour of the ado from a start on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Strategy {
    /// Follows the trained policy.
    AsTrained,
    /// Follows the policy trained inside the surrogate.
    FineTuned,
    /// Plays these actions from the start on, the last action held.
    Plan(Vec<usize>),
}

/// Policies of the ado.
#[derive(Clone, Copy)]
pub(super) struct Policies<'a> {
    pub as_trained: &'a dyn Policy,
    /// Policy trained inside the surrogate, if any.
    pub fine_tuned: Option<&'a dyn Policy>,
}

impl<'a> Policies<'a> {
    /// Returns the available policies as strategies.
    pub(super) fn strategies(self) -> impl Iterator<Item = Strategy> {
        let fine_tuned = self.fine_tuned.map(|_| Strategy::FineTuned);
        std::iter::once(Strategy::AsTrained).chain(fine_tuned)
    }

    /// Returns the policy of a strategy, or `None` for a plan.
    pub(super) fn of(self, strategy: &Strategy) -> Option<&'a dyn Policy> {
        match strategy {
            Strategy::AsTrained => Some(self.as_trained),
            Strategy::FineTuned => self.fine_tuned,
            Strategy::Plan(_) => None,
        }
    }
}

/// Continues from `so_far` with a strategy.
pub(super) fn play_strategy(
    judge: &mut ModelBench,
    so_far: &RunPrefix,
    strategy: &Strategy,
    policies: Policies<'_>,
) {
    if let Strategy::Plan(actions) = strategy {
        // The last action is held, so at least one action remains to be played.
        let from = so_far.actions.len().min(actions.len().saturating_sub(1));
        judge.play_actions(&actions[from..]);
    } else if let Some(policy) = policies.of(strategy) {
        judge.follow(policy);
    }
}

/// Trial of strategies on all variations.
pub(super) struct RobustScore<'a> {
    pub judge: &'a mut ModelBench,
    pub surrogate: &'a Arc<Surrogate>,
    pub from: NoisyStart<'a>,
    pub so_far: &'a RunPrefix,
    pub policies: Policies<'a>,
    pub earlier: &'a Earlier,
    pub lead: usize,
}

impl RobustScore<'_> {
    /// Returns the number of variations on which a strategy succeeds.
    ///
    /// A failure on the leading variation gives 0. Counting ends at `wanted.end`, or as soon
    /// as `wanted.start` cannot be exceeded.
    pub(super) fn score(&mut self, strategy: &Strategy, wanted: Range<usize>) -> usize {
        let samples = self.judge.bench.clock().samples_per_decision();
        // The real ego has already survived this strategy from this start.
        if self.so_far.actions.is_empty() && self.earlier.has_followed(strategy) {
            return 0;
        }
        let known = self.earlier.known_under(self.so_far, strategy, samples);
        let others = (0..VARIATIONS.len()).filter(|&other| other != self.lead);
        let mut score = 0;
        for (tried, variation) in std::iter::once(self.lead).chain(others).enumerate() {
            if score == wanted.end || score + (VARIATIONS.len() - tried) <= wanted.start {
                break;
            }
            let variation = VARIATIONS[variation];
            self.judge
                .begin(self.from, &known, Some(self.surrogate), variation);
            play_strategy(self.judge, &known, strategy, self.policies);
            match (self.judge.is_success(), tried) {
                (true, _) => score += 1,
                (false, 0) => return 0,
                (false, _) => {}
            }
        }
        score
    }
}

/// Distance in decisions between two points at which an earlier run can be left.
const EVERY: usize = 2;

/// Earlier runs from a start, none of them successful.
#[derive(Clone, Debug, Default)]
pub(super) struct Earlier {
    runs: Vec<RunPrefix>,
    /// Strategies that the ado followed from beginning to end.
    followed: Vec<Strategy>,
}

impl Earlier {
    /// Adds an unsuccessful run and the strategy followed throughout it.
    pub(super) fn add(&mut self, run: RunPrefix, followed: Option<Strategy>) {
        self.followed.extend(followed);
        self.runs.push(run);
    }

    /// Returns the number of earlier runs.
    pub(super) fn count(&self) -> usize {
        self.runs.len()
    }

    /// Returns whether a strategy was already followed from the start without success.
    pub(super) fn has_followed(&self, strategy: &Strategy) -> bool {
        match strategy {
            Strategy::Plan(actions) => self.has_played(actions),
            policy => self.followed.contains(policy),
        }
    }

    /// Returns whether these actions, the last action held, were played to the end.
    fn has_played(&self, actions: &[usize]) -> bool {
        let mut runs = self.runs.iter();
        runs.any(|run| common(run, actions) == run.actions.len())
    }

    /// Returns the known run for these actions, the last action held.
    ///
    /// It is `so_far`, or a longer part of an earlier run that began with the actions.
    fn known<'a>(
        &self,
        so_far: &'a RunPrefix,
        actions: &[usize],
        samples: usize,
    ) -> Cow<'a, RunPrefix> {
        let runs = self.runs.iter().map(|run| (common(run, actions), run));
        // A replay of an earlier run is worth it only where it is longer than this run.
        match runs.max_by_key(|(same, _)| *same) {
            Some((same, run)) if so_far.actions.len() < same => {
                Cow::Owned(run.up_to(same, samples))
            }
            _ => Cow::Borrowed(so_far),
        }
    }

    /// Returns the known run under a strategy. The actions of a policy are not known.
    pub(super) fn known_under<'a>(
        &self,
        so_far: &'a RunPrefix,
        strategy: &Strategy,
        samples: usize,
    ) -> Cow<'a, RunPrefix> {
        match strategy {
            Strategy::Plan(actions) => self.known(so_far, actions, samples),
            _ => Cow::Borrowed(so_far),
        }
    }

    /// Returns the points at which earlier runs can be left.
    ///
    /// `samples` is the number of samples per decision.
    pub(super) fn beginnings(&self, samples: usize) -> Vec<RunPrefix> {
        let of_run = |run: &RunPrefix| {
            // Plans from the start are tried by themselves, so the first point lies
            // behind it.
            let lengths = (EVERY..run.actions.len()).step_by(EVERY);
            let beginnings = lengths.map(|length| run.up_to(length, samples));
            beginnings.collect::<Vec<_>>()
        };
        self.runs.iter().flat_map(of_run).collect()
    }
}

/// Returns how many leading actions of a run equal these actions, the last action held.
fn common(run: &RunPrefix, actions: &[usize]) -> usize {
    // The last action is held, so a short plan is compared with the whole run.
    let wanted = actions.iter().chain(std::iter::repeat_n(
        actions.last().unwrap_or(&0),
        run.actions.len(),
    ));
    let pairs = run.actions.iter().zip(wanted);
    pairs.take_while(|(run, wanted)| run == wanted).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surrogate::ego_motion::MotionSample;

    /// Run with two samples per decision. The sample number is the position.
    fn run(actions: &[usize]) -> RunPrefix {
        let moment = |sample: usize| MotionSample {
            s_m: sample as f64,
            ..MotionSample::default()
        };
        RunPrefix {
            actions: actions.to_vec(),
            motion: (0..=2 * actions.len()).map(moment).collect(),
        }
    }

    fn earlier(runs: &[&[usize]]) -> Earlier {
        Earlier {
            runs: runs.iter().map(|actions| run(actions)).collect(),
            followed: vec![Strategy::AsTrained],
        }
    }

    #[test]
    fn an_earlier_run_tells_how_the_ego_moves_until_the_actions_differ() {
        let earlier = earlier(&[&[0, 1, 1, 2], &[0, 1, 2, 2, 2]]);
        let nothing = run(&[]);
        let known = |actions: &[usize]| {
            let known = earlier.known(&nothing, actions, 2);
            (known.actions.len(), known.motion.len())
        };
        assert_eq!(known(&[1]), (0, 1));
        assert_eq!(known(&[0]), (1, 3));
        assert_eq!(known(&[0, 1]), (3, 7), "the last action is held");
        assert_eq!(known(&[0, 1, 2, 0]), (3, 7));
        assert_eq!(known(&[0, 1, 2]), (5, 11), "to its end");
        // The motion of this run is longer than any known beginning of an earlier run.
        let seen = run(&[0, 1, 1, 0]);
        assert_eq!(*earlier.known(&seen, &[0, 1, 1, 0, 2], 2), seen);
    }

    #[test]
    fn what_was_played_to_its_end_is_not_played_again() {
        let earlier = earlier(&[&[0, 1, 1, 2]]);
        assert!(earlier.has_played(&[0, 1, 1, 2]));
        assert!(!earlier.has_played(&[0, 1, 1]));
        assert!(!earlier.has_played(&[0, 1]));
        assert!(earlier.has_followed(&Strategy::Plan(vec![0, 1, 1, 2])));
        assert!(earlier.has_followed(&Strategy::AsTrained));
        assert!(!earlier.has_followed(&Strategy::FineTuned));
        assert!(super::Earlier::default().beginnings(2).is_empty());
        let from: Vec<_> = earlier.beginnings(2);
        assert_eq!(from.len(), 1);
        assert_eq!((from[0].actions.len(), from[0].motion.len()), (2, 5));
    }
}
