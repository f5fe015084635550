//! Copies of trained ados.

use std::path::Path;

use super::disk::{make_dir, write_file};
use super::manifest;
use super::{RunDir, RunError};

impl RunDir {
    /// Copies the files that playing the trained ado requires.
    ///
    /// These are the world, the manifest and the policy.
    ///
    /// # Errors
    ///
    /// Returns an error if training has not finished, a file is damaged or
    /// writing fails.
    pub fn copy_to(&self, path: &Path) -> Result<(), RunError> {
        make_dir(path)?;
        let policy = self.policy_bytes()?;
        let world = self.read_text("world.ron")?;
        write_file(&path.join("world.ron"), world.as_bytes())?;
        write_file(&path.join("policy.safetensors"), &policy)?;
        // The manifest is last: without it the directory is no run.
        for name in [manifest::TIMING, manifest::FILE] {
            if self.path.join(name).is_file() {
                write_file(&path.join(name), self.read_text(name)?.as_bytes())?;
            }
        }
        Ok(())
    }
}
