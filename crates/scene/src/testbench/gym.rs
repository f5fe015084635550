//! The test bench as an environment for learners.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{Aftermath, Episode, FaultLog, Testbench};
use crate::rl::{self, End, Spaces, Step};
use crate::rulebook::Verdict;
use crate::scene::Start;
use crate::seed::{Purpose, StartKey};

/// An episode of a learner in which the ego failed without rule violations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Success {
    /// Total number of decisions taken when it ended.
    pub decisions: u64,
    /// Index of its start in the stream.
    pub index: u64,
    /// Start of the episode.
    pub start: Start,
    /// The ados' joint actions.
    pub actions: Vec<usize>,
    /// Depth of the violation, ρ(¬ψ_ego).
    pub by: f64,
}

/// Episode that is known from elsewhere: its start and the ados' actions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownEpisode {
    /// Start of the episode.
    pub start: Start,
    /// Seed of its noise.
    pub noise: u64,
    /// The ados' joint actions.
    pub actions: Vec<usize>,
}

/// Index of the first known episode of a [`Gym`], above those of all streams.
pub const FIRST_KNOWN: u64 = 1 << 42;

/// The test bench as an environment: an episodic decision problem.
///
/// Starts come from the stream (purpose, seed), and `reset(i)` begins its i-th.
pub struct Gym {
    bench: Testbench,
    purpose: Purpose,
    seed: u64,
    /// Index of the running episode.
    index: u64,
    /// Episodes beyond the stream, from index [`FIRST_KNOWN`] on.
    known: Arc<[KnownEpisode]>,
    start: Start,
    actions: Vec<usize>,
    spent: Spent,
    successes: Option<Vec<Success>>,
    faults: FaultLog,
    aftermath: Aftermath,
}

/// Cost of the episodes of a [`Gym`] so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spent {
    /// Decisions taken.
    pub decisions: u64,
    /// Physics steps of the episodes that have ended.
    pub physics_steps: u64,
}

impl Gym {
    /// Creates a gym with training starts of `seed` on `bench`.
    pub fn new(bench: Testbench, purpose: Purpose, seed: u64) -> Gym {
        // Invariant: training never sees a test start.
        assert!(purpose != Purpose::Test, "learners get no test starts");
        Gym {
            bench,
            purpose,
            seed,
            index: 0,
            known: Arc::default(),
            start: Start(Vec::new()),
            actions: Vec::new(),
            spent: Spent::default(),
            successes: None,
            faults: FaultLog::default(),
            aftermath: Aftermath::Skip,
        }
    }

    /// Plays on after a success, with its last action held, to the contact or the horizon.
    ///
    /// The learner does not decide any more.
    pub fn play_aftermath(&mut self) {
        self.aftermath = Aftermath::Play;
    }

    /// Returns the episode that has just ended, if it is a success.
    pub fn success(&self) -> Option<Episode> {
        let success = self.bench.verdict()?.is_success();
        success.then(|| self.ended_episode()).flatten()
    }

    /// Returns the record of the episode that has just ended.
    pub fn ended_episode(&self) -> Option<Episode> {
        self.bench.verdict()?;
        let (_, noise) = self.start_of(self.index);
        Some(self.bench.episode(&self.start, noise, self.actions.clone()))
    }

    /// Returns the reward of the success that has just ended, 0 if it is none.
    ///
    /// `share` in [0, 1] states how far it reaches the goals of the training.
    pub fn reward_for(&self, share: f64) -> f32 {
        match self.bench.verdict() {
            Some(Verdict::Counterexample { by }) => {
                self.bench.rulebook.reward.success(by, share) as f32
            }
            _ => 0.0,
        }
    }

    /// Reports the end of every episode to `faults`.
    pub fn tell_faults(&mut self, faults: FaultLog) {
        self.faults = faults;
    }

    /// Continues the count of costs from `spent`.
    pub fn count_from(&mut self, spent: Spent) {
        self.spent = spent;
    }

    /// Keeps successes until they are taken.
    pub fn keep_successes(&mut self) {
        self.successes = Some(Vec::new());
    }

    /// Returns the successes since the last call, in order.
    pub fn take_successes(&mut self) -> Vec<Success> {
        self.successes
            .as_mut()
            .map(std::mem::take)
            .unwrap_or_default()
    }

    /// Returns the cost so far.
    #[doc(hidden)]
    pub fn spent(&self) -> Spent {
        self.spent
    }

    fn note_end(&mut self, verdict: Verdict) {
        self.spent.physics_steps += self.bench.physics_steps();
        self.faults.note(self.index, self.bench.fault());
        if let (Some(successes), Verdict::Counterexample { by }) = (&mut self.successes, verdict) {
            successes.push(Success {
                decisions: self.spent.decisions,
                index: self.index,
                start: self.start.clone(),
                // A limit may have replaced actions, and a replay needs those that were
                // played.
                actions: self.bench.as_played(self.actions.clone()),
                by,
            });
        }
    }

    /// Adds known episodes, whose starts follow [`FIRST_KNOWN`].
    pub fn know(&mut self, known: Arc<[KnownEpisode]>) {
        self.known = known;
    }

    fn start_of(&self, index: u64) -> (Start, u64) {
        start_of(&self.bench, self.key(index), &self.known)
    }

    /// Returns the bench on which it plays.
    pub fn bench(&mut self) -> &mut Testbench {
        &mut self.bench
    }

    /// Returns the key of the episode that `reset(index)` begins.
    pub fn key(&self, index: u64) -> StartKey {
        StartKey {
            purpose: self.purpose,
            seed: self.seed,
            index,
        }
    }
}

/// Returns the start of an episode and the seed of its noise.
///
/// Indices from [`FIRST_KNOWN`] on are positions among the known episodes.
pub fn start_of(bench: &Testbench, key: StartKey, known: &[KnownEpisode]) -> (Start, u64) {
    let at = key.index.checked_sub(FIRST_KNOWN);
    match at.and_then(|at| known.get(at as usize)) {
        Some(known) => (known.start.clone(), known.noise),
        None => (bench.draw(key), bench.noise_of(key)),
    }
}

impl rl::Env for Gym {
    fn spaces(&self) -> &Spaces {
        self.bench.spaces()
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        let (start, noise) = self.start_of(index);
        self.index = index;
        self.start = start;
        self.actions.clear();
        self.bench.begin(&self.start, noise, self.aftermath);
        self.bench.observe(obs);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.bench.decide(action);
        self.bench.observe(obs);
        self.actions.push(action);
        self.spent.decisions += 1;
        let Some(verdict) = self.bench.verdict() else {
            return Step {
                reward: 0.0,
                end: None,
            };
        };
        // An observation after the verdict looks like one before it and is worth
        // something else, so no learner gets to see one.
        while !self.bench.is_done() {
            self.bench.decide(action);
        }
        self.note_end(verdict);
        match self.bench.rulebook.reward_of(&verdict) {
            // The one cast from rewards to learners (see ARCHITECTURE.md).
            Some(reward) => Step {
                reward: reward as f32,
                end: Some(End::Terminated),
            },
            // An invalid episode has no reward. `Aborted` keeps it out of the
            // updates.
            None => Step {
                reward: 0.0,
                end: Some(End::Aborted),
            },
        }
    }

    fn part_rewards(&self, step: Step, rewards: &mut [f32]) {
        rewards.fill(step.reward);
        let verdict = self.bench.verdict().filter(|verdict| verdict.is_foul());
        let Some(verdict) = verdict else {
            return;
        };
        let rulebook = self.bench.rulebook();
        for (part, reward) in self.bench.spaces().parts.iter().zip(rewards) {
            let own = rulebook.reward_of_ado(&part.name, &verdict, self.bench.broken_rules());
            // As the reward of all ados: the cast from rewards to learners.
            *reward = own.unwrap_or_default() as f32;
        }
    }
}
