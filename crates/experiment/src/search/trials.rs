//! Whole episodes from one start, one after another, until the first success.

use super::found::SearchResult;
use super::method::StartSearch;
use crate::adversary::RecordedFailure;
use crate::scene::Start;
use crate::testbench::{Actor, Aftermath, Episode, Replay, play};
use crate::world::Repeats;

/// Simulations of one start, within the budget.
pub(super) struct Trials<'a> {
    one: StartSearch<'a>,
    stopped: bool,
    found: SearchResult,
}

impl<'a> Trials<'a> {
    /// Runs a method until [`Trials::play`] returns `None`.
    ///
    /// Returns `None` if stopped from outside before a result.
    pub(super) fn spend(
        one: StartSearch<'a>,
        method: impl FnOnce(&mut Trials<'a>),
    ) -> Option<SearchResult> {
        let mut trials = Trials {
            one,
            stopped: false,
            found: SearchResult::default(),
        };
        method(&mut trials);
        let has_result = trials.found.actions.is_some() || trials.found.fault.is_some();
        // A solution or a fault is a result even if the search was stopped afterwards.
        let unfinished = trials.stopped && !has_result;
        (!unfinished).then_some(trials.found)
    }

    /// Returns the start of every simulation.
    pub(super) fn start(&self) -> &'a Start {
        self.one.start
    }

    /// Returns the noise of every episode, on which the generators depend as well.
    pub(super) fn noise(&self) -> u64 {
        self.one.noise
    }

    /// Returns the number of simulations so far.
    pub(super) fn spent(&self) -> u64 {
        self.found.simulations
    }

    /// Returns the number of joint actions.
    pub(super) fn actions(&self) -> usize {
        self.one.bench.spaces().actions
    }

    /// Returns the number of decisions of a full episode.
    pub(super) fn decisions(&self) -> usize {
        self.one.bench.clock().decisions()
    }

    /// Plays an episode and returns its reward (Definition 4).
    ///
    /// Returns `None` after a success, after the budget is spent, and after a stop.
    /// An invalid episode ranks last.
    pub(super) fn play(&mut self, actor: &mut dyn Actor) -> Option<f64> {
        if self.one.watch.stopped() {
            // Noted, because `spend` tells a stopped search from one that found nothing,
            // and only the former has no result.
            self.stopped = true;
        }
        // Asked before the simulation, so that none is cut short by the budget.
        if self.stopped || self.is_over() {
            return None;
        }
        let episode = self.simulate(actor);
        if episode.verdict.is_success() && self.fails_again(&episode.actions) {
            self.found.violation_before_contact = episode.is_foul_before_contact();
            self.found.failure = RecordedFailure::of(self.one.scenario, &episode);
            self.found.actions = Some(episode.actions);
            self.found.impact = episode.contact.as_ref().and_then(|touch| touch.impact);
            self.found.closing_speed_mps = episode.contact.map(|touch| touch.closing_speed_mps);
            return None;
        }
        // A success that did not repeat often enough keeps its reward, which is above
        // that of any held run, so that methods search on near it.
        let reward = self.one.bench.rulebook().reward_of(&episode.verdict);
        Some(reward.unwrap_or(f64::NEG_INFINITY))
    }

    fn simulate(&mut self, actor: &mut dyn Actor) -> Episode {
        let one = &mut self.one;
        // A success is played on to its contact, which the row describes.
        let episode = play(one.bench, one.start, one.noise, actor, Aftermath::Play);
        one.watch
            .faults
            .note(one.index as u64, episode.fault.as_ref());
        self.found.simulations += 1;
        self.found.violations += u64::from(episode.verdict.is_foul());
        self.found.physics_steps += episode.physics_steps;
        if self.found.fault.is_none() {
            self.found.fault.clone_from(&episode.fault);
        }
        episode
    }

    /// Returns whether the ego fails as often as the world requires.
    ///
    /// It has failed once already.
    fn fails_again(&mut self, actions: &[usize]) -> bool {
        let Repeats { runs, gate } = self.one.scenario.repeats;
        let again = (1..runs).filter(|_| {
            // The recorded actions are repeated, because the actor may be random.
            let mut same = Replay::holding(actions);
            self.simulate(&mut same).verdict.is_success()
        });
        // The first failure counts as one of the runs.
        gate as usize <= 1 + again.count()
    }

    /// Plays a sequence of actions, the last action held, and returns its reward.
    pub(super) fn replay(&mut self, actions: &[usize]) -> Option<f64> {
        self.play(&mut Replay::holding(actions))
    }

    fn is_over(&self) -> bool {
        // Repetitions of a failure may overshoot the budget, so equality is not enough.
        self.found.actions.is_some() || self.one.budget <= self.found.simulations
    }
}
