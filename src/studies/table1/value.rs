//! RQ4: do starts of nearly the same value fail alike? (Theorems 1 and 2)

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Learned, Progress, Table1, Table1Error, learn};
use crate::rl::{Dice, LearnerConfig};
use crate::scene::Start;
use crate::scene::grid::exact::Game;
use crate::scene::grid::{Starts, position_of};
use crate::testbench::{Aftermath, PolicyActor, Success, play};
use crate::theorems::{TheoremsError, optimal_values};
use crate::world::{GridChange, Scenario};

/// Random training starts of RQ4, as in the paper.
const TRAINING_STARTS: usize = 100;
/// Counterexamples of the training around which others are looked at.
const COUNTEREXAMPLES: usize = 5;
/// How many times the decisions on the small map: this one is larger.
pub(super) const LONGER: u64 = 2;
/// δ and the paper's share.
const DELTAS: [(f64, f64); 4] = [(1.0, 0.9735), (0.5, 0.9742), (0.1, 0.9883), (0.01, 1.0)];

/// RQ4 on one reading.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NearStarts {
    /// Share of all starts that uniformly random actions capture, exactly.
    pub random: f64,
    /// By learner: median over seeds of the share of all starts that fail, near
    /// or not. Without this beside it a share of near starts says nothing.
    pub everywhere: Vec<f64>,
    /// By learner: mean over seeds of α = max |V − V*| over all starts.
    pub alpha: Vec<f64>,
    /// δ by δ.
    pub deltas: Vec<DeltaNear>,
    /// Every counterexample that was chosen.
    pub centres: Vec<Centre>,
}

/// RQ4 for one δ.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DeltaNear {
    /// |V(x0) − V(x0')| stays below this.
    pub delta: f64,
    /// The paper's share of such starts from which the ego fails.
    pub paper: f64,
    /// By learner, with its own V.
    pub trained: Vec<NearShare>,
}

/// One learner's share of starts near its counterexamples that fail.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NearShare {
    /// Median over seeds.
    pub median: f64,
    /// The worst seed.
    pub min: f64,
    /// Mean number of δ-near starts per counterexample.
    pub near: f64,
    /// Counterexamples of all seeds with δ < γ^T (g(τ) + 1), Theorem 1's condition.
    pub meets: usize,
    /// The share around these alone; `None`: there are none.
    pub where_met: Option<f64>,
}

/// A counterexample that training met, chosen at random.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Centre {
    /// Position of the learner in the study's list.
    pub learner: usize,
    /// Training seed.
    pub seed: u64,
    /// Where it began.
    pub start: Start,
    /// T: the number of the decision that captured, from 0.
    pub decision: usize,
    /// γ^T (g(τ) + 1): the condition is δ below this.
    pub reach: f64,
}

/// The map of RQ4 and RQ5 (n = 10, k = 1) and its starts.
pub(super) struct LargeMap {
    pub(super) map: Scenario,
    pub(super) request: Table1,
    starts: Vec<Start>,
}

/// What one trained ado does from every start.
struct Known {
    value: f64,
    captured: bool,
}

/// A trained ado on the large map.
struct Studied {
    learner: usize,
    known: Vec<Known>,
    alpha: f64,
    /// With the position of its start among all.
    centres: Vec<(usize, Centre)>,
}

impl LargeMap {
    pub(super) fn new(scenario: &Scenario, request: &Table1) -> Result<LargeMap, Table1Error> {
        let change = GridChange {
            size: Some(10),
            ego_step: Some(1),
            ..GridChange::default()
        };
        let map = scenario.with(&change.into())?;
        Ok(LargeMap {
            starts: map.starts().unwrap_or_default(),
            map,
            request: *request,
        })
    }

    /// Trains on so many random starts of one seed; `None` when stopped.
    pub(super) fn learn(
        &self,
        learner: &LearnerConfig,
        starts: usize,
        (index, seed): (usize, u64),
        progress: &Progress<'_>,
    ) -> Option<Learned> {
        // There is no longer training than the longest that is allowed.
        let longer = learner.clone().with_decisions(LONGER * learner.decisions());
        let longer = longer.unwrap_or_else(|_| learner.clone());
        learn(
            &self.training(seed, starts)?,
            &longer,
            (index, seed),
            progress,
        )
    }

    /// The map with some random starts of one seed to train on.
    fn training(&self, seed: u64, starts: usize) -> Option<Scenario> {
        let arena = self.map.grid()?.spec().arena;
        let mut dice = Dice::new(self.request.seeds.first.wrapping_mul(7919) + seed);
        let pairs = (0..starts).map(|_| {
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
    pub(super) fn near_starts(
        &self,
        learners: &[(String, LearnerConfig)],
        seeds: &[u64],
        progress: &Progress<'_>,
    ) -> Result<Option<NearStarts>, Table1Error> {
        let Some(grid) = self.map.grid() else {
            return Ok(None);
        };
        let jobs: Vec<(usize, u64)> = (0..learners.len())
            .flat_map(|learner| seeds.iter().map(move |seed| (learner, *seed)))
            .collect();
        let studied: Option<Vec<Result<Studied, TheoremsError>>> = jobs
            .par_iter()
            .map(|&(index, seed)| {
                let learner = &learners[index].1;
                let learned = self.learn(learner, TRAINING_STARTS, (index, seed), progress)?;
                Some(self.studied(learner, &learned))
            })
            .collect();
        let Some(studied) = studied else {
            return Ok(None);
        };
        let studied = studied.into_iter().collect::<Result<Vec<_>, _>>()?;
        let of = |learner: usize| studied.iter().filter(move |one| one.learner == learner);
        let all = 0..learners.len();
        let everywhere = |learner: usize| {
            let shares: Vec<f64> = of(learner).map(|one| captured(&one.known)).collect();
            super::spread(&shares).median
        };
        let alpha = |learner: usize| {
            of(learner).map(|one| one.alpha).sum::<f64>() / seeds.len().max(1) as f64
        };
        let deltas = DELTAS.iter().map(|&(delta, paper)| DeltaNear {
            delta,
            paper,
            trained: all.clone().map(|l| near_share(of(l), delta)).collect(),
        });
        let chances = Game::of(grid).random_captures();
        Ok(Some(NearStarts {
            random: chances.iter().sum::<f64>() / chances.len().max(1) as f64,
            everywhere: all.clone().map(everywhere).collect(),
            alpha: all.clone().map(alpha).collect(),
            deltas: deltas.collect(),
            centres: studied
                .into_iter()
                .flat_map(|one| one.centres.into_iter().map(|(_, centre)| centre))
                .collect(),
        }))
    }

    fn studied(
        &self,
        learner: &LearnerConfig,
        learned: &Learned,
    ) -> Result<Studied, TheoremsError> {
        let best = optimal_values(&self.map.learning_with(learner.clone()))?;
        let arena = best.game().arena;
        let mut bench = self.map.bench();
        let mut obs = vec![0.0; bench.spaces().observation];
        let mut actor = PolicyActor(&*learned.policy);
        let mut alpha: f64 = 0.0;
        let known = self.starts.iter().map(|start| {
            bench.begin(start, 0, Aftermath::Skip);
            bench.observe(&mut obs);
            let value = f64::from(learned.policy.value(&obs));
            alpha = alpha.max((value - best.at(position_of(start, &arena))).abs());
            let episode = play(&mut bench, start, 0, &mut actor, Aftermath::Skip);
            Known {
                value,
                captured: episode.verdict.is_success(),
            }
        });
        let known = known.collect();
        Ok(Studied {
            learner: learned.learner,
            known,
            alpha,
            centres: self.centres(learner, learned),
        })
    }

    /// Some of the counterexamples that training met, at random.
    fn centres(&self, learner: &LearnerConfig, learned: &Learned) -> Vec<(usize, Centre)> {
        let mut met: Vec<&Success> = learned.met.iter().collect();
        Dice::new(self.request.seeds.starts.wrapping_mul(104_729) + learned.seed).shuffle(&mut met);
        let reward = self.map.rulebook().reward;
        let chosen = met.into_iter().take(COUNTEREXAMPLES).filter_map(|success| {
            let start = self
                .starts
                .iter()
                .position(|start| *start == success.start)?;
            let decision = success.actions.len().saturating_sub(1);
            let weight = learner.discount().powi(decision as i32);
            let centre = Centre {
                learner: learned.learner,
                seed: learned.seed,
                start: success.start.clone(),
                decision,
                reach: weight * (reward.lawful(success.by) + 1.0),
            };
            Some((start, centre))
        });
        chosen.collect()
    }
}

fn captured(known: &[Known]) -> f64 {
    let captured = known.iter().filter(|start| start.captured).count();
    captured as f64 / known.len().max(1) as f64
}

/// The share of δ-near starts that fail, over counterexamples and seeds.
fn near_share<'a>(seeds: impl Iterator<Item = &'a Studied>, delta: f64) -> NearShare {
    let share = |(fail, count): (usize, usize)| fail as f64 / count.max(1) as f64;
    let (mut shares, mut all, mut met) = (Vec::new(), (0, 0), (0, 0));
    let (mut centres, mut meets) = (0, 0);
    for one in seeds {
        let mut own = (0, 0);
        for (start, centre) in &one.centres {
            let value = one.known[*start].value;
            let near = |known: &&Known| (known.value - value).abs() < delta;
            let count = one.known.iter().filter(near).count();
            let fail = one.known.iter().filter(near).filter(|known| known.captured);
            let fail = fail.count();
            own = (own.0 + fail, own.1 + count);
            if delta < centre.reach {
                meets += 1;
                met = (met.0 + fail, met.1 + count);
            }
        }
        shares.push(share(own));
        all = (all.0 + own.0, all.1 + own.1);
        centres += one.centres.len();
    }
    let spread = super::spread(&shares);
    NearShare {
        median: spread.median,
        min: spread.min,
        near: all.1 as f64 / centres.max(1) as f64,
        meets,
        where_met: (0 < meets).then(|| share(met)),
    }
}
