//! A kept counterexample and its file.

use std::path::PathBuf;

use crate::run::{Counterexample, KeptError};
use crate::testbench::Episode;

/// A counterexample and the file it was kept in.
#[derive(Clone, Debug)]
pub struct Kept {
    /// The file.
    pub path: PathBuf,
    /// What is in it.
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
}
