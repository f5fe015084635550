//! Joint policy without one of its ados, to see what that ado contributes.

use crate::rl::{Policy, Spaces};
use crate::scene::Start;
use crate::testbench::Actor;

/// Actor of a joint policy in which one ado plays its action without effect.
pub(super) struct WithoutAdo<'a> {
    policy: &'a dyn Policy,
    /// Place of the ado in a joint action: unit and number of its digit.
    unit: usize,
    actions: usize,
    neutral: usize,
}

impl<'a> WithoutAdo<'a> {
    /// Creates the actor without the ado `left_out`. An unknown name leaves out none.
    pub(super) fn new(policy: &'a dyn Policy, spaces: &Spaces, left_out: &str) -> WithoutAdo<'a> {
        // The first ado is the lowest digit of a joint action.
        let mut unit = 1;
        for part in &spaces.parts {
            if part.name == left_out {
                return WithoutAdo {
                    policy,
                    unit,
                    actions: part.actions,
                    neutral: part.neutral,
                };
            }
            unit *= part.actions;
        }
        WithoutAdo {
            policy,
            unit: 1,
            actions: 1,
            neutral: 0,
        }
    }

    fn without(&self, joint: usize) -> usize {
        let own = joint / self.unit % self.actions;
        joint - own * self.unit + self.neutral * self.unit
    }
}

impl Actor for WithoutAdo<'_> {
    fn begin(&mut self, _seed: u64, _start: &Start) {}

    fn act(&mut self, obs: &[f32]) -> usize {
        self.without(self.policy.act(obs))
    }

    fn act_among(&mut self, obs: &[f32], allowed: &[bool]) -> usize {
        self.without(self.policy.act_among(obs, allowed))
    }
}
