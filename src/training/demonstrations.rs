//! What a search finds on training starts before a training, to be shown to
//! learners that want demonstrations.

use super::training_search::{Scout, Scouted};
use crate::experiment::Watch;
use crate::rl::{Demonstration, Seeding};
use crate::run_dir::Sought;
use crate::seed::Purpose;
use crate::world::Scenario;

/// The first start that is searched: no learner gets that far by itself.
const FIRST_START: u64 = 1 << 40;
/// Starts that are searched between two looks at what was spent.
const CHUNK: usize = 10;
/// Starts after which it is judged whether one switch is enough.
const TRIED: usize = 50;
/// Share of them that must be solved with one switch: else two are allowed.
const ENOUGH: f64 = 0.05;

/// Demonstrations, and what it took to find them.
pub(super) struct Seeded {
    pub demonstrations: Vec<Demonstration>,
    pub sought: Sought,
    pub cpu_s: f64,
}

/// Searches training starts of `seed` for demonstrations; `None`: stopped.
///
/// One switch of action first; two, where one finds nearly nothing. The search
/// spends no more than two simulations per decision of the training.
pub(super) fn seed_training(
    scenario: &Scenario,
    seed: u64,
    seeding: &Seeding,
    watch: &Watch<'_>,
) -> Option<Seeded> {
    let decisions = scenario.learner.decisions();
    let mut most = seeding.simulations.min(decisions.saturating_mul(2));
    let scout = Scout::new(scenario, Purpose::Train, seed);
    if !scout.forks() {
        most /= 100;
    }
    let indices: Vec<u64> = (0..seeding.starts as u64)
        .map(|i| FIRST_START + i)
        .collect();
    let mut seeded = Seeded {
        demonstrations: Vec::new(),
        sought: Sought::default(),
        cpu_s: 0.0,
    };
    let mut switches = 1;
    for chunk in indices.chunks(CHUNK) {
        let spent = seeded.sought.simulations;
        if most <= spent {
            break;
        }
        let tried = seeded.sought.starts as usize;
        let few = (seeded.demonstrations.len() as f64) < ENOUGH * tried as f64;
        if switches == 1 && TRIED <= tried && few {
            switches = 2;
        }
        let each = ((most - spent) / CHUNK as u64).max(1);
        let progress = (tried, indices.len());
        let found = scout.search(chunk, (switches, each), progress, watch);
        if watch.stopped() {
            return None;
        }
        let pairs = chunk.iter().zip(found.into_iter().flatten());
        pairs.for_each(|(&index, scouted)| seeded.note(index, scouted));
    }
    Some(seeded)
}

impl Seeded {
    fn note(&mut self, index: u64, scouted: Scouted) {
        self.sought.starts += 1;
        self.sought.simulations += scouted.simulations;
        self.sought.physics_steps += scouted.physics_steps;
        self.cpu_s += scouted.cpu_s;
        if let Some(actions) = scouted.actions {
            self.sought.solved += 1;
            self.demonstrations.push(Demonstration { index, actions });
        }
    }
}
