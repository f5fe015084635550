//! Random actions, each held for a number of decisions.

use super::trials::Trials;
use crate::scene::Start;
use crate::seed;
use crate::testbench::{Actor, HeldRandom};

/// Tries random sequences until the first success.
///
/// The generator depends on the noise of the start.
pub(super) fn solve(trials: &mut Trials<'_>, hold: usize) {
    let mut actor = Reseeded {
        held: HeldRandom::new(trials.actions(), hold),
        // Each trial replaces it.
        seed: 0,
    };
    loop {
        // The noise belongs to the start, and only the ado's generator differs between trials.
        let mut dice = seed::generator("search", &[trials.noise(), hold as u64, trials.spent()]);
        actor.seed = rand::Rng::next_u64(&mut dice);
        if trials.play(&mut actor).is_none() {
            return;
        }
    }
}

/// Held random actions from a seed that is independent of the episode's noise.
struct Reseeded {
    held: HeldRandom,
    seed: u64,
}

impl Actor for Reseeded {
    fn begin(&mut self, _noise: u64, start: &Start) {
        self.held.begin(self.seed, start);
    }

    fn act(&mut self, obs: &[f32]) -> usize {
        self.held.act(obs)
    }
}
