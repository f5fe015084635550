//! Joint actions of the ados in an episode that goes sample by sample.

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::list::{Method, Switches};
use super::request::SearchRequest;
use super::search;
use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::rl::{Policy, Spaces};
use crate::run_dir::AdversaryId;
use crate::scene::Start;
use crate::testbench::{Actor, HOLD_DECISIONS, HeldRandom, draws};

/// Most action switches of the search's sequence.
const SWITCHES_OF_EPISODE: usize = 2;

/// Player of the ados of an episode that is driven or moved from outside.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    EnumMessage,
    EnumString,
    IntoStaticStr,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum AdoPlayer {
    /// Their neutral actions.
    #[default]
    Neutral,
    /// The trained ado of the run.
    Trained,
    /// Random actions, each held for a while.
    Random,
    /// The first successful sequence of a search against the ego.
    Search,
}

/// Source of the ados' joint actions.
pub enum JointActions {
    /// One action throughout.
    Constant(usize),
    /// A trained policy.
    Policy(Arc<dyn Policy>),
    /// A trained policy that draws its actions.
    Drawn(Box<DrawnPolicy>),
    /// Random actions, each held for a while.
    Random(Box<HeldRandom>),
    /// One action per decision, of which the last is held.
    Sequence(Vec<usize>),
}

/// Trained policy that draws its actions.
pub struct DrawnPolicy {
    policy: Arc<dyn Policy>,
    temperature: f64,
    rng: ChaCha8Rng,
}

impl JointActions {
    /// Returns the actions of a trained policy.
    pub fn trained(policy: &Arc<dyn Policy>) -> JointActions {
        let policy = Arc::clone(policy);
        match policy.drawn_at() {
            None => JointActions::Policy(policy),
            Some(temperature) => JointActions::Drawn(Box::new(DrawnPolicy {
                policy,
                temperature,
                // Each episode replaces the generator by that of its own seed.
                rng: draws(0, 0),
            })),
        }
    }

    /// Returns the neutral action throughout.
    pub fn neutral(spaces: &Spaces) -> JointActions {
        JointActions::Constant(spaces.neutral)
    }

    /// Returns held random actions.
    pub fn random(spaces: &Spaces) -> JointActions {
        JointActions::Random(Box::new(HeldRandom::new(spaces.actions, HOLD_DECISIONS)))
    }

    /// Returns the first successful sequence of a search from a start, if it finds any.
    pub fn searched(ego: &EgoUnderTest, start: &Start, noise: u64) -> Option<JointActions> {
        let starts = TestStarts {
            // A single start is of no stream, and the row that states the seed is dropped.
            seed: 0,
            starts: vec![(start.clone(), noise)],
            // Here the search has to answer even for a start on which the ego fails by
            // itself.
            trivial: vec![false],
        };
        let request = SearchRequest {
            scenario: ego.scenario(),
            ego: ego.name(),
            method: Method::from(Switches(SWITCHES_OF_EPISODE)),
            // A search of switches ends with its tree and needs no budget.
            budget: 0,
            starts: &starts,
        };
        let found = search(&request, &Watch::unwatched()).found;
        let actions = found.into_iter().flatten().next()?.actions?;
        Some(JointActions::Sequence(actions))
    }

    /// Begins an episode.
    pub fn begin(&mut self, noise: u64, start: &Start) {
        match self {
            JointActions::Random(random) => random.begin(noise, start),
            // As the first draw of an evaluation.
            JointActions::Drawn(drawn) => drawn.rng = draws(noise, 0),
            _ => {}
        }
    }

    /// Returns the joint action at a decision, counted from 0.
    pub fn act(&mut self, obs: &[f32], allowed: Option<&[bool]>, decision: usize) -> usize {
        match (self, allowed) {
            (JointActions::Constant(action), _) => *action,
            (JointActions::Policy(policy), Some(allowed)) => policy.act_among(obs, allowed),
            (JointActions::Policy(policy), None) => policy.act(obs),
            (JointActions::Drawn(drawn), allowed) => drawn.act(obs, allowed),
            (JointActions::Random(random), _) => random.act(obs),
            // As kept sequences: the last action is held.
            (JointActions::Sequence(actions), _) => {
                let action = actions.get(decision).or(actions.last());
                action.copied().unwrap_or_default()
            }
        }
    }

    /// Returns the return that a policy expects.
    pub fn value(&self, obs: &[f32]) -> Option<f32> {
        match self {
            JointActions::Policy(policy) => Some(policy.value(obs)),
            JointActions::Drawn(drawn) => Some(drawn.policy.value(obs)),
            _ => None,
        }
    }

    /// Returns the values of a policy's actions, empty where there are none.
    pub fn values(&self, obs: &[f32]) -> Vec<f32> {
        match self {
            JointActions::Policy(policy) => policy.action_values(obs).unwrap_or_default(),
            _ => Vec::new(),
        }
    }

    /// Returns the name of the player in kept files.
    pub fn adversary(&self) -> AdversaryId {
        match self {
            JointActions::Policy(_) | JointActions::Drawn(_) => AdversaryId::Trained,
            JointActions::Random(_) => AdversaryId::Hold,
            JointActions::Sequence(_) => AdversaryId::SEARCH,
            JointActions::Constant(_) => AdversaryId::Neutral,
        }
    }
}

impl DrawnPolicy {
    fn act(&mut self, obs: &[f32], allowed: Option<&[bool]>) -> usize {
        let rng = &mut self.rng;
        let mut units = || rng.random::<f64>();
        match allowed {
            Some(allowed) => self
                .policy
                .sample_among(obs, allowed, self.temperature, &mut units),
            None => self.policy.sample(obs, self.temperature, &mut units),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Policy that draws its first action three times of four.
    struct Biased;

    impl Policy for Biased {
        fn act(&self, _obs: &[f32]) -> usize {
            0
        }

        fn sample(&self, _obs: &[f32], _: f64, units: &mut dyn FnMut() -> f64) -> usize {
            usize::from(units() >= 0.75)
        }

        fn drawn_at(&self) -> Option<f64> {
            Some(1.0)
        }

        fn value(&self, _obs: &[f32]) -> f32 {
            0.0
        }
    }

    #[test]
    fn drawn_actions_are_among_those_allowed() {
        let policy: Arc<dyn Policy> = Arc::new(Biased);
        let mut actions = JointActions::trained(&policy);
        actions.begin(7, &Start(Vec::new()));
        let mut drawn = |allowed: Option<&[bool]>| -> Vec<usize> {
            (0..40).map(|at| actions.act(&[], allowed, at)).collect()
        };
        assert!(drawn(None).contains(&0));
        assert!(!drawn(Some(&[false, true])).contains(&0));
    }
}
