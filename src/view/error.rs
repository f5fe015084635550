//! Errors of recordings.

use std::path::PathBuf;

use rerun::RecordingStreamError;

/// Failure to make a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// Failure to write the output.
    #[error("cannot write `{}`: {source}", path.display())]
    Write {
        /// Rejected path.
        path: PathBuf,
        /// Underlying error.
        source: std::io::Error,
    },
    /// Rejection of the data by the viewer's library.
    #[error("the recording could not be assembled: {0}")]
    Sdk(#[from] RecordingStreamError),
    /// Failure of the viewer's library to encode the data.
    #[error("the recording could not be encoded: {what}")]
    Encode {
        /// Message of the library.
        what: String,
    },
}

impl ViewError {
    /// Returns advice for the user.
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
