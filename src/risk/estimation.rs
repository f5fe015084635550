//! The estimation: natural runs, exploration, then rounds with refitted proposals.

use std::path::PathBuf;

use rand::RngExt;
use rayon::prelude::*;
use serde_json::json;

use super::batch::{self, Content, Player};
use super::checks::{Checks, Probe};
use super::mixture::Mixture;
use super::pool::{RiskEstimate, Round, WeightedFailure, pooled};
use super::report::{EgoRisk, RiskCost, RiskReport};
use super::run::{Failure, KnownFailure, RiskWorld, Run, RunEnd};
use super::start_tree::StartTree;
use super::traffic::RiskTraffic;
use super::value::ValueNetwork;
use crate::content_hash;
use crate::experiment::{EgoUnderTest, Watch};
use crate::run_dir::{RunError, file_name};
use crate::seed::generator;
use crate::sim::PlantKind;

/// Natural failures from which counting is enough.
pub(super) const ENOUGH: usize = 100;
/// Most kinds of failure with a proposal of their own.
const MODES: usize = 4;
/// Failures of a kind before it gets a proposal.
const MODE_FAILURES: usize = 10;
/// Starts by which the proposals of starts are fitted.
const POOL: usize = 8192;
/// Most runs of a fit, and most of them that fail.
const FITTED: (usize, usize) = (15_000, 7_500);
/// Runs of the first round. Rounds grow from the second one on.
const FIRST_ROUND: usize = 5_000;
/// Fewest runs of a round.
const LEAST_ROUND: usize = 500;
/// Rounds that only learn, where learning has a plant of its own.
const LEARNING: [usize; 3] = [5_000, 5_000, 10_000];

/// Request of a risk.
#[derive(Clone)]
#[non_exhaustive]
pub struct RiskRequest<'a> {
    /// Laws of the traffic.
    pub traffic: &'a RiskTraffic,
    /// Egos. The ratio of two is of the first to the second.
    pub egos: &'a [EgoUnderTest],
    /// Counterexamples from elsewhere.
    pub known: &'a [KnownFailure],
    /// Numbers of runs.
    pub settings: RiskSettings,
    /// Directory of finished runs, to be resumed from.
    pub dir: Option<PathBuf>,
}

/// Numbers of runs of a risk.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct RiskSettings {
    /// Most runs of an ego.
    pub budget: usize,
    /// Natural runs before all others.
    pub natural: usize,
    /// Half-width of the interval at which it stops, as a share of the estimate.
    pub width: f64,
    /// Seed of all draws.
    pub seed: u64,
    /// Plant on which proposals are learned, if not the plant of the egos.
    pub learn_on: Option<PlantKind>,
}

impl Default for RiskSettings {
    fn default() -> RiskSettings {
        RiskSettings {
            budget: 100_000,
            natural: 10_000,
            width: 0.25,
            seed: 0,
            learn_on: None,
        }
    }
}

impl<'a> RiskRequest<'a> {
    /// Creates a request with 100,000 runs per ego and a half-width of 25 %.
    pub fn new(traffic: &'a RiskTraffic, egos: &'a [EgoUnderTest]) -> RiskRequest<'a> {
        RiskRequest {
            traffic,
            egos,
            known: &[],
            settings: RiskSettings::default(),
            dir: None,
        }
    }

    /// Returns what the runs depend on, as the SHA-256 of JSON.
    fn fingerprint(&self) -> String {
        let egos = self.egos.iter().map(|ego| {
            let scenario = ego.scenario();
            json!([ego.name(), ego.change(), scenario.text(), scenario.plant()])
        });
        let known = self.known.iter();
        let known = known.map(|it| json!([it.start, it.noise, it.actions]));
        content_hash::fingerprint(&json!({
            "version": env!("CARGO_PKG_VERSION"),
            "egos": egos.collect::<Vec<_>>(),
            "traffic": self.traffic.sha256,
            "known": known.collect::<Vec<_>>(),
            "settings": self.settings,
        }))
    }

    /// Estimates the risk of every ego. `None`: stopped.
    ///
    /// Every round uses proposals from earlier runs only, so its estimate is unbiased.
    ///
    /// # Errors
    /// The disk refuses, or the directory belongs to another request.
    pub fn estimate(&self, watch: &Watch<'_>) -> Result<Option<RiskReport>, RunError> {
        let mut estimation = Estimation::begin(self, watch)?;
        if estimation.run()?.is_none() {
            return Ok(None);
        }
        Ok(Some(estimation.report()))
    }
}

/// State of an estimation.
pub(super) struct Estimation<'a> {
    request: &'a RiskRequest<'a>,
    watch: &'a Watch<'a>,
    players: Vec<Player<'a>>,
    /// Players of runs that only learn, on a plant of their own.
    learners: Vec<Player<'a>>,
    /// Share of the law of starts inside X_init.
    inside: f64,
    stage: u64,
    natural: Vec<Vec<Run>>,
    /// Runs of which V is learned, with the ego of each.
    data: Vec<(usize, Run)>,
    probes: Vec<Probe>,
    impossible: usize,
    modes: Vec<String>,
    value: Option<ValueNetwork>,
    mixture: Mixture,
    pool: Vec<(Vec<f64>, Option<FirstState>)>,
    rounds: Vec<Vec<Round>>,
    /// Greatest failing weight before the last round.
    limits: Vec<f64>,
    likeliest: Vec<(usize, f64, Run)>,
    cost: RiskCost,
}

/// Inputs of V and the law at the first decision of a start.
type FirstState = (Vec<f32>, Vec<f64>);

impl<'a> Estimation<'a> {
    fn begin(request: &'a RiskRequest<'a>, watch: &'a Watch<'a>) -> Result<Self, RunError> {
        let traffic = request.traffic;
        if let Some(dir) = &request.dir {
            batch::open(dir, &request.fingerprint())?;
        }
        let player = |(at, ego): (usize, &EgoUnderTest), plant: Option<PlantKind>| {
            let scenario = match plant {
                Some(plant) => ego.scenario().on(plant),
                None => ego.scenario().clone(),
            };
            let (starts, actions) = (traffic.starts.clone(), traffic.actions.clone());
            let on = if plant.is_some() { "learning-" } else { "" };
            Player {
                world: RiskWorld::new(&scenario, starts, actions),
                seed: request.settings.seed,
                name: format!("{at}-{on}{}", file_name(ego.name())),
                dir: request.dir.clone(),
                watch,
            }
        };
        let egos = || request.egos.iter().enumerate();
        let players: Vec<Player<'a>> = egos().map(|ego| player(ego, None)).collect();
        let plant = request.settings.learn_on;
        let learners = plant.map(|plant| egos().map(|ego| player(ego, Some(plant))).collect());
        let dimensions = traffic.starts.dimensions();
        Ok(Estimation {
            natural: Vec::new(),
            data: Vec::new(),
            probes: Vec::new(),
            impossible: 0,
            modes: Vec::new(),
            value: None,
            mixture: Mixture::natural(dimensions),
            pool: Vec::new(),
            rounds: vec![Vec::new(); players.len()],
            limits: vec![0.0; players.len()],
            likeliest: Vec::new(),
            inside: 1.0,
            stage: 0,
            cost: RiskCost::default(),
            learners: learners.unwrap_or_default(),
            players,
            request,
            watch,
        })
    }

    /// Plays until an estimate is good enough or the budget is spent. `None`: stopped.
    fn run(&mut self) -> Result<Option<()>, RunError> {
        let settings = self.request.settings;
        self.draw_pool();
        let natural = settings.natural.min(settings.budget);
        self.watch.phase("natural runs");
        let natural = Content::Natural(natural);
        let Some(natural) = self.batches(natural, false)? else {
            return Ok(None);
        };
        self.cost.natural = natural[0].len();
        self.natural = natural;
        if self.is_counted() {
            return Ok(Some(()));
        }
        self.watch.phase("exploration");
        let exploring = 5_000.min(settings.budget / 5);
        let on_own = self.learners.is_empty();
        if self.learn(Content::Exploring(exploring), on_own)?.is_none() {
            return Ok(None);
        }
        if self
            .learn(Content::Known(self.request.known), on_own)?
            .is_none()
        {
            return Ok(None);
        }
        if !on_own {
            for size in LEARNING {
                self.watch.phase("learning rounds");
                if !self.refit() {
                    break;
                }
                if self.learn(Content::Round(size), false)?.is_none() {
                    return Ok(None);
                }
            }
        }
        self.rounds_within(settings.budget)
    }

    /// Plays rounds until all checks hold and the interval is narrow enough.
    fn rounds_within(&mut self, budget: usize) -> Result<Option<()>, RunError> {
        let mut size = FIRST_ROUND;
        for round in 0.. {
            let left = budget.saturating_sub(self.cost.of_ego());
            let n = size.min(left);
            if n < LEAST_ROUND.min(budget) || n == 0 || !self.refit() {
                break;
            }
            self.watch.phase(&format!("round {}", round + 1));
            let limits = (0..self.players.len())
                .map(|ego| self.limit_of(ego))
                .collect();
            self.limits = limits;
            let Some(runs) = self.batches(Content::Round(n), false)? else {
                return Ok(None);
            };
            self.cost.rounds += n;
            for (ego, runs) in runs.into_iter().enumerate() {
                self.note_round(ego, runs);
            }
            if (0..self.players.len()).all(|ego| self.is_good(ego)) {
                break;
            }
            // Two small rounds find the failures, larger ones measure them.
            if 1 <= round {
                size *= 2;
            }
        }
        Ok(Some(()))
    }

    fn is_good(&self, ego: usize) -> bool {
        let Some(all) = pooled(&self.rounds[ego], |_| true) else {
            return false;
        };
        let settings = &self.request.settings;
        let is_narrow = all.half_width() <= settings.width && ENOUGH as f64 <= all.ess;
        is_narrow && self.checks(ego).refusals.is_empty()
    }

    /// Plays a batch with every ego.
    fn batches(
        &mut self,
        content: Content<'_>,
        learning: bool,
    ) -> Result<Option<Vec<Vec<Run>>>, RunError> {
        let stage = self.stage;
        self.stage += 1;
        let players = if learning && !self.learners.is_empty() {
            &self.learners
        } else {
            &self.players
        };
        let played = players
            .iter()
            .map(|it| it.play(stage, content, &self.mixture));
        played.collect()
    }

    /// Plays a batch of which V is learned, and which is not counted.
    fn learn(&mut self, content: Content<'_>, on_own: bool) -> Result<Option<()>, RunError> {
        let is_known = matches!(content, Content::Known(_));
        let Some(all) = self.batches(content, true)? else {
            return Ok(None);
        };
        let runs = all.first().map_or(0, Vec::len);
        if on_own {
            self.cost.exploring += runs;
        } else {
            self.cost.learning += runs;
        }
        for (ego, runs) in all.into_iter().enumerate() {
            for run in runs {
                if run.end == RunEnd::Impossible {
                    self.impossible += 1;
                    continue;
                }
                if is_known && run.failure().is_none() {
                    continue;
                }
                if run.failure().is_some() && run.component == 0 {
                    self.probes.push(Probe {
                        ego,
                        run: run.clone(),
                    });
                }
                self.data.push((ego, run));
            }
        }
        // A part of many probes says the same.
        let step = self.probes.len().div_ceil(2000).max(1);
        if 1 < step {
            self.probes = self.probes.iter().step_by(step).cloned().collect();
        }
        Ok(Some(()))
    }

    fn is_counted(&self) -> bool {
        let hits = |runs: &Vec<Run>| runs.iter().filter(|run| run.failure().is_some()).count();
        self.natural.iter().all(|runs| ENOUGH <= hits(runs))
    }

    fn note_round(&mut self, ego: usize, runs: Vec<Run>) {
        let mut round = Round {
            draws: vec![0; self.mixture.shares().len()],
            ..Round::default()
        };
        for (index, run) in runs.iter().enumerate() {
            round.draws[run.component] += 1;
            let weight = self.mixture.weight(&run.ratios);
            if run.end == RunEnd::Invalid {
                round.invalid += weight;
            }
            if let Some(failure) = run.failure() {
                round.failures.push(WeightedFailure {
                    index,
                    component: run.component,
                    weight,
                    mode: failure.mode.clone(),
                    lawful: failure.lawful,
                    preventable: failure.preventable,
                });
                self.note_likely(ego, failure, run);
            }
        }
        self.rounds[ego].push(round);
        self.data.extend(runs.into_iter().map(|run| (ego, run)));
    }

    /// Keeps the likeliest failure of every mode.
    fn note_likely(&mut self, ego: usize, failure: &Failure, run: &Run) {
        let taken = run.actions.iter().enumerate();
        let taken = taken.map(|(at, action)| f64::from(run.law(at)[*action as usize]));
        let log: f64 = taken.map(libm::log).sum();
        let same = |(other, _, known): &&mut (usize, f64, Run)| {
            *other == ego && known.failure().is_some_and(|it| it.mode == failure.mode)
        };
        match self.likeliest.iter_mut().find(same) {
            Some(known) if log <= known.1 => {}
            Some(known) => *known = (ego, log, run.clone()),
            None => self.likeliest.push((ego, log, run.clone())),
        }
    }

    fn label(&self, ego: usize, failure: &Failure) -> String {
        if self.players.len() < 2 {
            return failure.mode.clone();
        }
        format!("{}: {}", self.request.egos[ego].name(), failure.mode)
    }

    /// Refits V and the mixture. Returns false without a known failure.
    fn refit(&mut self) -> bool {
        self.add_modes();
        let failed = |(_, run): &&(usize, Run)| run.failure().is_some();
        let failing: Vec<&(usize, Run)> = self.data.iter().filter(failed).collect();
        if failing.is_empty() {
            return false;
        }
        let failing = &failing[failing.len().saturating_sub(FITTED.1)..];
        let held = self.data.iter().filter(|it| !failed(it));
        let held: Vec<&(usize, Run)> = held.filter(|(_, run)| !run.actions.is_empty()).collect();
        let others = FITTED.0 - failing.len();
        let held = &held[held.len().saturating_sub(others)..];
        let fitted: Vec<(&Run, Vec<bool>)> = failing
            .iter()
            .chain(held)
            .map(|(ego, run)| (run, self.heads_of(*ego, run)))
            .collect();
        let (inputs, actions) = (
            self.players[0].world.inputs(),
            self.players[0].world.scenario.spaces().actions,
        );
        let seed = self.request.settings.seed;
        let heads = 1 + self.modes.len();
        let fresh = || ValueNetwork::new(inputs, heads, actions, seed);
        let mut value = self.value.clone().unwrap_or_else(fresh);
        value.fit(&fitted, seed.wrapping_add(self.stage));
        self.mixture = Mixture::of(value.clone(), self.start_trees(&value));
        self.value = Some(value);
        true
    }

    /// Adds kinds of failure with enough failures. V then begins anew.
    fn add_modes(&mut self) {
        let mut counts: indexmap::IndexMap<String, usize> = indexmap::IndexMap::new();
        for (ego, run) in &self.data {
            if let Some(failure) = run.failure() {
                *counts.entry(self.label(*ego, failure)).or_default() += 1;
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

    fn heads_of(&self, ego: usize, run: &Run) -> Vec<bool> {
        let label = run.failure().map(|failure| self.label(ego, failure));
        let modes = self.modes.iter();
        let of_mode = modes.map(|mode| label.as_ref() == Some(mode));
        std::iter::once(label.is_some()).chain(of_mode).collect()
    }

    /// Draws natural starts and their first states.
    fn draw_pool(&mut self) {
        let player = &self.players[0];
        let law = &player.world.starts;
        let seed = self.request.settings.seed;
        let drawn = (0..POOL as u64).into_par_iter().map_init(
            || player.world.scenario.bench(),
            |bench, index| {
                let mut rng = generator("risk-pool", &[seed, index]);
                let shares = (0..law.dimensions()).map(|_| rng.random::<f64>());
                let shares: Vec<f64> = shares.collect();
                let state = law
                    .start(&shares)
                    .map(|start| player.world.first_state(bench, &start));
                (shares, state)
            },
        );
        self.pool = drawn.collect();
        let inside = self
            .pool
            .iter()
            .filter(|(_, state)| state.is_some())
            .count();
        self.inside = inside.max(1) as f64 / POOL as f64;
    }

    /// Fits the proposals of starts to V at the first decisions.
    fn start_trees(&self, value: &ValueNetwork) -> Vec<StartTree> {
        let actions = self.players[0].world.scenario.spaces().actions;
        let rated = self.pool.par_iter().map(|(_, state)| match state {
            None => vec![0.0; value.heads()],
            Some((input, law)) => {
                let values = value.values(input);
                let mean = |own: &[f64]| own.iter().zip(law).map(|(v, p)| v * p).sum();
                values.chunks(actions).map(mean).collect()
            }
        });
        let rated: Vec<Vec<f64>> = rated.collect();
        let dimensions = self.request.traffic.starts.dimensions();
        let tree = |head: usize| {
            let pairs = self.pool.iter().zip(&rated);
            let pairs: Vec<(Vec<f64>, f64)> = pairs
                .map(|((shares, _), values)| (shares.clone(), values[head]))
                .collect();
            StartTree::fit(&pairs, dimensions)
        };
        (0..value.heads()).map(tree).collect()
    }

    /// Returns the greatest weight of a failure that is known before a round.
    fn limit_of(&self, ego: usize) -> f64 {
        let known = self.data.iter().rev();
        let known = known.filter(|(of, run)| *of == ego && run.failure().is_some());
        let known: Vec<&Run> = known.map(|(_, run)| run).take(1000).collect();
        let weights = known.par_iter().map(|run| self.mixture.weight_of(run));
        weights.reduce(|| 0.0, f64::max)
    }

    fn checks(&self, ego: usize) -> Checks {
        Checks::of(
            &self.rounds[ego],
            (&self.natural[ego], self.limits[ego]),
            &self.mixture,
            &self
                .probes
                .iter()
                .filter(|it| it.ego == ego)
                .collect::<Vec<_>>(),
        )
    }

    fn report(mut self) -> RiskReport {
        let all = (0..self.players.len()).map(|ego| self.ego_risk(ego));
        let all: Vec<EgoRisk> = all.collect();
        let ratio = match &self.rounds[..] {
            [first, second] if all.iter().all(EgoRisk::is_weighted) => {
                super::pool::ratio(first, second)
            }
            [_, _] => match (all[0].fails, all[1].fails) {
                (Some(a), Some(b)) => Some(a.over(&b)),
                _ => None,
            },
            _ => None,
        };
        self.cost.egos = all.len();
        RiskReport::new(self.request, all, ratio, (self.cost, self.inside))
    }

    fn ego_risk(&self, ego: usize) -> EgoRisk {
        let name = self.request.egos[ego].name();
        let valid = |run: &&Run| !matches!(run.end, RunEnd::Outside | RunEnd::Invalid);
        let natural: Vec<&Run> = self.natural[ego].iter().filter(valid).collect();
        if self.is_counted() {
            return EgoRisk::counted(name, &natural);
        }
        let likeliest = self.likeliest.iter().filter(|(of, ..)| *of == ego);
        let likeliest = likeliest.map(|(_, _, run)| run.clone()).collect();
        let lawful = natural.iter().filter_map(|run| match &run.end {
            RunEnd::Held { lawful } => *lawful,
            RunEnd::Failed(failure) => Some(failure.lawful),
            _ => None,
        });
        let lawful: Vec<bool> = lawful.collect();
        let hits = lawful.iter().filter(|it| **it).count();
        let lawful = RiskEstimate::counted(hits, lawful.len());
        let checks = self.checks(ego);
        EgoRisk::weighted(
            name,
            (&self.rounds[ego], self.inside),
            (checks, self.impossible),
            lawful,
            likeliest,
        )
    }
}
