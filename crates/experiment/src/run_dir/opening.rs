//! Opening of a run directory, to read it or to continue its training.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use super::{Manifest, RunDir, RunError, StoredCount};
use crate::run_files::append_log::{Growing, Grown};
use crate::run_files::disk::{self, io_error, lock};
use crate::run_files::{COUNTEREXAMPLES, PROGRESS};

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
            fresh_egos: false,
            world: OnceLock::new(),
            progress: Growing::new(path.join(PROGRESS)),
            counterexamples: Growing::new(path.join(COUNTEREXAMPLES)),
            _lock: None,
        };
        run.manifest.files().verify(path)?;
        // Their content is checked too, since only later members have them, and the report
        // has no hash in the manifest.
        run.known_failures()?;
        run.report()?;
        Ok(run)
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
        // A finished run is complete: `open` refuses bytes beyond those of its manifest.
        if !run.manifest.is_finished() {
            let (progress, stored) = (path.join(PROGRESS), path.join(COUNTEREXAMPLES));
            run.progress = Growing::cut_back(progress, &run.manifest.progress)?;
            let known = run
                .manifest
                .counterexamples
                .as_ref()
                .map_or(Grown::default(), StoredCount::grown);
            run.counterexamples = Growing::cut_back(stored, &known)?;
        }
        Ok(run)
    }

    /// Resumes a run that was opened for reading only.
    ///
    /// # Errors
    ///
    /// Returns an error if it is damaged, or another process trains in it.
    pub fn hold(&mut self) -> Result<(), RunError> {
        // Neither is part of the files, so both survive the reopening here.
        if self._lock.is_none() {
            let (allowed, fresh) = (self.programs_allowed, self.fresh_egos);
            // Opened again under the lock, because another process may have trained
            // meanwhile.
            *self = RunDir::resume(&self.path.clone())?;
            self.programs_allowed = allowed;
            self.fresh_egos = fresh;
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
            // The training continues from the checkpoint that the manifest names.
            if is_checkpoint && current != Some(&name) {
                disk::remove(&entry.path()).map_err(&failed)?;
            }
        }
        Ok(())
    }
}
