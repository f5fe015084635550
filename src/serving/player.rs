//! Player of the served ados: a trained policy, a search, or none.

use std::sync::Arc;

use crate::experiment::{EgoError, EgoUnderTest, consent_to};
use crate::rl::{Policy, Spaces};
use crate::scene::Start;
use crate::search::{AdoPlayer, JointActions};
use crate::world::Scenario;

/// Source of the ados' actions of every episode.
pub(super) enum ServedPlayer {
    Trained(Arc<dyn Policy>),
    Neutral,
    Random,
    /// Searches against this ego from the start of every episode.
    Search(Box<EgoUnderTest>),
}

impl ServedPlayer {
    /// Returns a player that needs no training. `None` for the trained ado.
    ///
    /// # Errors
    /// The search would start a program without consent.
    pub(super) fn untrained(
        world: &Scenario,
        player: AdoPlayer,
    ) -> Result<Option<ServedPlayer>, EgoError> {
        Ok(Some(match player {
            // A policy needs its run, which a world alone does not name.
            AdoPlayer::Trained => return Ok(None),
            AdoPlayer::Neutral => ServedPlayer::Neutral,
            AdoPlayer::Random => ServedPlayer::Random,
            AdoPlayer::Search => {
                let ego = EgoUnderTest::nominal(world);
                // The other players never play the world's own ego, so they need no
                // consent.
                consent_to(std::slice::from_ref(&ego))?;
                ServedPlayer::Search(Box::new(ego))
            }
        }))
    }

    /// Returns the word for this player.
    pub(super) fn word(&self) -> &'static str {
        <&str>::from(match self {
            ServedPlayer::Trained(_) => AdoPlayer::Trained,
            ServedPlayer::Neutral => AdoPlayer::Neutral,
            ServedPlayer::Random => AdoPlayer::Random,
            ServedPlayer::Search(_) => AdoPlayer::Search,
        })
    }

    /// Returns the trained policy.
    ///
    /// # Errors
    /// The ados follow no policy, so they decide in an episode only.
    pub(super) fn policy(&self) -> Result<&dyn Policy, String> {
        match self {
            ServedPlayer::Trained(policy) => Ok(&**policy),
            _ => Err(format!(
                "`decide` requires a trained ado, and these are `{}`: begin a judged episode with \
                 `reset`, or serve a run",
                self.word()
            )),
        }
    }

    /// Returns the joint actions of an episode, and whether a search found them.
    ///
    /// Without a sequence from this start the ados are neutral.
    pub(super) fn joint_actions(
        &self,
        start: &Start,
        noise: u64,
        spaces: &Spaces,
    ) -> (JointActions, Option<bool>) {
        let mut found = None;
        let mut actions = match self {
            ServedPlayer::Trained(policy) => JointActions::trained(policy),
            ServedPlayer::Neutral => JointActions::neutral(spaces),
            ServedPlayer::Random => JointActions::random(spaces),
            ServedPlayer::Search(ego) => {
                // The ego of the other simulator cannot be played ahead, so the world's
                // own is searched.
                let sequence = JointActions::searched(ego, start, noise);
                found = Some(sequence.is_some());
                sequence.unwrap_or_else(|| JointActions::neutral(spaces))
            }
        };
        // Random and drawn actions take their numbers from the noise of the episode, as
        // they do in an evaluation.
        actions.begin(noise, start);
        (actions, found)
    }
}
