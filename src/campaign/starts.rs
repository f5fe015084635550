//! Test starts: drawn once, and the same for every ego, ado and method.

use rayon::prelude::*;

use super::Watch;
use crate::scenario::Scenario;
use crate::scene::Start;
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Aftermath, Constant};

/// Test starts, with those on which the nominal ego fails by itself.
#[derive(Clone, Debug)]
pub struct TestStarts {
    /// Seed of the stream.
    pub seed: u64,
    /// Each start with the seed of its noise.
    pub starts: Vec<(Start, u64)>,
    /// Whether the nominal ego fails without an adversary, all rules kept.
    ///
    /// Where it did not run at all nobody knows: such a start is not trivial,
    /// and the watch's log of faults has it.
    pub trivial: Vec<bool>,
}

/// Draws `count` test starts and plays each with coasting ados.
///
/// A finite world of no more than `count` starts gives each of them once.
///
/// `scenario` must be the nominal one on the plant its file names: what is
/// trivial is fixed once and carried to all egos and plants. `None`: stopped.
pub fn test_starts(
    scenario: &Scenario,
    seed: u64,
    count: usize,
    watch: &Watch<'_>,
) -> Option<TestStarts> {
    let bench = scenario.bench();
    let key = |index: usize| StartKey {
        purpose: Purpose::Test,
        seed,
        index: index as u64,
    };
    let listed = scenario.starts().filter(|all| all.len() <= count);
    let starts: Vec<(Start, u64)> = match listed {
        Some(all) => {
            let starts = all.into_iter().enumerate();
            starts
                .map(|(i, start)| (start, bench.noise_of(key(i))))
                .collect()
        }
        None => {
            let keys = (0..count).map(key);
            keys.map(|key| (bench.draw(key), bench.noise_of(key)))
                .collect()
        }
    };
    let neutral = bench.spaces().neutral;
    let trivial = starts
        .par_iter()
        .enumerate()
        .map_init(
            || scenario.bench(),
            |bench, (index, (start, noise))| {
                if watch.stopped() {
                    return false;
                }
                let mut coasting = Constant(neutral);
                let from = (start, *noise);
                let episode = watch.play(bench, from, index, &mut coasting, Aftermath::Skip);
                episode.verdict.is_success()
            },
        )
        .collect();
    (!watch.stopped()).then_some(TestStarts {
        seed,
        starts,
        trivial,
    })
}
