//! Taking a trained ado elsewhere.

use std::path::Path;

use super::disk::{make_dir, write_file};
use super::manifest;
use super::{RunDir, RunError};

impl RunDir {
    /// Copies what it takes to play the trained ado: world, manifest, policy.
    ///
    /// # Errors
    /// It has not finished, is damaged, or the disk refuses.
    pub fn copy_to(&self, path: &Path) -> Result<(), RunError> {
        make_dir(path)?;
        let policy = self.policy_bytes()?;
        let world = self.read_text("world.ron")?;
        write_file(&path.join("world.ron"), world.as_bytes())?;
        write_file(&path.join("policy.safetensors"), &policy)?;
        for name in [manifest::TIMING, manifest::FILE] {
            if self.path.join(name).is_file() {
                write_file(&path.join(name), self.read_text(name)?.as_bytes())?;
            }
        }
        Ok(())
    }
}
