//! Files that are known to be good, to be spoilt.

use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A good text: what of it may be changed, and what follows unchanged.
#[derive(Clone, Debug)]
pub struct Source {
    pub name: String,
    pub text: String,
    pub tail: String,
}

impl Source {
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Source {
        Source {
            name: name.into(),
            text: text.into(),
            tail: String::new(),
        }
    }

    /// Changes nothing from a mark on.
    pub fn before(mut self, mark: &str) -> Source {
        let at = self.text.find(mark).expect("the mark");
        self.tail = self.text.split_off(at);
        self
    }
}

pub type Corpus = Arc<[Source]>;

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The files of a directory with an extension, by name.
pub fn files(dir: &str, extension: &str) -> Vec<Source> {
    let entries = std::fs::read_dir(root().join(dir)).expect("a directory");
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == extension));
    paths.sort();
    let read = |path: PathBuf| {
        let name = path.file_name().expect("a name").to_string_lossy();
        Source::new(name, std::fs::read_to_string(&path).expect("a text"))
    };
    paths.into_iter().map(read).collect()
}

/// Every world there is.
pub fn worlds() -> Vec<Source> {
    [
        files("worlds", "ron"),
        files("tests/worlds/authored", "ron"),
    ]
    .concat()
}
