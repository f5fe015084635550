//! Growing files, of which the manifest states the valid length.
//!
//! Every checkpoint records the number of bytes and their SHA-256. So each
//! checkpoint confirms all bytes of the earlier checkpoints. Bytes after the
//! last checkpoint are cut off when training continues, and are then written
//! again, byte for byte.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::RunError;
use super::disk::{append, cut, io_error};
use crate::content_hash::in_digits;
use crate::ron_file::file_bytes;

/// Valid part of a growing file, as of the last checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grown {
    /// Number of valid bytes. Later bytes were written after the checkpoint.
    pub bytes: u64,
    /// SHA-256 of these bytes.
    pub sha256: String,
}

impl Grown {
    /// Returns whether no byte is valid yet.
    pub fn is_nothing(&self) -> bool {
        self.bytes == 0
    }
}

/// Growing file, hashed as it grows.
#[derive(Clone, Debug)]
pub struct Growing {
    path: PathBuf,
    bytes: u64,
    hash: Sha256,
}

impl Growing {
    /// Returns a file that does not exist yet.
    pub fn new(path: PathBuf) -> Growing {
        Growing {
            path,
            bytes: 0,
            hash: Sha256::new(),
        }
    }

    /// Returns a file that is valid as far as `known`, and cuts off the rest.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses, or valid bytes are missing.
    pub fn cut_back(path: PathBuf, known: &Grown) -> Result<Growing, RunError> {
        let Counting { text, hash } = counting(&path, known)?;
        // Only if needed, since each cut is a change of the disk.
        if known.bytes < text.len() as u64 {
            cut(&path, known.bytes)?;
        }
        Ok(Growing {
            path,
            bytes: known.bytes,
            hash,
        })
    }

    /// Appends text, which is valid once a manifest records it.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses.
    pub fn append(&mut self, text: &str) -> Result<(), RunError> {
        // Before the count: bytes that may be missing must not be recorded.
        append(&self.path, text.as_bytes())?;
        self.bytes += text.len() as u64;
        self.hash.update(text);
        Ok(())
    }

    /// Returns the entry of the manifest for the current state.
    pub fn now(&self) -> Grown {
        Grown {
            bytes: self.bytes,
            // A copy, because hashing goes on with the next line.
            sha256: in_digits(&self.hash.clone().finalize()),
        }
    }
}

/// Content of a growing file, and the hash of its valid part.
struct Counting {
    text: Vec<u8>,
    hash: Sha256,
}

/// Returns the content of a file whose first bytes agree with `known`.
fn counting(path: &Path, known: &Grown) -> Result<Counting, RunError> {
    let text = match file_bytes(path) {
        // A training without any line has no file yet.
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        read => read.map_err(io_error("reading", path))?,
    };
    let damaged = |why: String| RunError::Damaged {
        path: path.into(),
        why,
    };
    // A manifest may state any number, and a slice beyond the end would panic.
    let Some(counts) = text.get(..known.bytes as usize) else {
        let (found, known) = (text.len(), known.bytes);
        return Err(damaged(format!(
            "it has {found} bytes, the manifest says at least {known}"
        )));
    };
    let hash = Sha256::new_with_prefix(counts);
    let found = in_digits(&hash.clone().finalize());
    // Manifests of files without content have no hash.
    if known.bytes > 0 && found != known.sha256 {
        return Err(damaged(format!(
            "SHA-256 of its first {} bytes is {found}, the manifest says {}",
            known.bytes, known.sha256
        )));
    }
    Ok(Counting { text, hash })
}

/// Returns the valid part of a growing file.
///
/// With `is_whole`, no bytes may follow, because the training is finished.
///
/// # Errors
///
/// Returns an error if the disk refuses, or the file differs from the manifest.
pub fn verified(path: &Path, known: &Grown, is_whole: bool) -> Result<Vec<u8>, RunError> {
    let Counting { mut text, .. } = counting(path, known)?;
    if is_whole && known.bytes < text.len() as u64 {
        return Err(RunError::Damaged {
            path: path.into(),
            why: format!(
                "it has {} bytes, the manifest says {}",
                text.len(),
                known.bytes
            ),
        });
    }
    text.truncate(known.bytes as usize);
    Ok(text)
}
