//! Kept counterexample with its file.

use std::path::PathBuf;

use crate::crashes::save_crashes::about;
use crate::run_dir::{About, Counterexample, KeptError};
use crate::testbench::Episode;
use crate::world::Scenario;

/// Counterexample with the file that holds it.
#[derive(Clone, Debug)]
pub struct SavedCounterexample {
    /// Path of the file.
    pub path: PathBuf,
    /// World, start, actions and verdict, as read.
    pub counterexample: Counterexample,
}

impl SavedCounterexample {
    /// Determines the labels again and writes the file with them and its hash.
    ///
    /// `episode` must be the recorded episode. The ego of `scenario` is run.
    /// The actions stay unchanged, as do the earlier labels of minimization and cluster.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn refine(&self, scenario: &Scenario, episode: &Episode) -> Result<About, KeptError> {
        let before = self.counterexample.about.clone().unwrap_or_default();
        let found = about(scenario, episode);
        let mut refined = About {
            shrunk: before.shrunk,
            cluster: before.cluster,
            ..found
        };
        // A recorded ego cannot answer new questions, so its earlier answers stay.
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
