//! Crashes of an ado that was trained as traffic, with their rates.

use indexmap::IndexMap;
use rand::{Rng, RngExt};
use serde::Serialize;

use super::pool::{RiskEstimate, Round, WeightedFailure, pooled};
use super::run::draw;
use super::traffic::RiskTraffic;
use crate::experiment::{EpisodeLoop, FailureKind, Watch};
use crate::rl::Policy;
use crate::rulebook::Verdict;
use crate::run_dir::TrafficLikelihood;
use crate::scene::Start;
use crate::seed::generator;
use crate::testbench::{Aftermath, Testbench, draws};
use crate::world::Scenario;

/// Share of the decisions that a band of a law contains.
const BAND: f64 = 0.99;

/// Crashes of an ado that was trained as traffic, among runs from natural starts.
#[derive(Clone, Debug, Serialize)]
pub struct TrafficCrashes {
    /// Runs from starts inside X_init.
    pub runs: usize,
    /// Runs in which the ego failed with all rules kept.
    pub failures: usize,
    /// Probability of such a failure per run of the traffic itself. `None` without one.
    pub risk: Option<RiskEstimate>,
    /// Share of the decisions whose action is among the likeliest 99 % of the law.
    pub usual: f64,
    /// Likeliest crash of each kind, the most frequent kind first.
    pub likeliest: Vec<TrafficCrash>,
}

/// Likeliest crash of a kind.
#[derive(Clone, Debug, Serialize)]
pub struct TrafficCrash {
    /// Start and noise of its episode.
    pub start: (Start, u64),
    /// Joint actions up to the verdict.
    pub actions: Vec<usize>,
    /// Kind, its rate, and the probability of the actions.
    pub likelihood: TrafficLikelihood,
}

/// Run of the ado from a natural start.
struct TrafficRun {
    start: (Start, u64),
    actions: Vec<usize>,
    /// Logarithms of the probability of the actions: under the law, and under the ado.
    logs: [f64; 2],
    usual: usize,
    /// Kind of a failure with all rules kept.
    kind: Option<String>,
}

impl TrafficCrashes {
    /// Returns the rates in words, a line each.
    pub fn in_words(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "from natural starts: {} of {} runs fail, and {:.0} % of the decisions are among the \
             likeliest 99 % of the traffic's",
            self.failures,
            self.runs,
            100.0 * self.usual
        )];
        let kinds = self.likeliest.iter();
        lines.extend(kinds.map(|crash| {
            let likelihood = &crash.likelihood;
            let rate = format!("{:.2e} per run", likelihood.per_run);
            let hourly = likelihood.exposure.map_or_else(String::new, |exposure| {
                let all = likelihood.per_run * exposure.encounters();
                format!(", {all:.2e} {}", exposure.unit())
            });
            format!("{}: {rate}{hourly}", likelihood.kind)
        }));
        lines
    }
}

impl RiskTraffic {
    /// Plays an ado that was trained as this traffic, from natural starts.
    ///
    /// A run has the weight of its actions under the law by those under the ado, so that
    /// rates are those of the traffic itself. `None`: stopped, or the policy has no law.
    pub fn crashes_of(
        &self,
        ego: &Scenario,
        policy: &dyn Policy,
        [runs, seed]: [u64; 2],
        watch: &Watch<'_>,
    ) -> Option<TrafficCrashes> {
        let all: Vec<u64> = (0..runs).collect();
        let worker = || ego.bench();
        let played =
            EpisodeLoop::counted(watch, all.len()).each(&all, worker, |bench, index, _| {
                Some(self.traffic_run(ego, bench, policy, [seed, *index]))
            });
        if watch.stopped() {
            return None;
        }
        let played: Vec<TrafficRun> = played.into_iter().flatten().flatten().collect();
        Some(self.summary(&played))
    }

    /// Plays a run. `None`: its start is outside X_init, or the policy has no law.
    fn traffic_run(
        &self,
        ego: &Scenario,
        bench: &mut Testbench,
        policy: &dyn Policy,
        key: [u64; 2],
    ) -> Option<TrafficRun> {
        let mut rng = generator("crashes of traffic", &key);
        let shares: Vec<f64> = (0..self.starts.dimensions())
            .map(|_| rng.random::<f64>())
            .collect();
        let noise = rng.next_u64();
        let start = self.starts.start(&shares)?;
        bench.begin(&start, noise, Aftermath::Play);
        let mut dice = draws(noise, 0);
        let mut obs = vec![0.0; bench.spaces().observation];
        let mut run = TrafficRun {
            start: (start, noise),
            actions: Vec::new(),
            logs: [0.0; 2],
            usual: 0,
            kind: None,
        };
        while !bench.is_decided() {
            bench.observe(&mut obs);
            let odds = policy.odds(&obs)?;
            let action = draw(&odds.own, dice.random::<f64>());
            run.logs[0] += libm::log(odds.law[action]);
            run.logs[1] += libm::log(odds.own[action]);
            run.usual += usize::from(is_usual(&odds.law, action));
            run.actions.push(action);
            bench.decide(action);
        }
        if matches!(bench.verdict(), Some(Verdict::Counterexample { .. })) {
            // Motion after the verdict only shows the contact.
            let mut played = run.actions.clone();
            while !bench.is_done() {
                let last = played.last().copied().unwrap_or_default();
                played.push(last);
                bench.decide(last);
            }
            let episode = bench.episode(&run.start.0, noise, played);
            let manoeuvres = self.manoeuvres(&run.actions);
            let after = match &manoeuvres[..] {
                "" => String::new(),
                symbols => format!(" after {symbols}"),
            };
            run.kind = Some(format!(
                "{}{after}",
                FailureKind::of(ego, &episode).in_words()
            ));
        }
        Some(run)
    }

    /// Returns the phases of the ados in symbols, as kinds of failure have them.
    fn manoeuvres(&self, actions: &[usize]) -> String {
        let mut memory = self.actions.begin();
        actions
            .iter()
            .for_each(|it| self.actions.note(&mut memory, *it));
        memory.manoeuvre_in_symbols()
    }

    fn summary(&self, played: &[TrafficRun]) -> TrafficCrashes {
        let failures = played.iter().enumerate().filter_map(|(index, run)| {
            Some(WeightedFailure {
                index,
                component: 0,
                weight: libm::exp(run.logs[0] - run.logs[1]),
                mode: run.kind.clone()?,
                lawful: true,
                preventable: None,
            })
        });
        let round = Round {
            draws: vec![played.len()],
            failures: failures.collect(),
            faults: Vec::new(),
        };
        let rounds = [round];
        let mut likeliest: IndexMap<&str, &TrafficRun> = IndexMap::new();
        for run in played {
            let Some(kind) = &run.kind else {
                continue;
            };
            let known = likeliest.entry(kind).or_insert(run);
            if run.logs[0] > known.logs[0] {
                *known = run;
            }
        }
        let crash = |(kind, run): (&str, &TrafficRun)| {
            let rate = pooled(&rounds, |failure| failure.mode == kind)?;
            Some(TrafficCrash {
                start: run.start.clone(),
                actions: run.actions.clone(),
                likelihood: TrafficLikelihood {
                    source: self.source.clone(),
                    log10_probability: run.logs[0] / std::f64::consts::LN_10,
                    kind: kind.to_owned(),
                    per_run: rate.probability,
                    interval: rate.interval,
                    ess: rate.ess,
                    exposure: self.exposure,
                },
            })
        };
        let mut crashes: Vec<TrafficCrash> = likeliest.into_iter().filter_map(crash).collect();
        crashes.sort_by(|a, b| b.likelihood.per_run.total_cmp(&a.likelihood.per_run));
        let decisions: usize = played.iter().map(|run| run.actions.len()).sum();
        let usual: usize = played.iter().map(|run| run.usual).sum();
        TrafficCrashes {
            runs: played.len(),
            failures: rounds[0].failures.len(),
            risk: pooled(&rounds, |_| true),
            usual: usual as f64 / decisions.max(1) as f64,
            likeliest: crashes,
        }
    }
}

/// Returns whether an action is among the likeliest that have 99 % of a law together.
fn is_usual(law: &[f64], action: usize) -> bool {
    let likelier: f64 = law.iter().filter(|p| **p > law[action]).sum();
    likelier < BAND
}
