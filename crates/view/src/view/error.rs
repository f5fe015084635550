//! Errors of recordings.

use std::path::PathBuf;

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
    /// Stream whose reader is gone: a viewer that was closed.
    #[error("the viewer was closed")]
    Closed,
    /// Panic of the viewer's library.
    #[error("the viewer's library failed")]
    Broken,
    /// Reader that does not read the stream.
    #[error("the viewer did not read the end of the stream")]
    Stuck,
    /// Failure to write a stream.
    #[error("the stream cannot be written: {source}")]
    Stream {
        /// Underlying error.
        source: std::io::Error,
    },
    /// Absence of a viewer to connect to.
    #[error("no viewer answers at `{address}`")]
    NoViewer {
        /// Address that was tried.
        address: String,
    },
    /// Rejection of a value by the viewer's library.
    #[error("the recording could not be assembled: {0}")]
    Value(#[from] re_sdk_types::SerializationError),
    /// Rejection of rows by the viewer's library.
    #[error("the recording could not be assembled: {0}")]
    Rows(#[from] re_chunk::ChunkError),
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
            ViewError::Stuck => "the file or the viewer lacks the last episodes",
            ViewError::Closed => "open it again for the next command",
            ViewError::Stream { .. } => "check the free space, and that the file can be written",
            ViewError::NoViewer { .. } => "start it first: `rerun`",
            ViewError::Broken
            | ViewError::Value(_)
            | ViewError::Rows(_)
            | ViewError::Encode { .. } => {
                "this is a fault of the program; the episode itself is fine"
            }
        }
    }
}
