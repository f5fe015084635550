//! Why a recording could not be made.

use std::path::PathBuf;

use rerun::RecordingStreamError;

/// A recording could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The output could not be written.
    #[error("cannot write `{}`: {source}", path.display())]
    Write {
        /// The refused path.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The viewer's library refused the data.
    #[error("the recording could not be assembled: {0}")]
    Sdk(#[from] RecordingStreamError),
    /// The viewer's library could not encode the data.
    #[error("the recording could not be encoded: {what}")]
    Encode {
        /// What it said.
        what: String,
    },
}

impl ViewError {
    /// What to do about it.
    pub fn help(&self) -> &'static str {
        match self {
            ViewError::Write { .. } => {
                "name a file in a directory that exists and can be written, e.g. `-o crash.rrd`"
            }
            ViewError::Sdk(_) | ViewError::Encode { .. } => {
                "this is a fault of the program; the episode itself is fine"
            }
        }
    }
}
