//! RQ4: similar failures at starts of similar value (Theorems 1 and 2).

use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Learned, Table1, Table1Error, TrainingProgress, learn};
use brakecheck::rl::{LearnerConfig, LearnerRng};
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, PolicyActor, Success, play};
use brakecheck::world::Starts;
use brakecheck::world::{GridChange, Scenario};
use brakecheck_experiment::grid_solver::exact::Game;
use brakecheck_experiment::grid_solver::game_graph::{Depth, GameGraph};
use brakecheck_experiment::grid_solver::values::{ValueTable, rewards};
use brakecheck_scene::scene::grid::position_of;

/// Number of random training starts of RQ4, as in the paper.
const TRAINING_STARTS: usize = 100;
/// Number of training counterexamples with an evaluated neighbourhood.
const COUNTEREXAMPLES: usize = 5;
/// Factor on the decisions of the small map, because this map is larger.
pub(super) const LONGER: u64 = 2;
/// Values of δ with the paper's shares.
const DELTAS: [(f64, f64); 4] = [(1.0, 0.9735), (0.5, 0.9742), (0.1, 0.9883), (0.01, 1.0)];

/// Results of RQ4 on a reading.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NearStarts {
    /// Exact share of all starts that uniformly random actions capture.
    pub random: f64,
    /// Share of failing starts among all starts by learner, median over seeds.
    ///
    /// It includes distant starts and is the reference for the share of near starts.
    pub everywhere: Vec<f64>,
    /// Mean over seeds of α = max |V − V*| over all starts, by learner.
    pub alpha: Vec<f64>,
    /// Results per δ.
    pub deltas: Vec<DeltaNear>,
    /// All selected counterexamples.
    pub centres: Vec<Centre>,
}

/// Results of RQ4 for a value of δ.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DeltaNear {
    /// Bound on |V(x0) − V(x0')|.
    pub delta: f64,
    /// Share of such starts from which the ego fails, in the paper.
    pub paper: f64,
    /// Results by learner, with its own V.
    pub trained: Vec<NearShare>,
}

/// Share of failing starts near a learner's counterexamples.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NearShare {
    /// Median over seeds.
    pub median: f64,
    /// Share of the worst seed.
    pub min: f64,
    /// Mean number of δ-near starts per counterexample.
    pub near: f64,
    /// Counterexamples of all seeds with δ < γ^T (g(τ) + ρ), the premise of Theorem 1.
    pub satisfying: usize,
    /// Share around these counterexamples alone. `None`: there are none.
    pub where_satisfied: Option<f64>,
}

/// Randomly selected counterexample of the training.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Centre {
    /// Position of the learner in the study's list.
    pub learner: usize,
    /// Training seed.
    pub seed: u64,
    /// Start of the counterexample.
    pub start: Start,
    /// Number T of the capturing decision, from 0.
    pub decision: usize,
    /// γ^T (g(τ) + ρ), which must exceed δ. ρ is the mildest penalty of a rule violation.
    pub reach: f64,
}

/// Map of RQ4 and RQ5 (n = 10, k = 1) with its starts.
pub(super) struct LargeMap {
    pub(super) map: Scenario,
    pub(super) request: Table1,
    game: Game,
    graph: Arc<GameGraph>,
    starts: Vec<Start>,
}

/// Results of a trained ado from a start.
struct Known {
    value: f64,
    captured: bool,
}

/// Trained ado on the large map.
struct Studied {
    learner: usize,
    known: Vec<Known>,
    alpha: f64,
    /// Counterexamples with the positions of their starts among all.
    centres: Vec<(usize, Centre)>,
}

impl LargeMap {
    pub(super) fn new(scenario: &Scenario, request: &Table1) -> Result<LargeMap, Table1Error> {
        // The paper's map of RQ5, on which RQ4 is measured as well.
        let change = GridChange {
            size: Some(request.scale.large),
            ego_step: Some(1),
            ..GridChange::default()
        };
        let map = scenario.with(&change.into())?;
        let world = map.require_grid()?.world();
        Ok(LargeMap {
            graph: GameGraph::explore(world, map.rulebook(), Depth::Exact)?,
            // All ordered pairs, where the paper has the unordered ones.
            starts: map.starts().unwrap_or_default(),
            game: Game::of(world),
            map,
            request: *request,
        })
    }

    /// Trains on `starts` random starts of a seed. `None`: stopped.
    pub(super) fn learn(
        &self,
        learner: &LearnerConfig,
        starts: usize,
        index: usize,
        seed: u64,
        progress: &TrainingProgress<'_>,
    ) -> Option<Learned> {
        // A training is limited to the largest number of decisions that is allowed.
        let longer = learner
            .clone()
            .with_decisions(LONGER * learner.decisions())
            .unwrap_or_else(|_| learner.clone());
        let training = self.training(seed, starts)?;
        learn(&training, &longer, index, seed, progress)
    }

    /// Returns the map with random training starts of a seed.
    fn training(&self, seed: u64, starts: usize) -> Option<Scenario> {
        // The prime keeps these streams apart from those of other seeds.
        let mut dice = LearnerRng::new(self.request.seeds.first.wrapping_mul(7919) + seed);
        let pairs = (0..starts).map(|_| {
            let both = position_of(
                &self.starts[dice.below(self.starts.len())],
                &self.game.arena,
            );
            ((both.ego.x, both.ego.y), (both.ado.x, both.ado.y))
        });
        let change = GridChange {
            starts: Some(Starts::Pairs(pairs.collect())),
            ..GridChange::default()
        };
        self.map.with(&change.into()).ok()
    }

    /// Trains and evaluates the neighbourhoods. `None`: stopped.
    pub(super) fn near_starts(
        &self,
        learners: &[(String, LearnerConfig)],
        seeds: &[u64],
        progress: &TrainingProgress<'_>,
    ) -> Option<NearStarts> {
        let jobs: Vec<(usize, u64)> = (0..learners.len())
            .flat_map(|learner| seeds.iter().map(move |seed| (learner, *seed)))
            .collect();
        let studied: Vec<Studied> = jobs
            .par_iter()
            .map(|&(index, seed)| {
                let learner = &learners[index].1;
                let learned = self.learn(learner, TRAINING_STARTS, index, seed, progress)?;
                Some(self.studied(learner, &learned))
            })
            .collect::<Option<_>>()?;
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
        let chances = self.game.random_captures();
        Some(NearStarts {
            random: chances.iter().sum::<f64>() / chances.len().max(1) as f64,
            everywhere: all.clone().map(everywhere).collect(),
            alpha: all.clone().map(alpha).collect(),
            deltas: deltas.collect(),
            centres: studied
                .into_iter()
                .flat_map(|one| one.centres.into_iter().map(|(_, centre)| centre))
                .collect(),
        })
    }

    fn studied(&self, learner: &LearnerConfig, learned: &Learned) -> Studied {
        // V* is discounted like the learner's V, so both can be compared.
        let reward = rewards(self.map.rulebook());
        let best = ValueTable::exact(Arc::clone(&self.graph), learner.discount(), reward);
        let mut bench = self.map.bench();
        let mut obs = vec![0.0; bench.spaces().observation];
        let mut actor = PolicyActor(&*learned.policy);
        let mut alpha: f64 = 0.0;
        let value_at = |start| {
            // The value is read at the first observation, before the ado acts.
            bench.begin(start, 0, Aftermath::Skip);
            bench.observe(&mut obs);
            let value = f64::from(learned.policy.value(&obs));
            // The maximum over all starts is the α of the printed bound in Theorem 2.
            let exact = best.at(position_of(start, &self.game.arena));
            // A start without a value is infinitely far, never near.
            alpha = alpha.max(exact.map_or(f64::INFINITY, |exact| (value - exact).abs()));
            let episode = play(&mut bench, start, 0, &mut actor, Aftermath::Skip);
            Known {
                value,
                captured: episode.verdict.is_success(),
            }
        };
        let known = self.starts.iter().map(value_at).collect();
        Studied {
            learner: learned.learner,
            known,
            alpha,
            centres: self.centres(learner, learned),
        }
    }

    /// Selects counterexamples of the training at random.
    fn centres(&self, learner: &LearnerConfig, learned: &Learned) -> Vec<(usize, Centre)> {
        let mut known: Vec<&Success> = learned.counterexamples.iter().collect();
        // The seed is fixed, so equal requests select the same counterexamples.
        LearnerRng::new(self.request.seeds.starts.wrapping_mul(104_729) + learned.seed)
            .shuffle(&mut known);
        let (reward, rules) = (self.map.rulebook().reward, self.map.rulebook().rules.len());
        let chosen = known
            .into_iter()
            .take(COUNTEREXAMPLES)
            .filter_map(|success| {
                let start = self
                    .starts
                    // Coordinates are whole numbers of cells, so they compare exactly.
                    .iter()
                    .position(|start| *start == success.start)?;
                // The capture ends the episode, so its decision is the last decision.
                let decision = success.actions.len().saturating_sub(1);
                let weight = learner.discount().powi(decision as i32);
                let centre = Centre {
                    learner: learned.learner,
                    seed: learned.seed,
                    start: success.start.clone(),
                    decision,
                    // The mildest penalty gives the least reach, so the premise is never
                    // met too easily.
                    reach: weight * (reward.lawful(success.by) - reward.foul(1, rules)),
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

/// Returns the share of failing δ-near starts, over counterexamples and seeds.
fn near_share<'a>(seeds: impl Iterator<Item = &'a Studied>, delta: f64) -> NearShare {
    let share = |fail: usize, count: usize| fail as f64 / count.max(1) as f64;
    let (mut shares, mut all, mut satisfied) = (Vec::new(), (0, 0), (0, 0));
    let (mut centres, mut satisfying) = (0, 0);
    for one in seeds {
        let mut own = (0, 0);
        for (start, centre) in &one.centres {
            let value = one.known[*start].value;
            // A centre is at distance 0 from itself, so it counts as near.
            let near = |known: &&Known| (known.value - value).abs() < delta;
            let count = one.known.iter().filter(near).count();
            let fail = one
                .known
                .iter()
                .filter(near)
                .filter(|known| known.captured)
                .count();
            own = (own.0 + fail, own.1 + count);
            if delta < centre.reach {
                satisfying += 1;
                satisfied = (satisfied.0 + fail, satisfied.1 + count);
            }
        }
        // Shares are formed per seed, because seeds are the independent samples.
        shares.push(share(own.0, own.1));
        all = (all.0 + own.0, all.1 + own.1);
        centres += one.centres.len();
    }
    let spread = super::spread(&shares);
    NearShare {
        median: spread.median,
        min: spread.min,
        near: all.1 as f64 / centres.max(1) as f64,
        satisfying,
        where_satisfied: (satisfying > 0).then(|| share(satisfied.0, satisfied.1)),
    }
}
