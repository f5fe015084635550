//! Ados of a row: policies, baselines and recordings.

use super::nearest_replay::NearestReplay;
use super::some_ados::SomeAdos;
use super::threshold_rule::Heuristic;
use crate::rl::{Policy, Spaces};
use crate::run_dir::{AdversaryId, Stored};
use crate::testbench::{
    Actor, Constant, HOLD_DECISIONS, HeldRandom, PolicyActor, Random, Replay, SampledPolicy,
    trained_actor,
};
use crate::world::{Scenario, TrainingEgos};

/// Player of the ado's actions.
#[derive(Clone, Copy)]
pub enum Ado<'a> {
    /// A trained policy and the seed of its training.
    Trained(&'a dyn Policy, u64),
    /// The policy of [`Ado::Trained`], with actions drawn at a temperature.
    Sampled(&'a dyn Policy, u64, f64),
    /// A trained policy whose ado of this name plays its action without effect.
    Without(&'a dyn Policy, u64, &'a str),
    /// The ado of this name of a trained policy, while the others play without effect.
    Alone(&'a dyn Policy, u64, &'a str),
    /// The action without effect, beside the placed ados of the world.
    Composed,
    /// The neutral action throughout, so that the ego fails by itself or not at all.
    Neutral,
    /// A uniformly random action at each decision.
    Random,
    /// A uniformly random action, held for five decisions.
    Hold,
    /// The same action all the time.
    Constant(usize),
    /// An untrained rule, with its name and its method in rows.
    Rule(&'a dyn Policy, &'static str, &'static str),
    /// These actions, one per decision; the last one is held.
    Script(&'a [usize]),
    /// A hand-made rule, tuned once.
    Heuristic(&'a Heuristic),
    /// A number of the nearest stored counterexamples, until one succeeds.
    Replays(&'a Stored, usize),
}

impl Ado<'_> {
    /// Returns the identity in rows.
    pub fn id(&self) -> AdversaryId {
        match *self {
            Ado::Trained(..) => AdversaryId::Trained,
            Ado::Sampled(..) => AdversaryId::Sampled,
            Ado::Without(_, _, name) => AdversaryId::without(name),
            Ado::Alone(_, _, name) => AdversaryId::alone(name),
            Ado::Composed => AdversaryId::Composed,
            Ado::Neutral => AdversaryId::Neutral,
            Ado::Random => AdversaryId::Random,
            Ado::Hold => AdversaryId::Hold,
            // The row states the label as its method, so the id needs no name.
            Ado::Constant(action) => AdversaryId::Constant { action, name: None },
            Ado::Rule(_, name, _) => name.into(),
            Ado::Script(_) => "script".into(),
            Ado::Heuristic(_) => AdversaryId::Heuristic,
            Ado::Replays(_, nearest) => AdversaryId::Replays { nearest },
        }
    }

    pub(super) fn method(&self, scenario: &Scenario) -> String {
        match self {
            // Two ados of one learner differ by the egos that their training knew.
            Ado::Trained(..) | Ado::Without(..) | Ado::Alone(..) => match scenario.against {
                TrainingEgos::Nominal => scenario.learner.name().to_lowercase(),
                family => format!("{}, {family}", scenario.learner.name().to_lowercase()),
            },
            Ado::Sampled(_, _, temperature) => {
                let name = scenario.learner.name().to_lowercase();
                format!("{name}, drawn at temperature {temperature}")
            }
            Ado::Composed => format!("placed: {}", scenario.judged_ados().join(", ")),
            Ado::Neutral => scenario.action_label(scenario.world().spaces().neutral),
            Ado::Random => "random".to_owned(),
            Ado::Hold => format!("random, held {HOLD_DECISIONS} decisions"),
            Ado::Constant(action) => scenario.action_label(*action),
            Ado::Rule(_, _, method) => (*method).to_owned(),
            Ado::Script(_) => "actions as given".to_owned(),
            Ado::Heuristic(heuristic) => heuristic.text.clone(),
            Ado::Replays(_, nearest) => format!("open loop, the {nearest} nearest"),
        }
    }

    /// Returns the actor of the `run`-th run of every episode, in a world of these spaces.
    pub fn actor(&self, spaces: &Spaces, run: u64) -> Box<dyn Actor + '_> {
        let actions = spaces.actions;
        match *self {
            // A policy that draws its actions makes another draw in each run of a start.
            Ado::Trained(policy, _) => trained_actor(policy, run),
            Ado::Rule(policy, ..) => Box::new(PolicyActor(policy)),
            Ado::Sampled(policy, _, temperature) => {
                Box::new(SampledPolicy::new(policy, temperature, run))
            }
            Ado::Without(policy, _, ado) => {
                Box::new(SomeAdos::new(policy, run, spaces, |name| name == ado))
            }
            Ado::Alone(policy, _, ado) => {
                Box::new(SomeAdos::new(policy, run, spaces, |name| name != ado))
            }
            // Placed ados drive by their own rules, so nothing is left to decide.
            Ado::Composed | Ado::Neutral => Box::new(Constant(spaces.neutral)),
            Ado::Random => Box::new(Random::new(actions)),
            Ado::Hold => Box::new(HeldRandom::new(actions, HOLD_DECISIONS)),
            Ado::Constant(action) => Box::new(Constant(action)),
            Ado::Script(actions) => Box::new(Replay::holding(actions)),
            Ado::Heuristic(heuristic) => Box::new(PolicyActor(heuristic)),
            // Further replays are episodes of their own, which the evaluation plays.
            Ado::Replays(stored, _) => Box::new(NearestReplay::new(stored, 0)),
        }
    }
}
