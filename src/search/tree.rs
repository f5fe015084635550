//! Sequences with few switches of action, prefixes shared by copying the bench.
//!
//! Of n decisions and a actions there are a · C(n − 1, k) · (a − 1)^k sequences
//! with k switches. Played one by one they cost n decisions each; in a tree, a
//! sequence costs what follows its last switch, and all share what lies before.

use crate::ego::Fault;
use crate::experiment::Watch;
use crate::scene::Start;
use crate::testbench::{Aftermath, Testbench};

/// Whether to go on.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Next {
    /// With the next sequence.
    Continue,
    /// Not any more.
    Stop,
}

/// All sequences with a given number of switches, prefixes shared by forking.
///
/// An ego that cannot be copied, a program say, plays every sequence from the
/// start, one after the other: one program is enough for that.
pub(crate) struct Tree<'a> {
    start: &'a Start,
    noise: u64,
    index: usize,
    aftermath: Aftermath,
    forks: bool,
    actions: usize,
    /// Invariant: what the bench that is being explored has played so far.
    prefix: Vec<usize>,
    accept: Accept<'a>,
    watch: &'a Watch<'a>,
    /// Actions before the first sequence begins, played already.
    pub after: Vec<usize>,
    /// Actions are switched at every so many-th decision only.
    pub stride: usize,
    /// Physics steps that may be spent.
    pub budget: u64,
    /// Sequences that may be played.
    pub most: u64,
    /// The first fault met.
    pub fault: Option<Fault>,
    /// Sequences played, a part of one counted as one.
    pub simulations: u64,
    /// Those of them in which a rule was broken.
    pub fouls: u64,
    /// Physics steps spent.
    pub physics_steps: u64,
}

/// Is told of every sequence that makes the ego fail, and of how it ended.
pub(crate) type Accept<'a> = &'a mut dyn FnMut(&[usize], &Testbench) -> Next;

impl<'a> Tree<'a> {
    /// Nothing played yet on `root` from a start, which is the `index`th.
    pub fn new(
        root: &mut Testbench,
        ((start, noise), index): ((&'a Start, u64), usize),
        aftermath: Aftermath,
        accept: Accept<'a>,
        watch: &'a Watch<'a>,
    ) -> Tree<'a> {
        root.begin(start, noise, aftermath);
        Tree {
            start,
            noise,
            index,
            aftermath,
            forks: root.fork().is_some(),
            actions: root.spaces().actions,
            prefix: Vec::new(),
            accept,
            watch,
            after: Vec::new(),
            stride: 1,
            budget: u64::MAX,
            most: u64::MAX,
            fault: None,
            simulations: 0,
            fouls: 0,
            physics_steps: 0,
        }
    }

    /// Every sequence that begins with `action` and has exactly so many switches.
    pub fn begin(&mut self, root: &mut Testbench, action: usize, switches: usize) -> Next {
        root.begin(self.start, self.noise, self.aftermath);
        for &before in &self.after {
            root.decide(before);
        }
        self.prefix.clone_from(&self.after);
        self.explore(root, action, switches)
    }

    fn may_switch(&self, decision: usize) -> bool {
        decision.is_multiple_of(self.stride)
    }

    fn is_stopped(&self) -> bool {
        self.watch.stopped() || self.budget <= self.physics_steps
    }

    /// Goes on with `action` and exactly `switches` later changes of it.
    fn explore(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        let depth = self.prefix.len();
        let next = match self.forks {
            true => self.walk(bench, action, switches),
            false => self.walk_anew(bench, action, switches),
        };
        self.prefix.truncate(depth);
        next
    }

    fn walk(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        if switches == 0 {
            if self.most <= self.simulations {
                return Next::Stop;
            }
            self.simulations += 1;
        }
        while !bench.is_done() {
            if self.is_stopped() {
                return Next::Stop;
            }
            let before = bench.physics_steps();
            bench.decide(action);
            self.physics_steps += bench.physics_steps() - before;
            self.prefix.push(action);
            // A switch is to another action, so no sequence is met twice, and at
            // the very end there is nothing to switch to.
            if switches == 0 || bench.is_done() || !self.may_switch(self.prefix.len()) {
                continue;
            }
            for other in (0..self.actions).filter(|&other| other != action) {
                if self.branch(bench, other, switches - 1) == Next::Stop {
                    return Next::Stop;
                }
            }
        }
        if switches == 0 {
            self.note(bench);
        }
        self.leaf(bench, switches)
    }

    /// Whether a sequence without further switches makes the ego fail.
    fn leaf(&mut self, bench: &Testbench, switches: usize) -> Next {
        let success = bench.verdict().is_some_and(|verdict| verdict.is_success());
        match switches == 0 && success {
            true => (self.accept)(&self.prefix, bench),
            false => Next::Continue,
        }
    }

    /// An episode is over.
    fn note(&mut self, bench: &Testbench) {
        let fouled = bench.verdict().is_some_and(|verdict| verdict.is_foul());
        self.fouls += u64::from(fouled);
        self.watch.faults.note(self.index as u64, bench.fault());
        if self.fault.is_none() {
            self.fault = bench.fault().cloned();
        }
    }

    /// The same where the ego cannot be copied: first to the end with `action`,
    /// which tells where it can be changed, then each change from the start.
    fn walk_anew(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        if self.most <= self.simulations {
            return Next::Stop;
        }
        let depth = self.prefix.len();
        while !bench.is_done() {
            if self.is_stopped() {
                return Next::Stop;
            }
            bench.decide(action);
            self.prefix.push(action);
        }
        self.simulations += 1;
        self.physics_steps += bench.physics_steps();
        self.note(bench);
        if switches == 0 {
            return self.leaf(bench, switches);
        }
        // What the others play up to their switch is the same again: an ego that
        // answers twice alike gets there with the same state.
        let whole = self.prefix.clone();
        let switchable = (depth + 1..whole.len()).filter(|&at| self.may_switch(at));
        for at in switchable.collect::<Vec<_>>() {
            for other in (0..self.actions).filter(|&other| other != action) {
                bench.begin(self.start, self.noise, self.aftermath);
                for &again in &whole[..at] {
                    bench.decide(again);
                }
                self.prefix.truncate(at);
                if self.explore(bench, other, switches - 1) == Next::Stop {
                    return Next::Stop;
                }
                self.prefix.extend_from_slice(&whole[at..]);
            }
        }
        Next::Continue
    }

    /// Goes on from here with another action and leaves `bench` as it is.
    fn branch(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        let Some(mut branch) = bench.branch() else {
            // Invariant: an ego that was copied once can be copied again.
            return Next::Stop;
        };
        let next = self.explore(&mut branch, action, switches);
        bench.rejoin(branch);
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Purpose, StartKey};
    use crate::world::Scenario;

    #[test]
    fn sequences_go_on_from_what_is_played_and_switch_where_they_may() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let world = world.on(crate::sim::PlantKind::Kinematic);
        let mut root = world.bench();
        let before = vec![1, 1, 1];
        let mut played = Vec::new();
        let watch = Watch::unwatched();
        for index in 0..8 {
            let key = StartKey {
                purpose: Purpose::Train,
                seed: 1,
                index,
            };
            let (start, noise) = (root.draw(key), root.noise_of(key));
            let mut accept = |actions: &[usize], _: &Testbench| {
                played.push(actions.to_vec());
                Next::Continue
            };
            let from = ((&start, noise), 0);
            let mut tree = Tree::new(&mut root, from, Aftermath::Skip, &mut accept, &watch);
            tree.after.clone_from(&before);
            tree.stride = 4;
            for action in 0..3 {
                assert!(tree.begin(&mut root, action, 1) == Next::Continue);
            }
            // From decision 4, 8, 12 … on, to one of two others, after each of three.
            assert!(tree.simulations <= 3 * 2 * 7);
        }
        assert!(!played.is_empty(), "some sequence succeeds on some start");
        for actions in played {
            assert_eq!(actions[..3], before);
            let switches = (4..actions.len()).filter(|&at| actions[at - 1] != actions[at]);
            let switches: Vec<usize> = switches.collect();
            assert!(
                switches.len() == 1 && switches[0].is_multiple_of(4),
                "{actions:?}"
            );
        }
    }
}
