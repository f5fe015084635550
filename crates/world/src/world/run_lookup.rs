//! Runs that world files refer to, found on the disk.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::{NamedRun, RunRefused, RunSource, Scenario};
use crate::ron_file::{LoadError, file_text};
use crate::run_files::disk::read_text;
use crate::run_files::{RunError, SealedFiles, WORLD};

/// Source of runs as directories.
///
/// It searches the working directory, then the directory of the world file.
#[derive(Clone, Copy, Debug)]
pub struct RunsOnDisk;

impl RunSource for RunsOnDisk {
    fn find(&self, name: &str, file: &str) -> Result<NamedRun, RunRefused> {
        let beside = Path::new(file).parent().map(|dir| dir.join(name));
        let places = [Some(PathBuf::from(name)), beside];
        let Some(dir) = places.into_iter().flatten().find(|place| place.is_dir()) else {
            return Err(RunRefused {
                what: format!("there is no run `{name}`"),
                help: "looked for from here and beside the world file; \
                       make one with `brakecheck train WORLD -o RUN`"
                    .to_owned(),
            });
        };
        match read(&dir) {
            Ok(Some(run)) => Ok(run),
            Ok(None) => Err(RunRefused {
                what: format!("the training in `{name}` has not finished"),
                help: "go on with `brakecheck train WORLD -o RUN --resume`".to_owned(),
            }),
            Err(error) => Err(refused(name, &error)),
        }
    }

    fn text(&self, name: &str, file: &str) -> Result<String, RunRefused> {
        let path = included_path(name, file);
        file_text(&path).map_err(|error| RunRefused {
            what: format!("cannot read `{name}`: {error}"),
            help: "files are looked for from here and beside the world file".to_owned(),
        })
    }
}

/// Returns the path of a file that a world file includes.
fn included_path(name: &str, file: &str) -> PathBuf {
    let own = PathBuf::from(name);
    let beside = Path::new(file).parent().map(|dir| dir.join(name));
    // Without either, the error is that of the name as it is written.
    match beside {
        Some(beside) if !own.exists() && beside.exists() => beside,
        _ => own,
    }
}

/// Runs and files on the disk, with a list of the files that were read.
#[derive(Debug, Default)]
pub struct ListedFiles {
    read: Mutex<Vec<PathBuf>>,
}

impl ListedFiles {
    /// Returns the files that worlds have included so far, also those that are missing.
    pub fn read(&self) -> Vec<PathBuf> {
        // A list stays valid if another thread panicked.
        self.read
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

impl RunSource for ListedFiles {
    fn find(&self, name: &str, file: &str) -> Result<NamedRun, RunRefused> {
        RunsOnDisk.find(name, file)
    }

    fn text(&self, name: &str, file: &str) -> Result<String, RunRefused> {
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        // Before it is read, so that a missing file is listed as well.
        read.push(included_path(name, file));
        RunsOnDisk.text(name, file)
    }
}

/// Returns a verified run. `None` while its training goes on.
fn read(dir: &Path) -> Result<Option<NamedRun>, RunError> {
    let Some(policy) = SealedFiles::open(dir)?.policy_bytes(dir)? else {
        return Ok(None);
    };
    // A directory may have several names.
    let canonical = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    Ok(Some(NamedRun {
        identity: canonical.display().to_string(),
        policy,
        world: read_text(&dir.join(WORLD))?,
    }))
}

/// Error in terms of a world file, with the run's name there.
fn refused(name: &str, error: &RunError) -> RunRefused {
    let what = match error {
        RunError::NotARun { why, .. } => format!("`{name}` is no run directory: {why}"),
        RunError::Damaged { path, why } => {
            let file = path.file_name().unwrap_or_default().display();
            format!("`{file}` of the run `{name}` is damaged: {why}")
        }
        other => format!("the run `{name}` cannot be read: {other}"),
    };
    RunRefused {
        what,
        help: error.help().unwrap_or_default(),
    }
}

impl Scenario {
    /// Reads and checks a world file.
    ///
    /// Runs that it refers to are searched in the working directory and beside
    /// the file.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, or is not a valid world.
    pub fn load(path: &Path) -> Result<Scenario, LoadError> {
        Scenario::load_with(path, &RunsOnDisk)
    }
}
