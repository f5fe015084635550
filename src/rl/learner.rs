//! The learner-neutral surface: what a learner does, and how it says no.

use super::bundle::{Bundle, BundleError};
use super::{Control, Env, LearnerReport, Policy};

/// How much of what a learner was asked to do is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tally {
    /// Decisions to train for.
    pub asked: u64,
    /// Decisions taken.
    pub decisions: u64,
    /// Episodes finished.
    pub episodes: u64,
    /// Episodes dropped for faults of the environment.
    pub aborted: u64,
}

impl Tally {
    /// Nothing done yet.
    pub fn new(asked: u64) -> Tally {
        Tally {
            asked,
            decisions: 0,
            episodes: 0,
            aborted: 0,
        }
    }

    /// Episodes begun: the index of the next start.
    pub(super) fn begun(&self) -> u64 {
        self.episodes + self.aborted
    }

    pub(super) fn save(&self, bundle: &mut Bundle) {
        let counters = vec![self.decisions, self.episodes, self.aborted];
        bundle.put("counters", &[3], counters);
    }

    /// What [`Tally::save`] wrote, of a training for as many decisions.
    pub(super) fn restore(&mut self, bundle: &Bundle) -> Result<(), BundleError> {
        let counters = bundle.get::<u64>("counters", &[3])?;
        (self.decisions, self.episodes, self.aborted) = (counters[0], counters[1], counters[2]);
        Ok(())
    }
}

/// An episode that succeeded: where it began and what was done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Demonstration {
    /// The episode index to reset the environment with.
    pub index: u64,
    /// The actions, to the end of the episode.
    pub actions: Vec<usize>,
}

/// A learner at work: a configuration turned into state.
pub trait Learner: Send {
    /// Plays one episode, learning on the way; returns its return.
    fn episode(&mut self, env: &mut dyn Env) -> f32;

    /// Shows successes to a learner that wants them, before its first episode;
    /// gives how many succeed in `env` and are kept. Others look at none.
    fn demonstrate(&mut self, _env: &mut dyn Env, _shown: &[Demonstration]) -> usize {
        0
    }

    /// Goes on for so many decisions more than it was asked for. Learners that
    /// cannot adapt stop where they were asked to.
    fn extend(&mut self, _decisions: u64) {}

    /// Forgets what it believes and keeps what it remembers: a training that got
    /// stuck begins anew, with all it has seen.
    fn renew(&mut self) {}

    /// What is done so far.
    fn tally(&self) -> &Tally;

    /// How likely an action is exploratory now.
    fn exploration(&self) -> f64;

    /// Trains until the configured decisions are taken or `observer` says
    /// [`Control::Stop`].
    ///
    /// `observer` is called after every episode; the episode in which the last
    /// decision falls is played to its end. `env` must be the same problem at
    /// every call.
    fn train(&mut self, env: &mut dyn Env, observer: &mut dyn FnMut(&LearnerReport) -> Control) {
        while !self.finished() {
            let episode_return = self.episode(env);
            let tally = self.tally();
            let progress = LearnerReport {
                decisions: tally.decisions,
                episodes: tally.episodes,
                aborted: tally.aborted,
                episode_return,
                exploration: self.exploration() as f32,
            };
            if observer(&progress) == Control::Stop {
                return;
            }
        }
    }

    /// Decisions taken so far.
    fn decisions(&self) -> u64 {
        self.tally().decisions
    }

    /// Whether the configured decisions are taken.
    fn finished(&self) -> bool {
        self.tally().asked <= self.tally().decisions
    }

    /// The greedy policy learned so far.
    fn policy(&self) -> Box<dyn Policy>;

    /// The same policy, to be kept; [`super::load_policy`] reads it.
    fn policy_bundle(&self) -> Bundle;

    /// Everything that training needs to go on as if never interrupted.
    fn checkpoint(&self) -> Bundle;
}

/// A hyperparameter that is out of range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}; {help}", self.what())]
pub struct ConfigError {
    /// The field, as in a world file.
    pub field: &'static str,
    /// What is wrong with it.
    pub why: String,
    /// What would be right.
    pub help: String,
}

impl ConfigError {
    /// The field and what is wrong with it.
    pub fn what(&self) -> String {
        format!("learner field `{}` {}", self.field, self.why)
    }
}

/// Refuses a number outside of [low, high], and NaN.
pub(super) fn within(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), ConfigError> {
    if low <= value && value <= high {
        return Ok(());
    }
    Err(ConfigError {
        field,
        why: format!("is {value}"),
        help: format!("give a number from {low} to {high}"),
    })
}

/// Refuses a bundle of another kind.
pub(super) fn expect_kind(bundle: &Bundle, kind: &'static str) -> Result<(), BundleError> {
    if bundle.meta() == kind {
        return Ok(());
    }
    Err(BundleError::Mismatch {
        what: "the kind of the bundle",
        expected: format!("`{kind}`"),
        found: format!("`{}`", bundle.meta()),
    })
}

/// Refuses a network of other sizes than configured.
pub(super) fn expect_sizes(
    what: &'static str,
    found: &[usize],
    expected: &[usize],
) -> Result<(), BundleError> {
    if found == expected {
        return Ok(());
    }
    Err(BundleError::Mismatch {
        what,
        expected: format!("{expected:?}"),
        found: format!("{found:?}"),
    })
}

/// ε of ε-greedy exploration: falls between `ends` over a share of the training.
pub(super) fn epsilon(tally: &Tally, ends: (f64, f64), share: f64) -> f64 {
    linear(ends.0, ends.1, tally.decisions, share * tally.asked as f64)
}

/// From `start` to `end` in a straight line over the first `span` decisions.
pub(super) fn linear(start: f64, end: f64, decisions: u64, span: f64) -> f64 {
    let decisions = decisions as f64;
    if decisions < span {
        start + (end - start) * (decisions / span)
    } else {
        end
    }
}
