//! Several attempts of a trained ado per start.
//!
//! The first attempt is greedy. The following attempts explore: at random decisions a
//! random action is held for some decisions, or all actions are drawn at a temperature.
//! Every attempt is a simulation that the row counts. A start that the greedy attempt solves remains solved.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::rollout::{EpisodeResult, EvalRequest, Evaluated, Outcome, RepeatedEpisode};
use crate::experiment::{Watch, WorkItem};
use crate::rl::Policy;
use crate::run_dir::AdversaryId;
use crate::scene::Start;
use crate::seed;
use crate::testbench::{Actor, Aftermath, Episode, SampledPolicy, Testbench, play};

/// Probabilities at which exploration begins at a decision, in turn.
const RATES: [f64; 3] = [0.1, 0.2, 0.4];
/// Largest number of decisions for which a random action is held.
const HOLD: usize = 6;

/// Ado with several attempts per start.
#[derive(Clone, Copy)]
pub struct BestOfN<'a> {
    /// Ego, ado and starts, where the ado is `policy`.
    pub request: EvalRequest<'a>,
    /// Policy of the greedy attempt.
    pub policy: &'a dyn Policy,
    /// Attempts per start, including the greedy one.
    pub tries: u64,
    /// Temperature at which later attempts draw their actions. `None`: they explore.
    pub temperature: Option<f64>,
}

/// Row with its outcomes and the successful attempt of each start.
#[derive(Clone, Debug)]
pub struct BestOfNResult {
    /// Row, which counts all simulations.
    pub evaluated: Evaluated,
    /// Successful attempt per start, 0 for the greedy one.
    pub winners: Vec<Option<u64>>,
}

impl BestOfN<'_> {
    /// Plays every start until its first success.
    ///
    /// An unsolved start keeps the outcome of its greedy run.
    pub fn run(&self, watch: &Watch<'_>) -> BestOfNResult {
        let bench = || self.request.scenario.bench();
        let played = self.request.starts.each(watch, bench, |bench, _, turn| {
            self.solve(bench, turn, watch)
        });
        let valid = played
            .iter()
            .flatten()
            .filter(|(played, ..)| played.fault.is_none());
        let simulations: u64 = valid.map(|(_, spent, _)| spent).sum();
        let winners = played
            .iter()
            .map(|p| p.as_ref().and_then(|(.., w)| *w))
            .collect();
        let played = played.into_iter().map(|p| p.map(|(played, ..)| played));
        let mut evaluated = Evaluated::of(&self.request, played.collect(), watch);
        let row = &mut evaluated.row;
        row.sims_per_start = simulations as f64 / row.starts.max(1) as f64;
        if let Some(temperature) = self.temperature {
            let draws = self.tries.saturating_sub(1);
            row.ado = AdversaryId::Sampled;
            row.method = format!(
                "{}, then at most {draws} draws at temperature {temperature}",
                row.method
            );
        } else if self.tries > 1 {
            row.method = format!("{}, at most {} tries", row.method, self.tries);
        }
        BestOfNResult { winners, evaluated }
    }

    fn solve(
        &self,
        bench: &mut Testbench,
        turn: &WorkItem,
        watch: &Watch<'_>,
    ) -> Option<(EpisodeResult, u64, Option<u64>)> {
        let index = turn.index;
        let mut first: Option<EpisodeResult> = None;
        let (mut simulations, mut physics_steps) = (0, 0);
        for number in 0..self.tries {
            if watch.stopped() {
                // A fault is a result, because it shows that the ego does not run.
                return first
                    .filter(|first| first.fault.is_some())
                    .map(|f| (f, simulations, None));
            }
            let episode = self.play(bench, index, number);
            watch.faults.note(index as u64, episode.fault.as_ref());
            simulations += 1;
            physics_steps += episode.physics_steps;
            let attempt = RepeatedEpisode::of(episode, simulations, physics_steps);
            let played = attempt.played(self.request.scenario, turn.cpu_s());
            if played.outcome.verdict.is_success() {
                return Some((played, number + 1, Some(number)));
            }
            // The outcome of an invalid attempt is unknown, so it takes precedence.
            match &first {
                Some(first) if first.fault.is_some() || played.fault.is_none() => {}
                _ => first = Some(played),
            }
        }
        let mut unsolved = first?;
        unsolved.outcome = Outcome {
            simulations,
            physics_steps,
            cpu_s: turn.cpu_s(),
            ..unsolved.outcome
        };
        Some((unsolved, self.tries, None))
    }

    /// Plays an attempt of a start, as a pure function of both.
    pub fn play(&self, bench: &mut Testbench, index: usize, number: u64) -> Episode {
        let (start, noise) = &self.request.starts.starts[index];
        if number == 0 {
            return self.request.play(bench, index);
        }
        if let Some(temperature) = self.temperature {
            let mut actor = SampledPolicy::new(self.policy, temperature, number);
            return play(bench, start, *noise, &mut actor, Aftermath::Play);
        }
        let mut actor = Exploring {
            policy: self.policy,
            rate: RATES[(number / 2) as usize % RATES.len()],
            number,
            actions: bench.spaces().actions,
            held: 0,
            left: 0,
            dice: seed::generator("tries", &[]),
        };
        play(bench, start, *noise, &mut actor, Aftermath::Play)
    }
}

/// Policy that holds a random action at times.
struct Exploring<'a> {
    policy: &'a dyn Policy,
    rate: f64,
    number: u64,
    actions: usize,
    held: usize,
    left: usize,
    dice: ChaCha8Rng,
}

impl Actor for Exploring<'_> {
    fn begin(&mut self, noise: u64, _start: &Start) {
        self.dice = seed::generator("tries", &[noise, self.number]);
        self.left = 0;
    }

    fn act(&mut self, obs: &[f32]) -> usize {
        if self.left == 0 && self.dice.random::<f64>() < self.rate {
            self.held = self.dice.random_range(0..self.actions);
            self.left = self.dice.random_range(1..=HOLD);
        }
        if self.left > 0 {
            self.left -= 1;
            return self.held;
        }
        self.policy.act(obs)
    }
}
