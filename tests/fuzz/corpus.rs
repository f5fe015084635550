//! Files that are known to be good, to be spoilt.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

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

/// The text with the hash that it should hold, as far as it still has a place
/// for one: readers must not lean on the seal alone.
pub fn resealed(text: &str) -> String {
    let sealed = || {
        let field = text.find("sha256")?;
        let from = field + text[field..].find(':')?;
        let from = from + text[from..].find('"')? + 1;
        let hash = text.get(from..from + 64)?;
        hash.bytes().all(|c| c.is_ascii_hexdigit()).then_some(hash)
    };
    let Some(hash) = sealed() else {
        return text.to_owned();
    };
    let blank = text.replacen(hash, &"0".repeat(64), 1);
    let digest = Sha256::digest(blank.as_bytes());
    let digits: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    text.replacen(hash, &digits, 1)
}
