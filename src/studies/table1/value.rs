//! RQ4: do starts of nearly the same value fail alike? (Theorems 1 and 2)

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Learned, Progress, Table1, Table1Error, learn};
use crate::rl::{Dice, LearnerConfig};
use crate::scenario::{GridChange, Scenario};
use crate::scene::Start;
use crate::scene::grid::exact::Game;
use crate::scene::grid::{Starts, position_of};
use crate::testbench::{Aftermath, PolicyActor, play};

/// Random training starts, as in the paper.
const TRAINING_STARTS: usize = 100;
/// Starts from which the ado captured and around which others are looked at.
const COUNTEREXAMPLES: usize = 5;
/// How many times the decisions on the small map: this one is larger.
pub(super) const LONGER: u64 = 2;
/// δ and the paper's share.
const DELTAS: [(f64, f64); 4] = [(1.0, 0.9735), (0.5, 0.9742), (0.1, 0.9883), (0.01, 1.0)];

/// RQ4 for one δ.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DeltaNear {
    /// |V(x0) − V(x0')| stays below this.
    pub delta: f64,
    /// The paper's share of such starts from which the ego fails.
    pub paper: f64,
    /// The same for the best ado and V*.
    pub optimum: f64,
    /// By learner, with its own V.
    pub trained: Vec<NearStarts>,
}

/// One learner's share.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NearStarts {
    /// Median over seeds.
    pub median: f64,
    /// Mean over seeds.
    pub mean: f64,
    /// The worst seed.
    pub min: f64,
    /// Mean number of δ-near starts per counterexample.
    pub near: f64,
    /// Mean over seeds of α = max |V − V*| over all starts (Theorem 2).
    pub alpha: f64,
}

/// The map of RQ4 (n = 10, k = 1) and its starts.
pub(super) struct Plan {
    map: Scenario,
    starts: Vec<Start>,
    first_seed: u64,
}

/// What one trained ado does from every start: V, V* and whether it captures.
struct Known {
    value: f64,
    best: f64,
    captured: bool,
}

impl Plan {
    pub(super) fn new(scenario: &Scenario, request: &Table1) -> Result<Plan, Table1Error> {
        let change = GridChange {
            size: Some(10),
            ego_step: Some(1),
            ..GridChange::default()
        };
        let map = scenario.with(&change.into())?;
        Ok(Plan {
            starts: map.starts().unwrap_or_default(),
            map,
            first_seed: request.seeds.first,
        })
    }

    /// The map with 100 random starts of one seed to train on.
    fn training(&self, seed: u64) -> Option<Scenario> {
        let arena = self.map.grid()?.spec().arena;
        let mut dice = Dice::new(self.first_seed.wrapping_mul(7919) + seed);
        let pairs = (0..TRAINING_STARTS).map(|_| {
            let both = position_of(&self.starts[dice.below(self.starts.len())], &arena);
            ((both.ego.x, both.ego.y), (both.ado.x, both.ado.y))
        });
        let change = GridChange {
            starts: Some(Starts::Pairs(pairs.collect())),
            ..GridChange::default()
        };
        self.map.with(&change.into()).ok()
    }

    /// Trains and looks; `None` when stopped.
    pub(super) fn study(
        &self,
        learners: &[(String, LearnerConfig)],
        seeds: &[u64],
        progress: &Progress<'_>,
    ) -> Option<Vec<DeltaNear>> {
        let best = self.best();
        let jobs: Vec<(usize, u64)> = (0..learners.len())
            .flat_map(|learner| seeds.iter().map(move |seed| (learner, *seed)))
            .collect();
        let known: Option<Vec<(usize, Vec<Known>)>> = jobs
            .par_iter()
            .map(|&(index, seed)| {
                let learner = &learners[index].1;
                // There is no longer training than the longest that is allowed.
                let longer = learner.clone().with_decisions(LONGER * learner.decisions());
                let longer = longer.unwrap_or_else(|_| learner.clone());
                let learned = learn(&self.training(seed)?, &longer, (index, seed), progress)?;
                Some((index, self.known(&learned, &best)))
            })
            .collect();
        let known = known?;
        let of_one = |learner: usize, delta: f64| {
            let own = known.iter().filter(|(index, _)| *index == learner);
            near_starts(own.map(|(_, known)| known.as_slice()), delta)
        };
        let table = DELTAS.iter().map(|&(delta, paper)| DeltaNear {
            delta,
            paper,
            optimum: self.optimum(&best, delta),
            trained: (0..learners.len()).map(|l| of_one(l, delta)).collect(),
        });
        Some(table.collect())
    }

    /// V* of every start, and whether the best ado captures.
    fn best(&self) -> Vec<(f64, bool)> {
        let Some(grid) = self.map.grid() else {
            return Vec::new();
        };
        let solution = Game::of(grid).solve();
        let reward = self.map.rulebook().reward;
        let starts = self.starts.iter();
        let values = starts.map(|start| {
            let both = position_of(start, &grid.spec().arena);
            let captured = solution.capture_in(both).is_some();
            (reward.lawful(solution.robustness(both)), captured)
        });
        values.collect()
    }

    fn optimum(&self, best: &[(f64, bool)], delta: f64) -> f64 {
        let known: Vec<Known> = best
            .iter()
            .map(|&(value, captured)| Known {
                value,
                best: value,
                captured,
            })
            .collect();
        near_starts([known.as_slice()].into_iter(), delta).mean
    }

    fn known(&self, learned: &Learned, best: &[(f64, bool)]) -> Vec<Known> {
        let mut bench = self.map.bench();
        let mut obs = vec![0.0; bench.spaces().observation];
        let mut actor = PolicyActor(&*learned.policy);
        let starts = self.starts.iter().zip(best);
        let known = starts.map(|(start, &(best, _))| {
            bench.begin(start, 0, Aftermath::Skip);
            bench.observe(&mut obs);
            let episode = play(&mut bench, start, 0, &mut actor, Aftermath::Skip);
            Known {
                value: f64::from(learned.policy.value(&obs)),
                best,
                captured: episode.verdict.is_success(),
            }
        });
        known.collect()
    }
}

/// The share of δ-near starts that fail, over counterexamples and seeds.
fn near_starts<'a>(seeds: impl Iterator<Item = &'a [Known]>, delta: f64) -> NearStarts {
    let (mut shares, mut near, mut alpha) = (Vec::new(), 0.0, 0.0);
    for known in seeds {
        let captured: Vec<&Known> = known.iter().filter(|start| start.captured).collect();
        let every = (captured.len() / COUNTEREXAMPLES).max(1);
        let centres: Vec<&&Known> = captured
            .iter()
            .step_by(every)
            .take(COUNTEREXAMPLES)
            .collect();
        let (mut fail, mut count) = (0usize, 0usize);
        for centre in &centres {
            let close = known
                .iter()
                .filter(|start| (start.value - centre.value).abs() < delta);
            for start in close {
                count += 1;
                fail += usize::from(start.captured);
            }
        }
        shares.push(fail as f64 / count.max(1) as f64);
        near += count as f64 / centres.len().max(1) as f64;
        alpha += known
            .iter()
            .map(|k| (k.value - k.best).abs())
            .fold(0.0, f64::max);
    }
    let seeds = shares.len().max(1) as f64;
    let spread = super::spread(&shares);
    NearStarts {
        median: spread.median,
        mean: spread.mean,
        min: spread.min,
        near: near / seeds,
        alpha: alpha / seeds,
    }
}
