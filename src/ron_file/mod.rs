//! RON files that users write: read, with the place and the fix of each mistake.
//!
//! Architecture Invariant: nothing here knows what a file describes.

mod error;
mod locate;
mod named_file;
mod ordered;
mod problems;
pub(crate) mod read;

pub use error::{LoadError, Problem, ScenarioError};
pub(crate) use error::{did_you_mean, guessed, known_names};
pub(crate) use locate::{ValuePath, first_word};
pub(crate) use named_file::{file_bytes, file_text, open_file};
pub(crate) use ordered::Ordered;
pub use ordered::Patch;
pub(crate) use problems::Problems;
pub(crate) use read::{parse as parse_ron, read_file};
