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

/// Looks at a missing file after which it is gone.
///
/// An editor may remove a file just before it writes the new one.
const GONE_LOOKS: u32 = 2;

/// World file on the disk, with what is known of it.
pub struct WatchedWorld {
    files: WatchedFiles,
    reload: Reload,
    /// Looks in a row at which a file was missing.
    missing_looks: u32,
}

impl WatchedWorld {
    /// Watches the files of a world that has just been loaded.
    pub fn new(files: Vec<PathBuf>, reload: Reload) -> WatchedWorld {
        let files = WatchedFiles::new(files);
        WatchedWorld {
            files,
            reload,
            missing_looks: 0,
        }
    }

    /// Returns the world or its problems, if a file was saved or is gone since the last call.
    pub(super) fn changed(&mut self) -> Option<Result<Scenario, String>> {
        let is_saved = self.files.changed();
        let missing = self.files.missing();
        if let Some(file) = missing.filter(|_| !is_saved) {
            self.missing_looks = self.missing_looks.saturating_add(1);
            // Exactly once, so that the message is not repeated at every look.
            let is_gone = self.missing_looks == GONE_LOOKS;
            return is_gone.then(|| Err(format!("the file is gone: {}", file.display())));
        }
        // A file may be put back as it was, which is no change of it.
        let is_back = self.missing_looks >= GONE_LOOKS;
        self.missing_looks = 0;
        if !is_saved && !is_back {
            return None;
        }
        let Reloaded { world, files } = (self.reload)();
        // The edit may include other files than before.
        self.files.follow(files);
        Some(world)
    }
}
