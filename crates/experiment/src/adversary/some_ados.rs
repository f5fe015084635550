//! Joint policy of which only some ados act, to see what each of them contributes.

use crate::rl::{Policy, Spaces};
use crate::scene::Start;
use crate::testbench::{Actor, trained_actor};

/// Actor of a joint policy in which some ados play their actions without effect.
pub(super) struct SomeAdos<'a> {
    all: Box<dyn Actor + 'a>,
    idle: Vec<IdleAdo>,
}

/// Place of an idle ado in a joint action: unit and number of its digit.
struct IdleAdo {
    unit: usize,
    actions: usize,
    neutral: usize,
}

impl<'a> SomeAdos<'a> {
    /// Creates the actor in which the ados of these names are idle.
    ///
    /// `run` is the number of the draw, if the policy draws its actions.
    pub(super) fn new(
        policy: &'a dyn Policy,
        run: u64,
        spaces: &Spaces,
        is_idle: impl Fn(&str) -> bool,
    ) -> SomeAdos<'a> {
        // The first ado is the lowest digit of a joint action.
        let mut unit = 1;
        let mut idle = Vec::new();
        for part in &spaces.parts {
            if is_idle(&part.name) {
                idle.push(IdleAdo {
                    unit,
                    actions: part.actions,
                    neutral: part.neutral,
                });
            }
            unit *= part.actions;
        }
        SomeAdos {
            all: trained_actor(policy, run),
            idle,
        }
    }

    fn of_some(&self, joint: usize) -> usize {
        // Digits of the other ados stay, so that each acts as in the whole joint action.
        self.idle.iter().fold(joint, |joint, ado| {
            let own = joint / ado.unit % ado.actions;
            joint - own * ado.unit + ado.neutral * ado.unit
        })
    }
}

impl Actor for SomeAdos<'_> {
    fn begin(&mut self, seed: u64, start: &Start) {
        self.all.begin(seed, start);
    }

    fn act(&mut self, obs: &[f32]) -> usize {
        let joint = self.all.act(obs);
        self.of_some(joint)
    }

    fn act_among(&mut self, obs: &[f32], allowed: &[bool]) -> usize {
        // The result may be forbidden. The bench then plays the most similar allowed
        // action.
        let joint = self.all.act_among(obs, allowed);
        self.of_some(joint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::PartSpaces;

    /// Policy of one joint action.
    struct Always(usize);

    impl Policy for Always {
        fn act(&self, _obs: &[f32]) -> usize {
            self.0
        }

        fn value(&self, _obs: &[f32]) -> f32 {
            0.0
        }
    }

    #[test]
    fn idle_ados_play_their_neutral_actions_and_the_others_those_of_the_policy() {
        let part = |name: &str, actions, neutral| PartSpaces {
            name: name.to_owned(),
            actions,
            neutral,
            observed: Vec::new(),
        };
        let spaces = Spaces {
            observation: 0,
            actions: 24,
            neutral: 0,
            parts: vec![part("a", 2, 1), part("b", 3, 0), part("c", 4, 2)],
        };
        let joint = |digits: [usize; 3]| digits[0] + 2 * digits[1] + 6 * digits[2];
        let policy = Always(joint([0, 2, 3]));
        let acts =
            |is_idle: &dyn Fn(&str) -> bool| SomeAdos::new(&policy, 0, &spaces, is_idle).act(&[]);
        assert_eq!(acts(&|_| false), joint([0, 2, 3]));
        assert_eq!(acts(&|name| name == "b"), joint([0, 0, 3]));
        assert_eq!(acts(&|name| name != "b"), joint([1, 2, 2]));
        assert_eq!(acts(&|_| true), joint([1, 0, 2]));
    }
}
