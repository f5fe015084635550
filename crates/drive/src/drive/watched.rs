//! A world file that is loaded again when it is saved.

use std::path::PathBuf;
use std::time::SystemTime;

use crate::world::Scenario;

/// Loads the world again, or returns the problems in the words of `check`.
pub type Reload = Box<dyn Fn() -> Result<Scenario, String> + Send>;

/// World file on the disk, with what is known of it.
pub struct WatchedWorld {
    path: PathBuf,
    reload: Reload,
    seen: Option<SystemTime>,
}

impl WatchedWorld {
    /// Watches a file that has just been loaded.
    pub fn new(path: PathBuf, reload: Reload) -> WatchedWorld {
        let seen = modified(&path);
        WatchedWorld { path, reload, seen }
    }

    /// Returns the world or its problems, if the file was saved since the last call.
    pub(super) fn changed(&mut self) -> Option<Result<Scenario, String>> {
        let now = modified(&self.path);
        // An editor may remove the file before it writes the new one.
        if now.is_none() || now == self.seen {
            return None;
        }
        self.seen = now;
        Some((self.reload)())
    }
}

fn modified(path: &PathBuf) -> Option<SystemTime> {
    std::fs::metadata(path).and_then(|it| it.modified()).ok()
}
