//! Opening of a run directory, to read it or to continue its training.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use super::append_log::{Growing, Grown, verified};
use super::disk::{self, io_error, lock};
use super::{
    BANK, Manifest, RunDir, RunError, StoredCount, failure_cell, progress, training_counterexamples,
};

impl RunDir {
    /// Opens a run directory for reading and verifies its hashes.
    ///
    /// # Errors
    ///
    /// Returns an error if it is not a run, or a file is damaged.
    pub fn open(path: &Path) -> Result<RunDir, RunError> {
        let manifest = Manifest::read(path)?;
        let run = RunDir {
            path: path.into(),
            manifest,
            programs_allowed: false,
            world: OnceLock::new(),
            progress: Growing::new(path.join(progress::FILE)),
            counterexamples: Growing::new(path.join(training_counterexamples::FILE)),
            _lock: None,
        };
        run.verify()?;
        Ok(run)
    }

    /// Verifies every file with a hash in the manifest.
    ///
    /// Results that are computed later then rest on the written data. The
    /// checkpoint is verified when training continues, since another process
    /// may be replacing it.
    fn verify(&self) -> Result<(), RunError> {
        let manifest = &self.manifest;
        self.read_verified("world.ron", Some(&manifest.world_sha256))?;
        if let Some(from) = &manifest.from_sha256 {
            self.read_verified("from.safetensors", Some(from))?;
        }
        if let Some(bank) = &manifest.bank_sha256 {
            self.read_verified(BANK, Some(bank))?;
        }
        if self.path.join(failure_cell::KNOWN).exists() {
            self.known_failures()?;
        }
        if let Some(policy) = &manifest.policy_sha256 {
            self.read_verified("policy.safetensors", Some(policy))?;
        }
        let stored = manifest.counterexamples.as_ref();
        let files = [
            (progress::FILE, Some(manifest.progress.clone())),
            (
                training_counterexamples::FILE,
                stored.map(StoredCount::grown),
            ),
        ];
        for (name, known) in files {
            let path = self.path.join(name);
            // A copy of a trained ado has neither file.
            if let (Some(known), true) = (known, path.exists()) {
                verified(&path, &known, manifest.is_finished())?;
            }
        }
        Ok(())
    }

    /// Opens a run directory to continue its training from the last checkpoint.
    ///
    /// Later content is removed.
    ///
    /// # Errors
    ///
    /// Returns an error if it is not a run, is damaged, or another process
    /// trains in it.
    pub fn resume(path: &Path) -> Result<RunDir, RunError> {
        // Without a run, no lock file is made. The manifest is read again under
        // the lock.
        Manifest::read(path)?;
        let lock = lock(path)?;
        let mut run = RunDir::open(path)?;
        run._lock = Some(lock);
        run.sweep()?;
        if !run.manifest.is_finished() {
            let (progress, stored) = (
                path.join(progress::FILE),
                path.join(training_counterexamples::FILE),
            );
            run.progress = Growing::cut_back(progress, &run.manifest.progress)?;
            let known = run.manifest.counterexamples.as_ref();
            let known = known.map_or(Grown::default(), StoredCount::grown);
            run.counterexamples = Growing::cut_back(stored, &known)?;
        }
        Ok(run)
    }

    /// Resumes a run that was opened for reading only.
    ///
    /// # Errors
    ///
    /// Returns an error if it is damaged, or another process trains in it.
    pub(crate) fn hold(&mut self) -> Result<(), RunError> {
        // The consent is not part of the files, so it survives the reopening
        // here.
        if self._lock.is_none() {
            let allowed = self.programs_allowed;
            *self = RunDir::resume(&self.path.clone())?;
            self.programs_allowed = allowed;
        }
        Ok(())
    }

    /// Removes leftovers of a killed training.
    ///
    /// These are incomplete files, and checkpoints that the manifest does not
    /// name.
    fn sweep(&self) -> Result<(), RunError> {
        let failed = io_error("removing", &self.path);
        disk::sweep(&self.path);
        let current = self.manifest.checkpoint.as_ref().map(|(name, _)| name);
        for entry in fs::read_dir(&self.path).map_err(&failed)?.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_checkpoint = name.starts_with("checkpoint-") && name.ends_with(".safetensors");
            if is_checkpoint && current != Some(&name) {
                disk::remove(&entry.path()).map_err(&failed)?;
            }
        }
        Ok(())
    }
}
