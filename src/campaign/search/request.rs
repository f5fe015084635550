//! What is searched, and what is found.

use crate::campaign::starts::TestStarts;
use crate::ego::Fault;
use crate::run::Stored;
use crate::scenario::Scenario;
use crate::severity::Impact;

/// Settings of the cross-entropy method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cem {
    /// Sequences per generation (20).
    pub population: usize,
    /// The best of them, from which the next generation is drawn (4).
    pub elites: usize,
    /// Weight of the elites against the old distribution (0.6).
    pub smoothing: f64,
    /// Decisions for which a drawn action is held (5).
    pub hold: usize,
    /// Chance that an action is drawn uniformly after all (0.2).
    pub exploration: f64,
}

impl Default for Cem {
    fn default() -> Cem {
        Cem {
            population: 20,
            elites: 4,
            smoothing: 0.6,
            hold: 5,
            exploration: 0.2,
        }
    }
}

/// Most switches of action in the sequences of [`Method::Switches`], unless told
/// otherwise; what it then solves is what rows call reachable.
pub const SWITCHES: usize = 2;

/// How sequences of actions are chosen.
#[derive(Clone, Copy, Debug)]
pub enum Method<'a> {
    /// A uniformly random action at each decision.
    Uniform,
    /// A uniformly random action, held for five decisions.
    Hold,
    /// The cross-entropy method with the rulebook's reward as fitness.
    Cem(Cem),
    /// Mutations of the nearest counterexamples of a training.
    Mutate(&'a Stored),
    /// All sequences with at most so many switches of action, fewest first.
    Switches(usize),
}

/// What to search.
#[derive(Clone, Copy)]
pub struct SearchRequest<'a> {
    /// The world, with the ego to be tested.
    pub scenario: &'a Scenario,
    /// What rows call that ego.
    pub ego: &'a str,
    /// How sequences are chosen.
    pub method: Method<'a>,
    /// Simulations per start; `Method::Switches` does without.
    pub budget: u64,
    /// The test starts.
    pub starts: &'a TestStarts,
}

/// A solution and what was spent on one start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// The actions that make the ego fail, if any were found.
    pub actions: Option<Vec<usize>>,
    /// Closing speed, if the agents touched after it.
    pub closing_speed_mps: Option<f64>,
    /// What the contact does to the ego, if it has part in it.
    pub impact: Option<Impact>,
    /// Whether a rule was broken between the success and that contact.
    pub foul_before_contact: bool,
    /// Episodes run, a part of one counted as one; the last is the success.
    pub simulations: u64,
    /// Physics steps spent, on both plants.
    pub physics_steps: u64,
    /// Sequences that succeeded when pre-screened and not on the plant asked for.
    pub unconfirmed: u64,
    /// The first fault of ego or physics: without a solution nobody knows
    /// whether the start has one.
    pub fault: Option<Fault>,
    /// Processor time spent.
    pub cpu_s: f64,
}

impl Found {
    /// Whether it says nothing: not solved, and the ego failed to run.
    pub fn is_invalid(&self) -> bool {
        self.actions.is_none() && self.fault.is_some()
    }

    /// Simulations spent with a budget of `budget`, and whether they suffice.
    pub fn within(&self, budget: u64) -> (u64, bool) {
        let solved = self.actions.is_some() && self.simulations <= budget;
        (self.simulations.min(budget), solved)
    }
}
