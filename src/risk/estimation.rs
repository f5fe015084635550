//! The estimation: natural runs, exploration, then rounds with refitted proposals.

use std::path::PathBuf;

use serde_json::json;

use super::batch::{self, Content, Player};
use super::checks::{Checks, Probe};
use super::learning::Learning;
use super::mixture::Mixture;
use super::pool::{RiskEstimate, Round, WeightedFailure, pooled};
use super::record::{EgoFailure, KnownFailure, RiskRun, RunEnd};
use super::report::{EgoRisk, RiskCost, RiskReport};
use super::run::RiskWorld;
use super::traffic::RiskTraffic;
use crate::content_hash;
use crate::experiment::{EgoUnderTest, Watch};
use crate::run_dir::{RunError, file_name};
use crate::sim::PlantKind;

/// Natural failures from which counting is enough.
pub(super) const ENOUGH: usize = 100;
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
        // A name alone would not reveal an ego that has changed.
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
    stage: u64,
    natural: Vec<Vec<RiskRun>>,
    learning: Learning,
    probes: Vec<Probe>,
    impossible: usize,
    mixture: Mixture,
    rounds: Vec<Vec<Round>>,
    /// Greatest failing weight before the last round.
    limits: Vec<f64>,
    likeliest: Vec<(usize, f64, RiskRun)>,
    cost: RiskCost,
}

impl<'a> Estimation<'a> {
    fn begin(request: &'a RiskRequest<'a>, watch: &'a Watch<'a>) -> Result<Self, RunError> {
        let traffic = request.traffic;
        // Stored runs of another request would be counted as runs of this one.
        if let Some(dir) = &request.dir {
            batch::open(dir, &request.fingerprint())?;
        }
        let player = |(at, ego): (usize, &EgoUnderTest), plant: Option<PlantKind>| {
            let scenario = match plant {
                Some(plant) => ego.scenario().on(plant),
                None => ego.scenario().clone(),
            };
            let (starts, actions) = (traffic.starts.clone(), traffic.actions.clone());
            // Files of both plants are in one directory.
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
        let names = request.egos.iter().map(|ego| ego.name().to_owned());
        let names = names.collect();
        let learning = Learning::begin(&players[0].world, names, request.settings.seed);
        Ok(Estimation {
            natural: Vec::new(),
            learning,
            probes: Vec::new(),
            impossible: 0,
            mixture: Mixture::natural(dimensions),
            rounds: vec![Vec::new(); players.len()],
            limits: vec![0.0; players.len()],
            likeliest: Vec::new(),
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
        let natural = settings.natural.min(settings.budget);
        self.watch.phase("natural runs");
        let natural = Content::Natural(natural);
        let Some(natural) = self.batches(natural, false)? else {
            return Ok(None);
        };
        self.cost.natural = natural[0].len();
        self.natural = natural;
        // Counted failures need neither proposals nor weights, which could be wrong.
        if self.is_counted() {
            return Ok(Some(()));
        }
        self.watch.phase("exploration");
        // At most a fifth, because explored runs are not part of the estimate.
        let exploring = 5_000.min(settings.budget / 5);
        // Runs on another plant do not count against the budget of an ego.
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
            // The variance of a very small round would be unreliable.
            if n < LEAST_ROUND.min(budget) || n == 0 || !self.refit() {
                break;
            }
            self.watch.phase(&format!("round {}", round + 1));
            // Limits are fixed before the round, or the bound would not hold.
            let egos = 0..self.players.len();
            let limits = egos.map(|ego| self.learning.limit(ego, &self.mixture));
            self.limits = limits.collect();
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
    ) -> Result<Option<Vec<Vec<RiskRun>>>, RunError> {
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
                // A run of probability 0 has no weight to learn from.
                if run.end == RunEnd::Impossible {
                    self.impossible += 1;
                    continue;
                }
                // A counterexample of another ego need not fail this one.
                if is_known && run.failure().is_none() {
                    continue;
                }
                if run.failure().is_some() && run.component == 0 && run.is_possible() {
                    self.probes.push(Probe {
                        ego,
                        run: run.clone(),
                    });
                }
                self.learning.add(ego, run);
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
        let hits = |runs: &Vec<RiskRun>| runs.iter().filter(|run| run.failure().is_some()).count();
        self.natural.iter().all(|runs| ENOUGH <= hits(runs))
    }

    fn note_round(&mut self, ego: usize, runs: Vec<RiskRun>) {
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
        // Only later rounds learn from these runs, which keeps each estimate unbiased.
        for run in runs {
            self.learning.add(ego, run);
        }
    }

    /// Keeps the likeliest failure of every mode.
    fn note_likely(&mut self, ego: usize, failure: &EgoFailure, run: &RiskRun) {
        // The start adds nothing, because its uniform numbers are all equally likely.
        let taken = run.actions.iter().enumerate();
        let taken = taken.map(|(at, action)| f64::from(run.law(at)[*action as usize]));
        let log: f64 = taken.map(libm::log).sum();
        let same = |(other, _, known): &&mut (usize, f64, RiskRun)| {
            *other == ego && known.failure().is_some_and(|it| it.mode == failure.mode)
        };
        match self.likeliest.iter_mut().find(same) {
            Some(known) if log <= known.1 => {}
            Some(known) => *known = (ego, log, run.clone()),
            None => self.likeliest.push((ego, log, run.clone())),
        }
    }

    /// Refits the proposals. Returns false without a known failure.
    fn refit(&mut self) -> bool {
        match self.learning.refit(self.stage) {
            Some(mixture) => {
                self.mixture = mixture;
                true
            }
            None => false,
        }
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
        // Egos share their draws in rounds, which makes the ratio of rounds narrower.
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
        let scenario = self.request.egos[0].scenario();
        let traffic = self.request.traffic;
        let report = RiskReport {
            world: scenario.name().to_owned(),
            plant: scenario.plant().to_string(),
            horizon_s: scenario.world().clock().horizon_s,
            traffic: traffic.source.clone(),
            uniform_axes: traffic.uniform_axes.clone(),
            inside: self.learning.inside(),
            exposure: traffic.exposure,
            egos: all,
            ratio,
            cost: self.cost,
        };
        // A ratio of numbers that are no results is none either.
        let ratio = report.ratio.filter(|_| report.is_result());
        RiskReport { ratio, ..report }
    }

    fn ego_risk(&self, ego: usize) -> EgoRisk {
        let name = self.request.egos[ego].name();
        let valid = |run: &&RiskRun| !matches!(run.end, RunEnd::Outside | RunEnd::Invalid);
        let natural: Vec<&RiskRun> = self.natural[ego].iter().filter(valid).collect();
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
            (&self.rounds[ego], self.learning.inside()),
            (checks, self.impossible),
            lawful,
            likeliest,
        )
    }
}
