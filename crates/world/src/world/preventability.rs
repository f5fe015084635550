//! Preventability of the contacts of an episode by reference drivers.

use std::sync::Arc;

use super::Scenario;
use crate::ego::reference::ReferenceDriver;
use crate::preventability::{
    BrakingReplays, FilmedDriver, NotApplicable, Preventability, Replayer,
};
use crate::testbench::{Episode, film, motion_of};

impl Scenario {
    /// Returns a replayer of recorded motions with reference drivers as the ego.
    ///
    /// `None` for a world without driving.
    pub fn replayer(&self) -> Option<Replayer> {
        Replayer::new(self.drive()?.world(), Arc::clone(&self.rulebook))
    }

    /// Returns the reference drivers that avoid an episode's contact.
    ///
    /// The episode is replayed to obtain the motions of all agents. Commands of
    /// an external ego are repeated, so no program is started.
    pub fn preventability(&self, episode: &Episode) -> Preventability {
        let again = self.repeating(episode);
        if episode.contact.is_none() {
            return Preventability::not_applicable(NotApplicable::NoContact);
        }
        // A replay without motion has no moment at which a driver could take
        // over.
        let motion = motion_of(&mut again.bench(), episode).filter(|motion| !motion.is_empty());
        match (motion, self.replayer()) {
            (Some(motion), Some(mut replayer)) => replayer.assess(&motion, Some(&episode.trace)),
            _ => Preventability::not_applicable(NotApplicable::NotDriven),
        }
    }

    /// Returns whether any of some reference drivers avoids an episode's contact.
    ///
    /// This takes few of the replays of [`Scenario::preventability`]. `None`: there is no
    /// contact, or the drivers do not apply to it.
    pub fn is_avoided_by_any(
        &self,
        episode: &Episode,
        drivers: &[ReferenceDriver],
    ) -> Option<bool> {
        episode.contact.as_ref()?;
        let mut replayer = self.replayer()?;
        let motion = motion_of(&mut self.repeating(episode).bench(), episode)?;
        if motion.is_empty() {
            return None;
        }
        replayer.is_avoided_by_any(&motion, drivers)
    }

    /// Returns replays of an episode's motion with full braking in the ego's place.
    ///
    /// `None` without a contact of the ego, or if the motion cannot be replayed.
    pub fn braking_replays(&self, episode: &Episode) -> Option<BrakingReplays> {
        episode.contact.as_ref()?;
        let mut bench = self.repeating(episode).bench();
        let motion = motion_of(&mut bench, episode).filter(|motion| !motion.is_empty())?;
        self.replayer()?.braking(&motion)
    }

    /// Returns the drive of a reference driver in the ego's place.
    ///
    /// It has the recorded path up to the handover, and the driver's own path
    /// afterwards.
    ///
    /// `None` if the drivers do not apply to the end of the episode. The label
    /// of [`Scenario::preventability`] then states the reason.
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
        // The frames up to the handover are those of the recorded ego.
        frames.truncate(filmed.from);
        frames.append(&mut filmed.frames);
        filmed.frames = frames;
        Some(filmed)
    }
}
