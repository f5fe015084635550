//! Files on the disk that are watched for changes.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Time and size of a file, which change when it is saved.
type Stamp = (SystemTime, u64);

/// Files whose changes are noticed when asked for.
#[derive(Clone, Debug, Default)]
pub struct WatchedFiles {
    files: Vec<(PathBuf, Option<Stamp>)>,
}

impl WatchedFiles {
    /// Watches files as they are now.
    pub fn new(files: impl IntoIterator<Item = PathBuf>) -> WatchedFiles {
        let watched = |file: PathBuf| {
            let stamp = stamp_of(&file);
            (file, stamp)
        };
        WatchedFiles {
            files: files.into_iter().map(watched).collect(),
        }
    }

    /// Watches these files from now on, those that were watched before without a gap.
    pub fn follow(&mut self, files: impl IntoIterator<Item = PathBuf>) {
        let before = std::mem::take(self);
        let mut followed = WatchedFiles::new(files);
        for (file, seen) in &mut followed.files {
            // A file may be saved while it is read, which its former stamp shows.
            if let Some((_, stamp)) = before.files.iter().find(|(known, _)| known == file) {
                *seen = *stamp;
            }
        }
        *self = followed;
    }

    /// Returns whether a file was saved since the last call.
    pub fn changed(&mut self) -> bool {
        let mut is_changed = false;
        for (file, seen) in &mut self.files {
            let now = stamp_of(file);
            // An editor may remove the file before it writes the new one.
            if now.is_some() && now != *seen {
                *seen = now;
                is_changed = true;
            }
        }
        is_changed
    }

    /// Returns the first file that was there and is missing now.
    pub fn missing(&self) -> Option<&Path> {
        let mut files = self.files.iter();
        let missing = files.find(|(file, seen)| seen.is_some() && stamp_of(file).is_none());
        missing.map(|(file, _)| file.as_path())
    }
}

fn stamp_of(file: &Path) -> Option<Stamp> {
    let about = std::fs::metadata(file).ok()?;
    Some((about.modified().ok()?, about.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saved_file_is_a_change_once_and_a_removed_one_is_none() {
        let scratch = tempfile::tempdir().expect("a directory");
        let [first, second] = ["a", "b"].map(|name| scratch.path().join(name));
        std::fs::write(&first, "1").expect("written");
        let mut watched = WatchedFiles::new([first.clone(), second.clone()]);
        assert!(!watched.changed());
        std::fs::write(&first, "12").expect("written");
        assert!(watched.changed() && !watched.changed());
        // A file that never was is not missing.
        assert_eq!(watched.missing(), None);
        std::fs::remove_file(&first).expect("removed");
        assert!(!watched.changed());
        assert_eq!(watched.missing(), Some(first.as_path()));
        std::fs::write(&second, "").expect("written");
        assert!(watched.changed() && !watched.changed());
        std::fs::write(&second, "between").expect("written");
        watched.follow([second]);
        assert!(watched.changed() && !watched.changed());
    }
}
