//! Crashes of an ado that was trained as traffic, with their rates.

use indexmap::IndexMap;
use rand::{Rng, RngExt};
use serde::Serialize;

use super::pool::{RiskEstimate, Round, WeightedFailure, WeightedFault, pooled};
use super::run::draw;
use super::traffic::RiskTraffic;
use crate::ego::{Fault, FaultKind};
use crate::experiment::{EpisodeLoop, FailureKind, Watch};
use crate::rl::{ActionOdds, Policy};
use crate::rulebook::Verdict;
use crate::run_dir::{TrafficLikelihood, counted};
use crate::scene::Start;
use crate::scene::drive::Actions;
use crate::seed::generator;
use crate::testbench::{Aftermath, FaultCount, Testbench, count_faults, draws};
use crate::world::Scenario;

/// Share of the decisions that a band of a law contains.
const BAND: f64 = 0.99;
/// Share of the law itself in the decisions of every second run.
///
/// Those runs also take ways to a failure that the ado hardly ever takes, without which its
/// weights would miss them.
const LAW: f64 = 0.05;

/// Most frequent kinds of crashes whose likeliest one is sought among neighbours.
const CLIMBED_KINDS: usize = 5;
/// Likeliest runs of a kind from which a climb begins, because each may end elsewhere.
const CLIMBS: usize = 3;
/// Passes over all actions of a run, at most.
const PASSES: usize = 4;

/// Crashes of an ado that was trained as traffic, among runs from natural starts.
#[derive(Clone, Debug, Serialize)]
pub struct TrafficCrashes {
    /// Runs of the ado from starts inside X_init.
    pub runs: usize,
    /// Runs of the ado in which the ego failed with all rules kept.
    pub failures: usize,
    /// Runs of both laws that ended in a fault of the ego or the physics.
    ///
    /// A run that ended in a fault might have ended in a failure.
    pub invalid: usize,
    /// These faults by kind, with runs of both laws numbered from 0.
    pub faults: Vec<FaultCount>,
    /// Probability of such a failure per run of the traffic itself.
    ///
    /// `None` without a failure, or if runs ended in faults.
    pub risk: Option<RiskEstimate>,
    /// Probability without and with every fault as a failure. `None` without a fault.
    pub between: Option<[Option<RiskEstimate>; 2]>,
    /// Share of the ado's decisions whose acceleration is among the likeliest 99 % of the law.
    pub usual: f64,
    /// Likeliest crash of each kind, the most frequent kind first. No fault is among them.
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

/// Laws of the next action of a run.
struct ActionLaws<'a> {
    odds: &'a ActionOdds,
    wide: &'a [f64],
}

/// Run of the ado from a natural start.
#[derive(Clone)]
struct TrafficRun {
    start: (Start, u64),
    actions: Vec<usize>,
    /// True if a law wider than the ado's drew the actions.
    is_wide: bool,
    /// Logarithms of the probability of the actions: under the law, under the ado, and
    /// under the wider law.
    logs: [f64; 3],
    usual: usize,
    /// Kind of a failure with all rules kept.
    kind: Option<String>,
    /// Fault of the ego or the physics, which leaves no verdict.
    fault: Option<Fault>,
}

impl TrafficCrashes {
    /// Returns the rates in words, a line each.
    pub fn in_words(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "from natural starts: {} of {} runs fail, with {:.1} % of the accelerations among the \
             likeliest 99 % of the traffic's",
            self.failures,
            self.runs,
            100.0 * self.usual
        )];
        if self.invalid > 0 {
            let runs = counted(self.invalid, "run");
            lines.push(format!(
                "invalid: {runs} ended in a fault, and each might have been a failure"
            ));
            lines.extend(self.faults.iter().map(|fault| format!("invalid: {fault}")));
        }
        if let Some([least, most]) = self.between {
            let rate = |it: Option<RiskEstimate>| it.map_or(0.0, |it| it.probability);
            let ends = [least, most].map(rate);
            lines.push(format!(
                "all kinds: {:.2e} per run if no fault was a failure, {:.2e} if each was",
                ends[0], ends[1]
            ));
        }
        let kinds = self.likeliest.iter();
        lines.extend(kinds.map(|crash| {
            let likelihood = &crash.likelihood;
            // Each fault might have been a failure of this kind.
            let bound = if self.invalid > 0 { "at least " } else { "" };
            let rate = format!("{bound}{:.2e} per run", likelihood.per_run);
            let hourly = likelihood.exposure.map_or_else(String::new, |exposure| {
                let all = likelihood.per_run * exposure.encounters();
                format!(", {all:.2e} {}", exposure.unit())
            });
            format!("{}: {rate}{hourly}", likelihood.kind)
        }));
        lines
    }
}

impl TrafficCrashes {
    /// Replaces the crashes of the most frequent kinds by likelier ones near them.
    ///
    /// A draw contains needless rare actions. Without them the crash is what the traffic does
    /// most often.
    fn climb(&mut self, player: &TrafficPlayer<'_>, played: &[TrafficRun], watch: &Watch<'_>) {
        let kinds = self.likeliest.iter().take(CLIMBED_KINDS);
        let of_kinds = kinds.flat_map(|crash| {
            let is_of_kind = |run: &&TrafficRun| run.kind.as_ref() == Some(&crash.likelihood.kind);
            let mut runs: Vec<&TrafficRun> = played.iter().filter(is_of_kind).collect();
            runs.sort_by(|a, b| b.logs[0].total_cmp(&a.logs[0]));
            runs.truncate(CLIMBS);
            runs
        });
        let firsts: Vec<&TrafficRun> = of_kinds.collect();
        let worker = || player.ego.bench();
        let climbed = EpisodeLoop::uncounted(watch).each(&firsts, worker, |bench, run, _| {
            Some(player.climbed(bench, run))
        });
        for run in climbed.into_iter().flatten() {
            let is_kind =
                |crash: &&mut TrafficCrash| run.kind.as_ref() == Some(&crash.likelihood.kind);
            let log = run.logs[0] / std::f64::consts::LN_10;
            if let Some(crash) = self.likeliest.iter_mut().find(is_kind)
                && log > crash.likelihood.log10_probability
            {
                crash.likelihood.log10_probability = log;
                (crash.start, crash.actions) = (run.start, run.actions);
            }
        }
    }
}

impl RiskTraffic {
    /// Plays an ado that was trained as this traffic, from natural starts.
    ///
    /// Every second run is drawn from a wider law than the ado's. A run has the weight of
    /// its actions under the law of the traffic by those under both, so that rates are those
    /// of the traffic itself. `None`: stopped, or the policy has no law.
    pub fn crashes_of(
        &self,
        ego: &Scenario,
        policy: &dyn Policy,
        [runs, seed]: [u64; 2],
        watch: &Watch<'_>,
    ) -> Option<TrafficCrashes> {
        let all: Vec<u64> = (0..runs).collect();
        let player = TrafficPlayer {
            traffic: self,
            ego,
            policy,
            accelerations: accelerations(ego),
        };
        let worker = || ego.bench();
        let played =
            EpisodeLoop::counted(watch, all.len()).each(&all, worker, |bench, index, _| {
                let run = player.run(bench, [seed, *index])?;
                watch.faults.note(*index, run.fault.as_ref());
                Some(run)
            });
        if watch.stopped() {
            return None;
        }
        let played: Vec<TrafficRun> = played.into_iter().flatten().collect();
        let mut crashes = self.summary(&played);
        crashes.climb(&player, &played, watch);
        if watch.stopped() {
            return None;
        }
        let share = crashes.invalid as f64 / played.len().max(1) as f64;
        let row = || "the ado from natural starts".to_owned();
        watch.faults.note_row(row, share);
        Some(crashes)
    }

    fn summary(&self, played: &[TrafficRun]) -> TrafficCrashes {
        let wide = played.iter().filter(|run| run.is_wide).count();
        let draws = [played.len() - wide, wide];
        let failures = played.iter().enumerate().filter_map(|(index, run)| {
            Some(WeightedFailure {
                index,
                // The ado's own law is component 0, as in the list of draws.
                component: usize::from(run.is_wide),
                weight: run.weight(draws),
                mode: run.kind.clone()?,
                lawful: true,
                preventable: None,
            })
        });
        let invalid = || {
            let runs = played.iter().enumerate();
            runs.filter_map(|(index, run)| Some((index, run, run.fault.as_ref()?)))
        };
        let faults = invalid().map(|(index, run, _)| WeightedFault {
            index,
            component: usize::from(run.is_wide),
            weight: run.weight(draws),
        });
        let round = Round {
            draws: draws.to_vec(),
            failures: failures.collect(),
            faults: faults.collect(),
        };
        let rounds = [round];
        let risk = pooled(&rounds, |_| true);
        let has_faults = !rounds[0].faults.is_empty();
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
        let crash = |kind: &str, run: &TrafficRun| {
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
        let mut crashes: Vec<TrafficCrash> = likeliest
            .into_iter()
            .filter_map(|(kind, run)| crash(kind, run))
            .collect();
        crashes.sort_by(|a, b| b.likelihood.per_run.total_cmp(&a.likelihood.per_run));
        // Runs of the wider law show nothing of how the ado itself drives.
        let own = || played.iter().filter(|run| !run.is_wide);
        let decisions: usize = own().map(|run| run.actions.len()).sum();
        let usual: usize = own().map(|run| run.usual).sum();
        TrafficCrashes {
            runs: own().count(),
            failures: own().filter(|run| run.kind.is_some()).count(),
            invalid: invalid().count(),
            faults: count_faults(invalid().map(|(index, _, fault)| (index as u64, fault))),
            // A run that ended in a fault is no success of the ego, so there is no number.
            risk: risk.filter(|_| !has_faults),
            between: has_faults.then(|| {
                let failing = rounds[0].with_failing_faults();
                [risk, pooled(&[failing], |_| true)]
            }),
            usual: usual as f64 / decisions.max(1) as f64,
            likeliest: crashes,
        }
    }
}

impl TrafficRun {
    /// Returns the weight of the run among so many of the ado and of the wider law.
    ///
    /// It is the balance heuristic, by both laws and not by the one that drew the run.
    fn weight(&self, draws: [usize; 2]) -> f64 {
        let [law, own, wide] = self.logs;
        // By differences, because the probability of a long run may round to 0.
        let ratios = [own, wide].map(|log| libm::exp(log - law));
        let pairs = draws.iter().zip(ratios);
        let sum: f64 = pairs.map(|(draws, ratio)| *draws as f64 * ratio).sum();
        draws.iter().sum::<usize>() as f64 / sum
    }
}

/// Returns the geometric mean of both laws, with a share of the traffic's law p itself.
fn wider(odds: &ActionOdds) -> Vec<f64> {
    // At temperature T the ado draws by p V^(1/T), so the mean is p √V at temperature 1 only.
    // The weights take the laws as they are and hold at each temperature.
    let pairs = odds.law.iter().zip(&odds.own);
    let roots: Vec<f64> = pairs.map(|(law, own)| libm::sqrt(law * own)).collect();
    let sum: f64 = roots.iter().sum();
    let pairs = odds.law.iter().zip(&roots);
    pairs
        .map(|(law, root)| LAW * law + (1.0 - LAW) * root / sum)
        .collect()
}

/// Returns the group of every joint action: those of equal accelerations.
///
/// An action without an acceleration is a group of its own.
fn accelerations(ego: &Scenario) -> Vec<usize> {
    let sets: Vec<&Actions> = match ego.drive() {
        Some(driving) => driving
            .spec()
            .action_sets()
            .map(|(_, set, _)| set)
            .collect(),
        None => Vec::new(),
    };
    let key = |joint: usize| {
        let mut rest = joint;
        let each = sets.iter().map(|set| {
            let own = rest % set.len();
            rest /= set.len();
            let bits = set.motion(own).map(|wish| wish.accel_mps2.to_bits());
            bits.ok_or(own)
        });
        each.collect::<Vec<_>>()
    };
    let keys: Vec<_> = (0..ego.spaces().actions).map(key).collect();
    let first = |own| keys.iter().position(|key| key == own).unwrap_or_default();
    keys.iter().map(first).collect()
}

/// Player of an ado from natural starts.
struct TrafficPlayer<'a> {
    traffic: &'a RiskTraffic,
    ego: &'a Scenario,
    policy: &'a dyn Policy,
    /// Group of every joint action.
    accelerations: Vec<usize>,
}

impl TrafficPlayer<'_> {
    /// Plays a run. `None`: its start is outside X_init, or the policy has no law.
    fn run(&self, bench: &mut Testbench, key: [u64; 2]) -> Option<TrafficRun> {
        let starts = &self.traffic.starts;
        let mut rng = generator("crashes of traffic", &key);
        let shares: Vec<f64> = (0..starts.dimensions())
            .map(|_| rng.random::<f64>())
            .collect();
        let noise = rng.next_u64();
        let start = starts.start(&shares)?;
        // By the number of the run and not by a draw, so that both laws have fixed shares.
        let is_wide = !key[1].is_multiple_of(2);
        let mut dice = draws(noise, 0);
        self.play(bench, start, noise, is_wide, |_, laws| {
            let drawn = if is_wide { laws.wide } else { &laws.odds.own };
            draw(drawn, dice.random::<f64>())
        })
    }

    /// Returns the likeliest run that single changes of an action lead to, with the same kind
    /// of failure.
    fn climbed(&self, bench: &mut Testbench, run: &TrafficRun) -> TrafficRun {
        let (mut best, mut changed) = (run.clone(), true);
        for _ in 0..PASSES {
            if !std::mem::take(&mut changed) {
                break;
            }
            let mut at = 0;
            // A run that fails earlier has fewer actions.
            while at < best.actions.len() {
                for action in 0..self.accelerations.len() {
                    let mut actions = best.actions.clone();
                    actions[at] = action;
                    let found = self.replayed(bench, run, &actions);
                    let better =
                        found.filter(|it| it.kind == run.kind && it.logs[0] > best.logs[0]);
                    if let Some(better) = better {
                        (best, changed) = (better, true);
                        break;
                    }
                }
                at += 1;
            }
        }
        best
    }

    /// Plays other actions from the start of a run, the last of them until the run ends.
    fn replayed(
        &self,
        bench: &mut Testbench,
        run: &TrafficRun,
        actions: &[usize],
    ) -> Option<TrafficRun> {
        let (start, noise) = run.start.clone();
        let last = actions.len().saturating_sub(1);
        self.play(bench, start, noise, run.is_wide, |at, _| {
            actions[at.min(last)]
        })
    }

    /// Plays a run whose actions a function chooses. `None`: the policy has no law.
    fn play(
        &self,
        bench: &mut Testbench,
        start: Start,
        noise: u64,
        is_wide: bool,
        mut choose: impl FnMut(usize, ActionLaws<'_>) -> usize,
    ) -> Option<TrafficRun> {
        bench.begin(&start, noise, Aftermath::Play);
        let mut obs = vec![0.0; bench.spaces().observation];
        let mut run = TrafficRun {
            start: (start, noise),
            actions: Vec::new(),
            is_wide,
            logs: [0.0; 3],
            usual: 0,
            kind: None,
            fault: None,
        };
        // Actions after the verdict have no part in the weight.
        while !bench.is_decided() {
            bench.observe(&mut obs);
            let odds = self.policy.odds(&obs)?;
            let wide = wider(&odds);
            let laws = ActionLaws {
                odds: &odds,
                wide: &wide,
            };
            let action = choose(run.actions.len(), laws);
            for (log, of) in run.logs.iter_mut().zip([&odds.law, &odds.own, &wide]) {
                *log += libm::log(of[action]);
            }
            run.usual += usize::from(self.is_usual(&odds.law, action));
            run.actions.push(action);
            bench.decide(action);
        }
        let verdict = bench.verdict().unwrap_or(Verdict::Invalid);
        if verdict == Verdict::Invalid {
            let unknown = || Fault::new(FaultKind::Physics, "the run has no verdict");
            run.fault = Some(bench.fault().cloned().unwrap_or_else(unknown));
        }
        if verdict.is_success() {
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
                FailureKind::of(self.ego, &episode).in_words()
            ));
        }
        Some(run)
    }

    /// Returns the phases of the ados in symbols, as kinds of failure have them.
    fn manoeuvres(&self, actions: &[usize]) -> String {
        let law = &self.traffic.actions;
        let mut memory = law.begin();
        actions.iter().for_each(|it| law.note(&mut memory, *it));
        memory.manoeuvre_in_symbols()
    }

    /// Returns whether an acceleration is among the likeliest that have 99 % of a law together.
    fn is_usual(&self, law: &[f64], action: usize) -> bool {
        let mut grouped = vec![0.0; law.len()];
        for (group, p) in self.accelerations.iter().zip(law) {
            grouped[*group] += p;
        }
        is_usual(&grouped, self.accelerations[action])
    }
}

fn is_usual(law: &[f64], action: usize) -> bool {
    let likelier: f64 = law.iter().filter(|p| **p > law[action]).sum();
    // An action is in the band if those before it have not filled it.
    likelier < BAND
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TRAFFIC, reckless, world};
    use super::*;
    use crate::testbench::FaultLog;

    /// Ado that draws all of its actions alike, as its traffic does.
    struct Even(usize);

    impl Policy for Even {
        fn act(&self, _: &[f32]) -> usize {
            0
        }

        fn odds(&self, _: &[f32]) -> Option<ActionOdds> {
            let [law, own] = [0, 1].map(|_| vec![1.0 / self.0 as f64; self.0]);
            Some(ActionOdds { law, own })
        }

        fn value(&self, _: &[f32]) -> f32 {
            0.0
        }
    }

    #[test]
    fn a_fault_of_the_ego_is_in_the_log_and_leaves_bounds_instead_of_a_rate() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let policy = Even(world.spaces().actions);
        let crashes = |is_fragile: bool| {
            let watch = Watch {
                faults: FaultLog::allowing(0.01),
                ..Watch::unwatched()
            };
            // An episode that ran, so that no streak of faults ends the runs.
            watch.faults.note(0, None);
            let ego = reckless(&world, is_fragile);
            let crashes = traffic.crashes_of(ego.scenario(), &policy, [400, 0], &watch);
            (crashes.expect("not stopped"), watch.faults)
        };
        let ((sound, silent), (fragile, log)) = (crashes(false), crashes(true));
        assert!(silent.complaint().is_none());
        assert!(sound.invalid == 0 && sound.faults.is_empty() && sound.between.is_none());
        let truth = sound.risk.expect("failures and no fault");
        assert!(fragile.invalid > 0 && fragile.risk.is_none());
        let complaint = log.complaint().expect("more faults than are allowed");
        let counted = [fragile.invalid as u64, fragile.faults[0].count];
        assert_eq!([complaint.invalid; 2], counted);
        // The same draws without the faults are the truth, which is in between.
        let [least, most] = fragile.between.expect("faults");
        let most = most.expect("every fault is a failure");
        assert!(least.is_none_or(|it| it.hits < truth.hits));
        assert!(truth.hits <= most.hits, "{truth:?}, {most:?}");
        assert!(fragile.in_words().join("\n").contains("gave up"));
    }

    /// Ado whose traffic nearly always takes action 0, and that draws all actions alike.
    struct Needless(usize);

    impl Policy for Needless {
        fn act(&self, _: &[f32]) -> usize {
            0
        }

        fn odds(&self, _: &[f32]) -> Option<ActionOdds> {
            let rare = 0.05;
            let mut law = vec![rare; self.0];
            law[0] = 1.0 - rare * (self.0 - 1) as f64;
            let own = vec![1.0 / self.0 as f64; self.0];
            Some(ActionOdds { law, own })
        }

        fn value(&self, _: &[f32]) -> f32 {
            0.0
        }
    }

    #[test]
    fn a_likeliest_crash_has_no_rare_action_that_a_common_one_could_replace() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let policy = Needless(world.spaces().actions);
        let ego = reckless(&world, false);
        let ego = ego.scenario();
        let player = TrafficPlayer {
            traffic: &traffic,
            ego,
            policy: &policy,
            accelerations: accelerations(ego),
        };
        let mut bench = ego.bench();
        let mut draws = (0..400).filter_map(|index| player.run(&mut bench, [0, 2 * index]));
        let run = draws.find(|run| run.kind.is_some()).expect("a crash");
        drop(draws);
        let best = player.climbed(&mut bench, &run);
        assert!(best.kind == run.kind && best.logs[0] > run.logs[0]);
        let again = player
            .replayed(&mut bench, &run, &best.actions)
            .expect("a law");
        assert_eq!((&again.kind, again.logs), (&best.kind, best.logs));
        for at in 0..best.actions.len() {
            let mut actions = best.actions.clone();
            actions[at] = 0;
            let common = player.replayed(&mut bench, &run, &actions).expect("a law");
            let is_likelier = common.logs[0] > best.logs[0];
            assert!(
                common.kind != run.kind || !is_likelier,
                "{at} of {actions:?}"
            );
        }
        // The report has it, with the rate of the draws.
        let report = traffic.crashes_of(ego, &policy, [400, 0], &Watch::unwatched());
        let report = report.expect("not stopped");
        let kind = |it: &&TrafficCrash| Some(&it.likelihood.kind) == run.kind.as_ref();
        let found = report.likeliest.iter().take(CLIMBED_KINDS).find(kind);
        let found = found.expect("a frequent kind");
        let start = player.replayed(
            &mut bench,
            &TrafficRun {
                start: found.start.clone(),
                ..run.clone()
            },
            &found.actions,
        );
        let log = start.expect("a law").logs[0] / std::f64::consts::LN_10;
        assert!((log - found.likelihood.log10_probability).abs() < 1e-9);
    }

    #[test]
    fn a_wider_law_takes_every_action_of_the_traffic() {
        let odds = ActionOdds {
            law: vec![0.99, 0.01, 0.0],
            own: vec![0.01, 0.99, 0.0],
        };
        let wide = wider(&odds);
        assert!((wide.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(wide[0] > 0.5 && wide[1] > 0.4 && wide[2] == 0.0, "{wide:?}");
        // An ado that never takes an action leaves it to the share of the law.
        let odds = ActionOdds {
            law: vec![0.5, 0.5],
            own: vec![1.0, 0.0],
        };
        assert!((wider(&odds)[1] - 0.025).abs() < 1e-12);
    }

    #[test]
    fn a_wider_law_is_the_mean_of_both_at_each_temperature() {
        let value = 1.0 / 16.0;
        for (temperature, ratio) in [(1.0, 0.25), (2.0, 0.5)] {
            let other = libm::pow(value, 1.0 / temperature);
            let odds = ActionOdds {
                law: vec![0.5, 0.5],
                own: vec![1.0 / (1.0 + other), other / (1.0 + other)],
            };
            let wide = wider(&odds);
            let found = (wide[1] - 0.5 * LAW) / (wide[0] - 0.5 * LAW);
            assert!((found - ratio).abs() < 1e-12, "{temperature}: {found}");
        }
    }

    #[test]
    fn a_run_weighs_its_law_by_both_that_drew() {
        let run = |logs: [f64; 3]| TrafficRun {
            start: (Start(Vec::new()), 0),
            actions: Vec::new(),
            is_wide: false,
            logs: logs.map(libm::log),
            usual: 0,
            kind: None,
            fault: None,
        };
        let weight = run([0.1, 0.5, 0.3]).weight([1, 1]);
        assert!((weight - 0.1 / 0.4).abs() < 1e-12, "{weight}");
        // The ado never takes these actions, and the weight stays finite.
        let weight = run([0.1, 0.0, 0.05]).weight([1, 1]);
        assert!((weight - 4.0).abs() < 1e-12, "{weight}");
    }

    #[test]
    fn usual_actions_are_the_likeliest_that_have_nearly_all_of_a_law() {
        let law = [0.9, 0.095, 0.005, 0.0];
        let usual = [0, 1, 2, 3].map(|action| is_usual(&law, action));
        assert_eq!(usual, [true, true, false, false]);
    }
}
