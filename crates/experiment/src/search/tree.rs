//! Sequences with few action switches, with prefixes shared by copying the bench.
//!
//! Of n decisions and a actions there are a · C(n − 1, k) · (a − 1)^k sequences with k
//! switches.
//! Played alone, each costs n decisions. In a tree, a sequence costs the decisions after
//! its last switch, and all sequences share the decisions before it.

use crate::ego::Fault;
use crate::experiment::Watch;
use crate::testbench::{Aftermath, NoisyStart, Testbench};

/// The verdict ends a sequence: what follows it is not searched.
const AFTERMATH: Aftermath = Aftermath::Skip;

/// Decision to continue or to stop.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum WalkControl {
    /// Continue with the next sequence.
    Continue,
    /// Stop the walk.
    Stop,
}

/// Tree of all sequences with a given number of switches.
///
/// Prefixes are shared by forking the bench.
/// An ego that cannot be copied, such as a program, plays every sequence from the start.
/// The sequences run one after another, so one program is enough.
pub struct Tree<'a> {
    from: NoisyStart<'a>,
    index: usize,
    forks: bool,
    actions: usize,
    /// Invariant: the actions played so far on the explored bench.
    prefix: Vec<usize>,
    accept: Accept<'a>,
    watch: &'a Watch<'a>,
    /// Actions before the first sequence, which are played already.
    pub after: Vec<usize>,
    /// Spacing of the decisions at which actions may switch.
    pub stride: usize,
    /// Largest number of physics steps.
    pub budget: u64,
    /// Largest number of sequences.
    pub most: u64,
    /// First fault of the ego or the physics.
    pub fault: Option<Fault>,
    /// Sequences played. A part of a sequence counts as a sequence.
    pub simulations: u64,
    /// Sequences in which a rule was broken.
    pub violations: u64,
    /// Physics steps spent.
    pub physics_steps: u64,
}

/// Callback for every sequence that makes the ego fail, with its final bench.
pub(crate) type Accept<'a> = &'a mut dyn FnMut(&[usize], &Testbench) -> WalkControl;

impl<'a> Tree<'a> {
    /// Creates a tree on `root` for the `index`th start, without any played sequence.
    pub fn new(
        root: &mut Testbench,
        from: NoisyStart<'a>,
        index: usize,
        accept: Accept<'a>,
        watch: &'a Watch<'a>,
    ) -> Tree<'a> {
        root.begin(from.start, from.noise, AFTERMATH);
        Tree {
            from,
            index,
            // Copying is tried once, because the ego decides if it is possible.
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
            violations: 0,
            physics_steps: 0,
        }
    }

    /// Plays every sequence with exactly `switches` switches, beginning with `action`.
    pub fn begin(&mut self, root: &mut Testbench, action: usize, switches: usize) -> WalkControl {
        root.begin(self.from.start, self.from.noise, AFTERMATH);
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

    /// Continues with `action` and exactly `switches` later changes of it.
    fn explore(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> WalkControl {
        let depth = self.prefix.len();
        let next = if self.forks {
            self.walk(bench, action, switches)
        } else {
            self.walk_anew(bench, action, switches)
        };
        // Each branch returns the prefix as it was, because its siblings share it.
        self.prefix.truncate(depth);
        next
    }

    fn walk(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> WalkControl {
        if switches == 0 {
            // Only complete sequences count, so shared prefixes are not counted twice.
            if self.most <= self.simulations {
                return WalkControl::Stop;
            }
            self.simulations += 1;
        }
        while !bench.is_done() {
            if self.is_stopped() {
                return WalkControl::Stop;
            }
            let before = bench.physics_steps();
            bench.decide(action);
            self.physics_steps += bench.physics_steps() - before;
            self.prefix.push(action);
            // A switch changes the action, so no sequence occurs twice. At the end there is
            // no decision left to switch at.
            if switches == 0 || bench.is_done() || !self.may_switch(self.prefix.len()) {
                continue;
            }
            for other in (0..self.actions).filter(|&other| other != action) {
                if self.branch(bench, other, switches - 1) == WalkControl::Stop {
                    return WalkControl::Stop;
                }
            }
        }
        if switches == 0 {
            self.note(bench);
        }
        self.leaf(bench, switches)
    }

    /// Reports a sequence without further switches that makes the ego fail.
    fn leaf(&mut self, bench: &Testbench, switches: usize) -> WalkControl {
        let success = bench.verdict().is_some_and(|verdict| verdict.is_success());
        // A prefix that ends early has fewer switches and was visited before.
        if switches == 0 && success {
            (self.accept)(&self.prefix, bench)
        } else {
            WalkControl::Continue
        }
    }

    /// Counts the violations and faults of a finished episode.
    fn note(&mut self, bench: &Testbench) {
        let violates = bench.verdict().is_some_and(|verdict| verdict.is_foul());
        self.violations += u64::from(violates);
        self.watch.faults.note(self.index as u64, bench.fault());
        if self.fault.is_none() {
            self.fault = bench.fault().cloned();
        }
    }

    /// Walks the same sequences if the ego cannot be copied.
    ///
    /// The first run holds `action` to the end and shows where it can be switched. Each switch
    /// is then played from the start.
    fn walk_anew(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> WalkControl {
        if self.most <= self.simulations {
            return WalkControl::Stop;
        }
        let depth = self.prefix.len();
        while !bench.is_done() {
            // The steps of this run are added at its end, so the budget stops the next
            // one.
            if self.is_stopped() {
                return WalkControl::Stop;
            }
            bench.decide(action);
            self.prefix.push(action);
        }
        self.simulations += 1;
        // Every run begins at the start, so its whole cost counts.
        self.physics_steps += bench.physics_steps();
        self.note(bench);
        if switches == 0 {
            return self.leaf(bench, switches);
        }
        // The prefix up to a switch repeats the first run. A deterministic ego reaches the
        // same state there.
        let whole = self.prefix.clone();
        // At `depth` the held action was not played yet, so a change there is no switch.
        let switchable = (depth + 1..whole.len()).filter(|&at| self.may_switch(at));
        for at in switchable.collect::<Vec<_>>() {
            for other in (0..self.actions).filter(|&other| other != action) {
                bench.begin(self.from.start, self.from.noise, AFTERMATH);
                for &again in &whole[..at] {
                    bench.decide(again);
                }
                self.prefix.truncate(at);
                if self.explore(bench, other, switches - 1) == WalkControl::Stop {
                    return WalkControl::Stop;
                }
                // A later switch cuts the prefix at a greater depth, so it must be whole
                // again.
                self.prefix.extend_from_slice(&whole[at..]);
            }
        }
        WalkControl::Continue
    }

    /// Continues with another action on a copy and leaves `bench` unchanged.
    fn branch(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> WalkControl {
        let Some(mut branch) = bench.branch() else {
            // Invariant: an ego that was copied before can be copied again.
            return WalkControl::Stop;
        };
        let next = self.explore(&mut branch, action, switches);
        // The branch took the samples of this bench with it, and here they come back.
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
        let world = Scenario::shipped("acc")
            .expect("shipped")
            .expect("sound")
            .on(crate::sim::PlantKind::Kinematic);
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
            let start = (root.draw(key), root.noise_of(key));
            let mut accept = |actions: &[usize], _: &Testbench| {
                played.push(actions.to_vec());
                WalkControl::Continue
            };
            let from = NoisyStart::from(&start);
            let mut tree = Tree::new(&mut root, from, 0, &mut accept, &watch);
            tree.after.clone_from(&before);
            tree.stride = 4;
            for action in 0..3 {
                assert!(tree.begin(&mut root, action, 1) == WalkControl::Continue);
            }
            // Switches at decisions 4, 8, 12 … to one of two other actions, after each of three.
            assert!(tree.simulations <= 3 * 2 * 7);
        }
        assert!(!played.is_empty(), "some sequence succeeds on some start");
        for actions in played {
            assert_eq!(actions[..3], before);
            let switches: Vec<usize> = (4..actions.len())
                .filter(|&at| actions[at - 1] != actions[at])
                .collect();
            assert!(
                switches.len() == 1 && switches[0].is_multiple_of(4),
                "{actions:?}"
            );
        }
    }
}
