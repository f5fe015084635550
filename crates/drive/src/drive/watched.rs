//! A world file that is loaded again when it is saved.

use std::path::PathBuf;

use crate::run_files::WatchedFiles;
use crate::world::Scenario;

/// World that was loaded again.
pub struct Reloaded {
    /// The world, or its problems in the words of `check`.
    pub world: Result<Scenario, String>,
    /// Its file, and the files that it includes.
    pub files: Vec<PathBuf>,
}

/// Loads the world again.
pub type Reload = Box<dyn Fn() -> Reloaded + Send>;

/// World file on the disk, with what is known of it.
pub struct WatchedWorld {
    files: WatchedFiles,
    reload: Reload,
}

impl WatchedWorld {
    /// Watches the files of a world that has just been loaded.
    pub fn new(files: Vec<PathBuf>, reload: Reload) -> WatchedWorld {
        let files = WatchedFiles::new(files);
        WatchedWorld { files, reload }
    }

    /// Returns the world or its problems, if a file was saved since the last call.
    pub(super) fn changed(&mut self) -> Option<Result<Scenario, String>> {
        if !self.files.changed() {
            return None;
        }
        let Reloaded { world, files } = (self.reload)();
        self.files.follow(files);
        Some(world)
    }
}
