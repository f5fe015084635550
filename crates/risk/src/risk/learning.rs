//! Learning of the proposals: runs, kinds of failure, V and the tilted starts.

use indexmap::IndexMap;
use rand::RngExt;
use rayon::prelude::*;

use super::mixture::Mixture;
use super::pool::RiskEstimate;
use super::record::RiskRun;
use super::request::ProposalFault;
use super::run::RiskWorld;
use super::start_tree::StartTree;
use super::value::{Value, ValueKind};
use crate::seed::generator;

/// Most kinds of failure with a proposal of their own.
const MODES: usize = 4;
/// Failures of a kind before it gets a proposal.
const MODE_FAILURES: usize = 10;
/// Starts by which the proposals of starts are fitted.
const POOL: usize = 8192;
/// Most runs of a fit, and most of them that fail.
const FITTED: (usize, usize) = (15_000, 7_500);

/// Inputs of V and the law at the first decision of a start.
type FirstState = (Vec<f32>, Vec<f64>);

/// Runs of which V is learned, and V.
pub(super) struct Learning {
    /// Runs with the number of the ego of each.
    data: Vec<(usize, RiskRun)>,
    egos: Vec<String>,
    /// Kinds of failure with a head of their own.
    modes: Vec<String>,
    value: Option<Value>,
    /// Natural starts with their first states, `None` outside X_init.
    pool: Vec<(Vec<f64>, Option<FirstState>)>,
    /// Inputs of V, and joint actions.
    sizes: (usize, usize),
    dimensions: usize,
    kind: ValueKind,
    /// Fault on purpose.
    fault: Option<ProposalFault>,
    seed: u64,
}

impl Learning {
    /// Draws natural starts, from which the tilted starts are fitted.
    pub(super) fn begin(
        world: &RiskWorld,
        egos: Vec<String>,
        (kind, fault): (ValueKind, Option<ProposalFault>),
        seed: u64,
    ) -> Learning {
        let law = &world.starts;
        // No episode is played, so one bench is fast enough.
        let mut bench = world.scenario.bench();
        let drawn = (0..POOL as u64).map(|index| {
            let mut rng = generator("risk-pool", &[seed, index]);
            let shares = (0..law.dimensions()).map(|_| rng.random::<f64>());
            let shares: Vec<f64> = shares.collect();
            let start = law.start(&shares);
            let state = start.map(|start| world.first_state(&mut bench, &start));
            (shares, state)
        });
        Learning {
            data: Vec::new(),
            egos,
            modes: Vec::new(),
            value: None,
            pool: drawn.collect(),
            sizes: (world.inputs(), world.scenario.spaces().actions),
            dimensions: law.dimensions(),
            kind,
            fault,
            seed,
        }
    }

    /// Returns the share of the law of starts inside X_init, exact if all are inside.
    pub(super) fn inside(&self) -> RiskEstimate {
        let inside = self.pool.iter().filter(|(_, state)| state.is_some());
        // At least one, because risks are divided by it.
        let inside = inside.count().max(1);
        let counted = RiskEstimate::counted(inside, POOL);
        if inside < POOL {
            counted
        } else {
            RiskEstimate {
                interval: [1.0; 2],
                ..counted
            }
        }
    }

    /// Adds a run of an ego.
    pub(super) fn add(&mut self, ego: usize, run: RiskRun) {
        // A start outside X_init has no decision to learn from.
        if !run.actions.is_empty() {
            self.data.push((ego, run));
        }
    }

    /// Refits V and the mixture. `None` without a known failure.
    ///
    /// `stage` is the number of batches so far, by which random numbers differ.
    pub(super) fn refit(&mut self, stage: u64) -> Option<Mixture> {
        self.forget();
        self.add_modes();
        let (failing, held): (Vec<_>, Vec<_>) = self
            .data
            .iter()
            .partition(|(_, run)| run.failure().is_some());
        if failing.is_empty() {
            return None;
        }
        // The latest runs come from the best proposals so far.
        let failing = &failing[failing.len().saturating_sub(FITTED.1)..];
        let others = FITTED.0 - failing.len();
        let held = &held[held.len().saturating_sub(others)..];
        let fitted = failing.iter().chain(held);
        let fitted: Vec<(&RiskRun, Vec<bool>)> = fitted
            .map(|(ego, run)| (run, self.heads_of(*ego, run)))
            .collect();
        let (inputs, actions) = self.sizes;
        let heads = 1 + self.modes.len();
        let sizes = [inputs, heads, actions];
        let fresh = || match self.fault {
            Some(ProposalFault::StateBlind) => Value::over_time(sizes),
            _ => Value::new(self.kind, sizes, self.seed),
        };
        // The last network is close already, so a fit continues from it.
        let mut value = self.value.clone().unwrap_or_else(fresh);
        value.fit(&fitted, self.seed.wrapping_add(stage));
        let mut mixture = Mixture::of(value.clone(), self.start_trees(&value));
        // With its guards, a mixture finds what its V misses.
        if self.fault.is_some() {
            mixture = mixture.unguarded();
        }
        self.value = Some(value);
        Some(mixture)
    }

    /// Drops the earliest runs without a failure, of which no fit reads so many.
    fn forget(&mut self) {
        let held = self.data.iter().filter(|(_, run)| run.failure().is_none());
        let mut excess = held.count().saturating_sub(FITTED.0);
        self.data.retain(|(_, run)| {
            let drop = 0 < excess && run.failure().is_none();
            excess -= usize::from(drop);
            !drop
        });
    }

    /// Adds kinds of failure with enough failures. V then begins anew.
    fn add_modes(&mut self) {
        let mut counts: IndexMap<String, usize> = IndexMap::new();
        for (ego, run) in &self.data {
            if let Some(mode) = self.label(*ego, run) {
                *counts.entry(mode).or_default() += 1;
            }
        }
        counts.retain(|mode, count| MODE_FAILURES <= *count && !self.modes.contains(mode));
        counts.sort_by(|_, a, _, b| b.cmp(a));
        let room = MODES.saturating_sub(self.modes.len());
        let new: Vec<String> = counts.into_keys().take(room).collect();
        if !new.is_empty() {
            self.modes.extend(new);
            self.value = None;
        }
    }

    /// Returns the kind of a run's failure. `None` without one that V learns.
    fn label(&self, ego: usize, run: &RiskRun) -> Option<String> {
        let mode = &run.failure()?.mode;
        if let Some(ProposalFault::Only(seen)) = self.fault
            && !mode.contains(seen)
        {
            return None;
        }
        // Egos fail in different states, so their kinds are learned apart.
        Some(match &self.egos[..] {
            [_] => mode.clone(),
            egos => format!("{}: {mode}", egos[ego]),
        })
    }

    fn heads_of(&self, ego: usize, run: &RiskRun) -> Vec<bool> {
        let label = self.label(ego, run);
        let modes = self.modes.iter();
        let of_mode = modes.map(|mode| label.as_ref() == Some(mode));
        std::iter::once(label.is_some()).chain(of_mode).collect()
    }

    /// Fits the proposals of starts to V at the first decisions.
    fn start_trees(&self, value: &Value) -> Vec<StartTree> {
        let actions = self.sizes.1;
        let rated = self.pool.par_iter().map(|(_, state)| match state {
            // A start outside X_init cannot fail.
            None => vec![0.0; value.heads()],
            Some((input, law)) => {
                let values = value.values(input);
                let mean = |own: &[f64]| own.iter().zip(law).map(|(v, p)| v * p).sum();
                values.chunks(actions).map(mean).collect()
            }
        });
        let rated: Vec<Vec<f64>> = rated.collect();
        let tree = |head: usize, of: fn(f64) -> f64| {
            let pairs = self.pool.iter().zip(&rated);
            let pairs = pairs.map(|((shares, _), values)| (shares.clone(), of(values[head])));
            StartTree::fit(&pairs.collect::<Vec<_>>(), self.dimensions)
        };
        // The first proposal tilts by the root of V, as its actions do.
        let soft = std::iter::once(tree(0, libm::sqrt));
        let heads = (0..value.heads()).map(|head| tree(head, |value| value));
        soft.chain(heads).collect()
    }

    /// Returns the greatest weight of an ego's failures so far, under a mixture.
    pub(super) fn limit(&self, ego: usize, mixture: &Mixture) -> f64 {
        let fails = |run: &RiskRun| run.failure().is_some() && run.is_possible();
        let known = self
            .data
            .iter()
            .filter(|(of, run)| *of == ego && fails(run));
        let known: Vec<&RiskRun> = known.map(|(_, run)| run).collect();
        // Evenly over all rounds, because the weights of earlier ones are larger.
        let step = known.len().div_ceil(4000).max(1);
        let known: Vec<&RiskRun> = known.into_iter().step_by(step).collect();
        let weights = known.par_iter().map(|run| mixture.weight_of(run));
        weights.reduce(|| 0.0, f64::max)
    }
}
