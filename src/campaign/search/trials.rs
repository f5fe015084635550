//! Whole episodes from one start, one after the other, until one succeeds.

use super::request::{Found, SearchRequest};
use crate::campaign::Watch;
use crate::scenario::Repeats;
use crate::scene::Start;
use crate::testbench::{Actor, Aftermath, Episode, Replay, Testbench, play};

/// The simulations spent on one start, within the budget.
pub(super) struct Trials<'a> {
    bench: &'a mut Testbench,
    start: &'a Start,
    noise: u64,
    budget: u64,
    repeats: Repeats,
    index: u64,
    watch: &'a Watch<'a>,
    stopped: bool,
    found: Found,
}

impl<'a> Trials<'a> {
    /// Nothing spent yet of `budget` simulations.
    pub fn new(
        request: &SearchRequest<'_>,
        bench: &'a mut Testbench,
        (start, noise): (&'a Start, u64),
        index: usize,
        watch: &'a Watch<'a>,
    ) -> Trials<'a> {
        Trials {
            bench,
            start,
            noise,
            budget: request.budget,
            repeats: request.scenario.repeats,
            index: index as u64,
            watch,
            stopped: false,
            found: Found::default(),
        }
    }

    /// Simulations so far.
    pub fn spent(&self) -> u64 {
        self.found.simulations
    }

    /// Joint actions to choose from.
    pub fn actions(&self) -> usize {
        self.bench.spaces().actions
    }

    /// Decisions of a full episode.
    pub fn decisions(&self) -> usize {
        self.bench.clock().decisions()
    }

    /// Plays one episode and gives its reward (Definition 4).
    ///
    /// `None`: there is nothing more to do, because it succeeded, the budget is
    /// spent, or somebody asked to stop. An invalid episode ranks last.
    pub fn play(&mut self, actor: &mut dyn Actor) -> Option<f64> {
        if self.watch.stopped() {
            self.stopped = true;
        }
        if self.stopped || self.is_over() {
            return None;
        }
        let episode = self.simulate(actor);
        if episode.verdict.is_success() && self.fails_again(&episode.actions) {
            self.found.foul_before_contact = episode.is_foul_before_contact();
            self.found.actions = Some(episode.actions);
            self.found.impact = episode.contact.as_ref().and_then(|touch| touch.impact);
            self.found.closing_speed_mps = episode.contact.map(|touch| touch.closing_speed_mps);
            return None;
        }
        let reward = self.bench.rulebook().reward_of(&episode.verdict);
        Some(reward.unwrap_or(f64::NEG_INFINITY))
    }

    fn simulate(&mut self, actor: &mut dyn Actor) -> Episode {
        let episode = play(self.bench, self.start, self.noise, actor, Aftermath::Play);
        self.watch.faults.note(self.index, episode.fault.as_ref());
        self.found.simulations += 1;
        self.found.physics_steps += episode.physics_steps;
        if self.found.fault.is_none() {
            self.found.fault.clone_from(&episode.fault);
        }
        episode
    }

    /// Whether an ego that failed once does so as often as the world asks.
    fn fails_again(&mut self, actions: &[usize]) -> bool {
        let Repeats { runs, gate } = self.repeats;
        let again = (1..runs).filter(|_| {
            let mut same = Replay::holding(actions);
            self.simulate(&mut same).verdict.is_success()
        });
        gate as usize <= 1 + again.count()
    }

    /// The same for a sequence of actions, the last one held.
    pub fn replay(&mut self, actions: &[usize]) -> Option<f64> {
        self.play(&mut Replay::holding(actions))
    }

    /// What came of it; `None` when stopped from outside before a result.
    pub fn finish(self) -> Option<Found> {
        let tells = self.found.actions.is_some() || self.found.fault.is_some();
        let unfinished = self.stopped && !tells;
        (!unfinished).then_some(self.found)
    }

    fn is_over(&self) -> bool {
        self.found.actions.is_some() || self.budget <= self.found.simulations
    }
}
