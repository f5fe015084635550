//! Closed-loop rule with three zones, tuned without a training.
//!
//! The rule reads a signal that the ado observes. Below a first threshold it takes one
//! action, above a second threshold another, and between them a third. The signal, the
//! thresholds and the actions are tuned once, by the cross-entropy method, for success on
//! training starts against the world's own ego. A trained ado that does not beat the rule
//! does not need a network.

use std::cmp::Ordering;

use cpu_time::ThreadTime;
use rand_chacha::ChaCha8Rng;

use crate::experiment::{Cost, EpisodeLoop, Watch, WorkItem};
use crate::rl::Policy;
use crate::scene::Start;
use crate::seed;
use crate::seed::{Purpose, StartKey};
use crate::stats::pick;
use crate::testbench::{Actor, Aftermath, HOLD_DECISIONS, HeldRandom, NoisyStart, Testbench};
use crate::world::Scenario;

/// Training starts on which every rule is played.
const STARTS: u64 = 32;
/// Rules per generation.
const POPULATION: usize = 48;
/// Best rules of a generation, from which the next is drawn.
const ELITES: usize = 8;
/// Generations.
const GENERATIONS: u64 = 8;
/// Weight of the elites against the old distribution.
const SMOOTHING: f64 = 0.7;
/// Least spread of the thresholds, as a share of the signal's values.
const LEAST_SPREAD: f64 = 0.02;

/// Rule with three zones of an observed signal.
#[derive(Clone, Debug, PartialEq)]
pub struct Heuristic {
    zones: Zones,
    /// Signal, zones, actions in them, and cost of the tuning, in words.
    pub text: String,
    /// Share of the tuning's starts that the rule solves.
    pub successes: f64,
    /// Mean reward on these starts.
    pub reward: f64,
    /// Cost of the tuning.
    pub cost: Cost,
}

impl Policy for Heuristic {
    fn act(&self, obs: &[f32]) -> usize {
        self.zones.act(obs)
    }

    /// Returns the mean reward of the tuning, for every observation.
    fn value(&self, _obs: &[f32]) -> f32 {
        self.reward as f32
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Zones {
    /// Position of the signal in the observation.
    position: usize,
    /// Thresholds of the observed, scaled signal.
    thresholds: [f32; 2],
    /// Actions below, between and above the thresholds.
    actions: [usize; 3],
}

impl Zones {
    fn act(&self, obs: &[f32]) -> usize {
        let (value, [low, high]) = (obs[self.position], self.thresholds);
        let [below, between, above] = self.actions;
        match (value < low, value < high) {
            (true, _) => below,
            (false, true) => between,
            (false, false) => above,
        }
    }
}

impl Actor for Zones {
    fn begin(&mut self, _seed: u64, _start: &Start) {}

    fn act(&mut self, obs: &[f32]) -> usize {
        Zones::act(self, obs)
    }
}

/// Tunes a rule on `scenario`, which has the nominal ego.
///
/// `seed` selects the stream of training starts, so the rule may use the starts of a
/// training with this seed. `None`: stopped, or the ado observes nothing.
pub fn tune_heuristic(scenario: &Scenario, seed: u64, watch: &Watch<'_>) -> Option<Heuristic> {
    let clock = ThreadTime::now();
    watch.phase("tuning the heuristic (generations)");
    // Thresholds are drawn as ranks among these, so no signal needs a range of its own.
    let (values, mut cost) = usual_values(scenario, seed, watch);
    // The first sample may decide every episode, and then a signal has no value to rank.
    if values.iter().any(Vec::is_empty) || values.is_empty() {
        return None;
    }
    let actions = scenario.world().spaces().actions;
    let mut chances = Chances::even(values.len(), actions);
    let mut rng = seed::generator("heuristic", &[seed]);
    let mut best: Option<(Score, QuantileRule)> = None;
    let mut elsewhere_s = 0.0;
    for generation in 0..GENERATIONS {
        (watch.progress)(generation, GENERATIONS);
        let rules: Vec<QuantileRule> = (0..POPULATION).map(|_| chances.draw(&mut rng)).collect();
        let try_one = |bench: &mut Testbench, rule: &QuantileRule, turn: &WorkItem| {
            Some(try_out(bench, rule.zones(&values), seed, watch, turn))
        };
        // The bar counts generations, and not the episodes of one.
        let all = EpisodeLoop::uncounted(watch);
        let tried = all.run(&rules, || scenario.bench(), try_one);
        // A generation that was cut short ranks only some of its rules.
        if watch.stopped() {
            return None;
        }
        let tried: Vec<RuleScore> = tried.into_iter().flatten().collect();
        for tried in &tried {
            cost.simulations += STARTS;
            cost.physics_steps += tried.physics_steps;
            elsewhere_s += tried.cpu_s;
        }
        let mut ranked: Vec<(Score, QuantileRule)> =
            tried.iter().map(|t| t.score).zip(rules).collect();
        // Equals keep the order in which they were drawn.
        ranked.sort_by(|a, b| b.0.better(&a.0));
        ranked.truncate(ELITES);
        let elites: Vec<&QuantileRule> = ranked.iter().map(|(_, rule)| rule).collect();
        chances.learn(&elites);
        // The rest of the ranking is not read again, so its order may break.
        let first = ranked.swap_remove(0);
        // A later generation may be worse than an earlier one.
        if best
            .as_ref()
            .is_none_or(|best| best.0.better(&first.0).is_lt())
        {
            best = Some(first);
        }
    }
    let (score, rule) = best?;
    // On one thread the rules were tried on this one.
    cost.cpu_s = elsewhere_s.max(clock.elapsed().as_secs_f64());
    let zones = rule.zones(&values);
    Some(Heuristic {
        zones,
        text: describe(scenario, zones, cost),
        successes: score.successes as f64 / STARTS as f64,
        reward: score.reward,
        cost,
    })
}

/// Returns the observed values of each signal under held random actions, sorted.
fn usual_values(scenario: &Scenario, seed: u64, watch: &Watch<'_>) -> (Vec<Vec<f32>>, Cost) {
    let mut bench = scenario.bench();
    let spaces = bench.spaces().clone();
    let mut seen = ObservationSampler {
        // Jitter at every decision averages out, and would not reach the rarer ones.
        held: HeldRandom::new(spaces.actions, HOLD_DECISIONS),
        values: vec![Vec::new(); spaces.observation],
    };
    let mut cost = Cost::default();
    for index in 0..STARTS {
        let key = key(seed, index);
        let start = (bench.draw(key), bench.noise_of(key));
        let (from, at) = (NoisyStart::from(&start), index as usize);
        let episode = watch.play(&mut bench, from, at, &mut seen, Aftermath::Skip);
        cost.simulations += 1;
        cost.physics_steps += episode.physics_steps;
    }
    for values in &mut seen.values {
        // Observations are finite, so all of them compare.
        values.sort_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    }
    (seen.values, cost)
}

/// Held random actions that record the observations.
struct ObservationSampler {
    held: HeldRandom,
    values: Vec<Vec<f32>>,
}

impl Actor for ObservationSampler {
    fn begin(&mut self, seed: u64, start: &Start) {
        self.held.begin(seed, start);
    }

    fn act(&mut self, obs: &[f32]) -> usize {
        for (values, value) in self.values.iter_mut().zip(obs) {
            values.push(*value);
        }
        self.held.act(obs)
    }
}

fn key(seed: u64, index: u64) -> StartKey {
    StartKey {
        purpose: Purpose::Train,
        seed,
        index,
    }
}

/// Rule whose thresholds are quantiles of the signal's usual values.
#[derive(Clone, Debug)]
struct QuantileRule {
    signal: usize,
    quantiles: [f64; 2],
    actions: [usize; 3],
}

impl QuantileRule {
    fn zones(&self, values: &[Vec<f32>]) -> Zones {
        let values = &values[self.signal];
        // Signals have different distributions, and ranks put all of them on one scale.
        let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
        Zones {
            position: self.signal,
            thresholds: self.quantiles.map(at),
            actions: self.actions,
        }
    }
}

fn describe(scenario: &Scenario, zones: Zones, cost: Cost) -> String {
    let observed = &scenario.world().observed()[zones.position];
    // The rule compares scaled observations, and a reader wants the signal's own unit.
    let value = |threshold: f32| observed.mid + observed.half * f64::from(threshold);
    let [low, high] = zones.thresholds.map(value);
    let [below, between, above] = zones.actions.map(|action| scenario.action_label(action));
    format!(
        "{} < {low:.2}: {below}; < {high:.2}: {between}; else {above}; tuned with {} simulations",
        observed.name, cost.simulations
    )
}

/// Returns the criteria of the ranking: successes, then the mean reward.
///
/// By the mean reward alone, the best rule would only avoid rule violations.
#[derive(Clone, Copy, Debug, Default)]
struct Score {
    successes: u64,
    reward: f64,
}

impl Score {
    fn better(&self, other: &Score) -> Ordering {
        let successes = self.successes.cmp(&other.successes);
        successes.then(self.reward.total_cmp(&other.reward))
    }
}

/// Result of a rule on the training starts.
struct RuleScore {
    score: Score,
    physics_steps: u64,
    cpu_s: f64,
}

fn try_out(
    bench: &mut Testbench,
    mut zones: Zones,
    seed: u64,
    watch: &Watch<'_>,
    turn: &WorkItem,
) -> RuleScore {
    let (mut score, mut physics_steps) = (Score::default(), 0);
    // All rules play the same starts, which makes their scores comparable.
    for index in 0..STARTS {
        let key = key(seed, index);
        let start = (bench.draw(key), bench.noise_of(key));
        let (from, at) = (NoisyStart::from(&start), index as usize);
        // What follows a verdict changes no score, so it is not simulated.
        let episode = watch.play(bench, from, at, &mut zones, Aftermath::Skip);
        // An invalid episode is worth nothing to either side.
        let reward = bench.rulebook().reward_of(&episode.verdict);
        score.reward += reward.unwrap_or(0.0) / STARTS as f64;
        score.successes += u64::from(episode.verdict.is_success());
        physics_steps += episode.physics_steps;
    }
    RuleScore {
        score,
        physics_steps,
        cpu_s: turn.cpu_s(),
    }
}

/// Distribution from which rules are drawn.
struct Chances {
    signal: Vec<f64>,
    actions: [Vec<f64>; 3],
    /// Mean and standard deviation of the quantiles.
    quantiles: [(f64, f64); 2],
}

impl Chances {
    fn even(signals: usize, actions: usize) -> Chances {
        let even = |n: usize| vec![1.0 / n as f64; n];
        Chances {
            signal: even(signals),
            actions: [even(actions), even(actions), even(actions)],
            // The first generation cuts the usual values into thirds.
            quantiles: [(1.0 / 3.0, 0.3), (2.0 / 3.0, 0.3)],
        }
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> QuantileRule {
        let signal = pick(&self.signal, rng);
        // A normal draw may leave the ranks, which end at 0 and 1.
        let mut quantiles = self
            .quantiles
            .map(|(mean, spread)| (mean + spread * seed::normal(rng)).clamp(0.0, 1.0));
        // Crossed thresholds would leave no middle zone.
        quantiles.sort_by(f64::total_cmp);
        let [a, b, c] = &self.actions;
        QuantileRule {
            signal,
            quantiles,
            actions: [pick(a, rng), pick(b, rng), pick(c, rng)],
        }
    }

    fn learn(&mut self, elites: &[&QuantileRule]) {
        let n = elites.len() as f64;
        let towards = |shares: &mut [f64], of: &dyn Fn(&QuantileRule) -> usize| {
            for (value, share) in shares.iter_mut().enumerate() {
                let chosen = elites.iter().filter(|rule| of(rule) == value).count();
                // Less than a full step, so an action that no elite used can still come
                // back.
                *share += SMOOTHING * (chosen as f64 / n - *share);
            }
        };
        towards(&mut self.signal, &|rule| rule.signal);
        for (zone, shares) in self.actions.iter_mut().enumerate() {
            towards(shares, &|rule| rule.actions[zone]);
        }
        for (i, (mean, spread)) in self.quantiles.iter_mut().enumerate() {
            let values = elites.iter().map(|rule| rule.quantiles[i]);
            let centre = values.clone().sum::<f64>() / n;
            let variance = values.map(|v| (v - centre).powi(2)).sum::<f64>() / n;
            *mean += SMOOTHING * (centre - *mean);
            *spread += SMOOTHING * (variance.sqrt() - *spread);
            // Elites that agree would otherwise end the search in its first generations.
            *spread = spread.max(LEAST_SPREAD);
        }
    }
}
