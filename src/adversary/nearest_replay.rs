//! Open-loop replay of the training's counterexamples nearest to a start.
//!
//! A falsifier that kept what it found has these for nothing: what a reusable
//! ado must beat on a changed ego.

use crate::run_dir::Stored;
use crate::scene::Start;
use crate::testbench::{Actor, Aftermath, Episode, Testbench, play};

/// Replays the stored counterexample of one rank by distance to the start.
pub(super) struct NearestReplay<'a> {
    stored: &'a Stored,
    rank: usize,
    actions: &'a [usize],
    next: usize,
}

impl<'a> NearestReplay<'a> {
    /// Rank 0 is the nearest; where there are fewer, action 0 is held.
    pub fn new(stored: &'a Stored, rank: usize) -> NearestReplay<'a> {
        NearestReplay {
            stored,
            rank,
            actions: &[],
            next: 0,
        }
    }
}

impl Actor for NearestReplay<'_> {
    fn begin(&mut self, _seed: u64, start: &Start) {
        let nearest = self.stored.nearest(start, self.rank + 1);
        let nearest = nearest.get(self.rank);
        self.actions = nearest.map_or(&[], |nearest| &nearest.actions);
        self.next = 0;
    }

    fn act(&mut self, _obs: &[f32]) -> usize {
        let action = self.actions.get(self.next).or(self.actions.last());
        self.next += 1;
        action.copied().unwrap_or(0)
    }
}

/// Replays the nearest ones, nearest first, until one succeeds.
///
/// Gives the success, or the nearest one's failure, with the simulations and
/// the physics steps of all that were tried.
pub(super) fn replay_nearest(
    bench: &mut Testbench,
    (start, noise): (&Start, u64),
    stored: &Stored,
    nearest: usize,
) -> (Episode, u64, u64) {
    let mut one = |rank: usize| {
        let mut actor = NearestReplay::new(stored, rank);
        play(bench, start, noise, &mut actor, Aftermath::Play)
    };
    let mut first = one(0);
    let (mut simulations, mut physics_steps) = (1, first.physics_steps);
    if first.verdict.is_success() {
        return (first, simulations, physics_steps);
    }
    for rank in 1..nearest.min(stored.all().len()) {
        let episode = one(rank);
        simulations += 1;
        physics_steps += episode.physics_steps;
        if episode.verdict.is_success() {
            return (episode, simulations, physics_steps);
        }
        // Nobody knows what a replay would have come to whose ego did not run.
        if episode.fault.is_some() && first.fault.is_none() {
            first = episode;
        }
    }
    (first, simulations, physics_steps)
}
