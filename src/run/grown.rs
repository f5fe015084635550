//! Files that only grow: what counts of them is what the manifest says.
//!
//! Every checkpoint notes how many bytes of such a file it knows and their
//! SHA-256, so the checkpoints chain: each vouches for all that stands before
//! it. What was written after the last one is cut off when training goes on,
//! torn or not, and is then written again, byte for byte.

use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::RunError;
use super::disk::{append, cut, io_error};
use super::manifest::Grown;
use crate::scenario::file_bytes;
use crate::seal::in_digits;

/// A file that only grows, hashed as it does.
#[derive(Clone, Debug)]
pub(super) struct Growing {
    path: PathBuf,
    bytes: u64,
    hash: Sha256,
}

impl Growing {
    /// One that is not there yet.
    pub fn new(path: PathBuf) -> Growing {
        Growing {
            path,
            bytes: 0,
            hash: Sha256::new(),
        }
    }

    /// One that counts as far as `known`: what stands behind is cut off.
    ///
    /// # Errors
    /// The disk refuses, or what must be there is not.
    pub fn cut_back(path: PathBuf, known: &Grown) -> Result<Growing, RunError> {
        let Counting { text, hash } = counting(&path, known)?;
        if known.bytes < text.len() as u64 {
            cut(&path, known.bytes)?;
        }
        Ok(Growing {
            path,
            bytes: known.bytes,
            hash,
        })
    }

    /// Adds to its end; it counts once a manifest says so.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn append(&mut self, text: &str) -> Result<(), RunError> {
        append(&self.path, text.as_bytes())?;
        self.bytes += text.len() as u64;
        self.hash.update(text);
        Ok(())
    }

    /// What a manifest says of it now.
    pub fn now(&self) -> Grown {
        Grown {
            bytes: self.bytes,
            sha256: in_digits(&self.hash.clone().finalize()),
        }
    }
}

/// A file that only grows, and the hash of what counts of it.
struct Counting {
    text: Vec<u8>,
    hash: Sha256,
}

/// What a file holds whose first bytes are as `known` says.
fn counting(path: &Path, known: &Grown) -> Result<Counting, RunError> {
    let text = match file_bytes(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        read => read.map_err(io_error("reading", path))?,
    };
    let damaged = |why: String| RunError::Damaged {
        path: path.into(),
        why,
    };
    let Some(counts) = text.get(..known.bytes as usize) else {
        let (found, known) = (text.len(), known.bytes);
        return Err(damaged(format!(
            "it has {found} bytes, the manifest says at least {known}"
        )));
    };
    let hash = Sha256::new_with_prefix(counts);
    let found = in_digits(&hash.clone().finalize());
    if 0 < known.bytes && found != known.sha256 {
        return Err(damaged(format!(
            "SHA-256 of its first {} bytes is {found}, the manifest says {}",
            known.bytes, known.sha256
        )));
    }
    Ok(Counting { text, hash })
}

/// What counts of a file that only grows.
///
/// `is_whole` says that nothing may stand behind it: nobody goes on writing.
///
/// # Errors
/// The disk refuses, or the file is not what the manifest says.
pub(super) fn verified(path: &Path, known: &Grown, is_whole: bool) -> Result<Vec<u8>, RunError> {
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
