//! Open-loop replay of the training's counterexamples nearest to a start.
//!
//! A falsifier has these replays without further cost, so a reusable ado must beat them
//! on a changed ego.

use crate::run_dir::Stored;
use crate::scene::Start;
use crate::testbench::{Actor, Aftermath, Episode, NoisyStart, Testbench, play};

/// Replay of the stored counterexample of a rank by distance to the start.
pub(super) struct NearestReplay<'a> {
    stored: &'a Stored,
    rank: usize,
    actions: &'a [usize],
    next: usize,
}

impl<'a> NearestReplay<'a> {
    /// Creates the replay of a rank. Rank 0 is the nearest. A missing rank holds action
    /// 0.
    pub(super) fn new(stored: &'a Stored, rank: usize) -> NearestReplay<'a> {
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
        // The list is sorted by distance, so a rank is found behind all lower ones.
        let by_distance = self.stored.nearest(start, self.rank + 1);
        let nearest = by_distance.get(self.rank);
        self.actions = nearest.map_or(&[], |nearest| &nearest.actions);
        self.next = 0;
    }

    fn act(&mut self, _obs: &[f32]) -> usize {
        // The recording ends at its success, and an episode of another ego may last
        // longer.
        let action = self.actions.get(self.next).or(self.actions.last());
        self.next += 1;
        action.copied().unwrap_or(0)
    }
}

/// Replays the nearest counterexamples, nearest first, until one succeeds.
///
/// Returns the success, or the failure of the nearest, with the simulations and the
/// physics steps of all replays.
pub(super) fn replay_nearest(
    bench: &mut Testbench,
    from: NoisyStart<'_>,
    stored: &Stored,
    nearest: usize,
) -> (Episode, u64, u64) {
    let mut one = |rank: usize| {
        let mut actor = NearestReplay::new(stored, rank);
        play(bench, from.start, from.noise, &mut actor, Aftermath::Play)
    };
    // Played even if nothing is stored, so that the start has an outcome.
    let mut first = one(0);
    let (mut simulations, mut physics_steps) = (1, first.physics_steps);
    if first.verdict.is_success() {
        return (first, simulations, physics_steps);
    }
    // A rank beyond the list would only repeat action 0.
    for rank in 1..nearest.min(stored.all().len()) {
        let episode = one(rank);
        simulations += 1;
        physics_steps += episode.physics_steps;
        if episode.verdict.is_success() {
            return (episode, simulations, physics_steps);
        }
        // The outcome of a replay with a fault is unknown, so the fault takes precedence.
        if episode.fault.is_some() && first.fault.is_none() {
            first = episode;
        }
    }
    (first, simulations, physics_steps)
}
