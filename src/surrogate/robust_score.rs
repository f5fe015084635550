//! Trial of a strategy on the surrogate and its variations.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use super::earlier_attempts::Earlier;
use super::model::Surrogate;
use super::strategy::{Policies, Strategy};
use super::surrogate_sim::{ModelBench, NoisyStart, RunPrefix, VARIATIONS};

/// Continues from `so_far` with a strategy.
pub(super) fn go_on(
    judge: &mut ModelBench,
    so_far: &RunPrefix,
    (strategy, policies): (&Strategy, Policies<'_>),
) {
    if let Strategy::Plan(actions) = strategy {
        // The last action is held, so at least one action remains to be played.
        let from = so_far.actions.len().min(actions.len().saturating_sub(1));
        judge.go_on(&actions[from..]);
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
    /// A failure on the leading variation gives 0. Counting ends at `asked.end`, or as soon
    /// as `asked.start` cannot be exceeded.
    pub fn score(&mut self, strategy: &Strategy, asked: Range<usize>) -> usize {
        let samples = self.judge.bench.clock().samples_per_decision();
        // The real ego has already survived this strategy from this start.
        if self.so_far.actions.is_empty() && self.earlier.has_followed(strategy) {
            return 0;
        }
        let known = match strategy {
            Strategy::Plan(actions) => self.earlier.known(self.so_far, actions, samples),
            _ => Cow::Borrowed(self.so_far),
        };
        let others = (0..VARIATIONS.len()).filter(|&other| other != self.lead);
        let mut score = 0;
        for (tried, variation) in std::iter::once(self.lead).chain(others).enumerate() {
            if score == asked.end || score + (VARIATIONS.len() - tried) <= asked.start {
                break;
            }
            let variation = VARIATIONS[variation];
            self.judge
                .begin(self.from, &known, Some(self.surrogate), variation);
            go_on(self.judge, &known, (strategy, self.policies));
            match (self.judge.is_success(), tried) {
                (true, _) => score += 1,
                (false, 0) => return 0,
                (false, _) => {}
            }
        }
        score
    }
}
