//! Worlds as they are named: a file, a shipped world, or `-` for standard input.

use std::path::{Path, PathBuf};

use super::input;
use crate::ron_file::LoadError;
use crate::world::{ListedFiles, Scenario};

/// World that was read, with its files.
pub(super) struct ReadWorld {
    pub(super) world: Result<Scenario, LoadError>,
    /// Its file, if it has one, and the files that it includes.
    pub(super) files: Vec<PathBuf>,
}

/// Reads a world.
pub(super) fn read(path: &Path) -> ReadWorld {
    // A file of that name takes precedence over a shipped world.
    let is_shipped = path.to_str().and_then(Scenario::shipped_text).is_some();
    if is_shipped && !path.exists() {
        return ReadWorld {
            world: Scenario::find(path),
            files: Vec::new(),
        };
    }
    // Reading notes the included files, because only the reader knows them.
    let listed = ListedFiles::default();
    let world = if input::is_stdin(path) {
        of_stdin(path, &listed)
    } else {
        Scenario::load_with(path, &listed)
    };
    // Standard input is no file that can be watched or read again.
    let own = (!input::is_stdin(path)).then(|| path.to_owned());
    let files = own.into_iter().chain(listed.read()).collect();
    ReadWorld { world, files }
}

fn of_stdin(path: &Path, listed: &ListedFiles) -> Result<Scenario, LoadError> {
    let file = "standard input".to_owned();
    match input::text(path) {
        Ok(text) => Scenario::parse_with(&file, &text, listed)
            .map_err(|error| LoadError::Scenario(Box::new(error))),
        Err(source) => Err(LoadError::Io { file, source }),
    }
}
