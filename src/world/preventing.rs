//! Which reference drivers would have avoided what happened in an episode?

use std::sync::Arc;

use super::Scenario;
use crate::ego::reference::ReferenceDriver;
use crate::preventability::{FilmedDriver, NotApplicable, Preventability, Replayer};
use crate::scene::World;
use crate::testbench::{Episode, film, motion_of};

impl Scenario {
    /// Puts reference drivers into the ego's place in recorded motions of this
    /// world; `None`: nothing drives in it.
    pub fn replayer(&self) -> Option<Replayer> {
        match &self.world {
            World::Drive(world) => Replayer::new(world, Arc::clone(&self.rulebook)),
            World::Grid(_) => None,
        }
    }

    /// Which drivers would have avoided the contact of an episode of this world.
    ///
    /// The episode is played again for everybody's motion; what an ego that
    /// nobody here wrote commanded is repeated, so that no program is started.
    pub fn preventability(&self, episode: &Episode) -> Preventability {
        let again = self.repeating(episode);
        if episode.contact.is_none() {
            return Preventability::not_applicable(NotApplicable::NoContact);
        }
        let motion = motion_of(&mut again.bench(), episode).filter(|motion| !motion.is_empty());
        match (motion, self.replayer()) {
            (Some(motion), Some(mut replayer)) => replayer.assess(&motion, Some(&episode.trace)),
            _ => Preventability::not_applicable(NotApplicable::NotDriven),
        }
    }

    /// What a reference driver in the ego's place would have done: the recorded
    /// way up to the handover, its own from there on.
    ///
    /// `None`: the drivers do not apply to how the episode ended; the label of
    /// [`Scenario::preventability`] says why.
    pub fn filmed_driver(
        &self,
        episode: &Episode,
        driver: ReferenceDriver,
    ) -> Option<FilmedDriver> {
        episode.contact.as_ref()?;
        let mut bench = self.repeating(episode).bench();
        let motion = motion_of(&mut bench, episode).filter(|motion| !motion.is_empty())?;
        let mut filmed = self.replayer()?.film(&motion, driver)?;
        let mut frames = film(&mut bench, episode);
        frames.truncate(filmed.from);
        frames.append(&mut filmed.frames);
        filmed.frames = frames;
        Some(filmed)
    }
}
