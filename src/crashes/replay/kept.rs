//! A kept counterexample and its file.

use std::path::PathBuf;

use crate::crashes::save_crashes::about;
use crate::run_dir::{About, Counterexample, KeptError};
use crate::testbench::Episode;
use crate::world::Scenario;

/// A counterexample and the file it was kept in.
#[derive(Clone, Debug)]
pub struct Kept {
    /// Where it lies.
    pub path: PathBuf,
    /// World, start, actions and verdict, as they were read.
    pub counterexample: Counterexample,
}

impl Kept {
    /// Writes it again as this version does, with its hash; `episode` must be the
    /// one it holds.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn seal(&self, episode: &Episode) -> Result<(), KeptError> {
        let current = self.counterexample.as_now(&episode.trace);
        current.save(&self.path, &episode.trace)
    }

    /// Finds out what is to be said of it and writes it again with that, and its
    /// hash; `episode` must be the one it holds. The ego of `scenario` is asked.
    ///
    /// Its actions stay as they are; what earlier labels say of shrinking and of
    /// others like it stays, too.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn refine(&self, scenario: &Scenario, episode: &Episode) -> Result<About, KeptError> {
        let before = self.counterexample.about.clone().unwrap_or_default();
        let found = about(scenario, episode);
        let mut refined = About {
            shrunk: before.shrunk,
            cluster: before.cluster,
            ..found
        };
        // Without the ego itself, the answers that it gave earlier stay.
        if scenario.drive().is_some_and(|spec| spec.ego.is_recorded()) {
            refined.persistence = before.persistence;
            refined.ego_runs = before.ego_runs;
            if let (Some(why), Some(was)) = (&mut refined.why, before.why) {
                why.decisive = was.decisive;
                why.not_asked = was.not_asked;
            }
        }
        let current = Counterexample {
            about: Some(refined.clone()),
            contact: episode.contact.clone(),
            ..self.counterexample.as_now(&episode.trace)
        };
        current.save(&self.path, &episode.trace)?;
        Ok(refined)
    }
}
