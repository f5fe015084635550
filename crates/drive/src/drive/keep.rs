//! A driven counterexample as a file that replays bit for bit.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::error::DriveError;
use super::session::DrivenEpisode;
use crate::crashes::{file_stem, labels_of_contact};
use crate::run_dir::{Counterexample, KeptError, make_dir};

impl DrivenEpisode {
    /// Writes the episode, if it is a counterexample, into a directory that is made for it.
    ///
    /// Your commands are those of its recorded ego.
    ///
    /// # Errors
    /// The episode is no counterexample, or the disk refuses.
    pub fn keep(&self, dir: &Path) -> Result<PathBuf, DriveError> {
        if !self.is_decided() {
            return Err(DriveError::Undecided);
        }
        let episode = self.episode();
        if !episode.verdict.is_success() {
            let verdict = episode.verdict.word().to_owned();
            return Err(DriveError::NoCounterexample { verdict });
        }
        let (ego, adversary) = (self.ego(), self.adversary());
        let world = ego.scenario();
        // Only the labels of this very run: no variation of your driving exists.
        let about = labels_of_contact(&world.repeating(&episode), &episode);
        let recorded = Counterexample::record(
            world,
            ego.name(),
            ego.change(),
            adversary.caption(),
            &episode,
        );
        let kept = Counterexample {
            about: Some(about),
            ..recorded
        };
        make_dir(dir).map_err(KeptError::from)?;
        // Two drives from one start differ in their actions and commands.
        let drive = json!([episode.start.0, episode.actions, kept.ego_commands]);
        let digest = crate::content_hash::fingerprint(&drive);
        // Eight digits tell the drives of one start apart and keep the name
        // short.
        let stem = format!("{}-{}", file_stem(world, ego.name(), 0, 0), &digest[..8]);
        Ok(kept.save_as(dir, &stem, &episode.trace)?)
    }
}
