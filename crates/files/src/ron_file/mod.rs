//! RON files that users write: read, with the place and the fix of each mistake.
//!
//! Architecture Invariant: nothing here knows what a file describes.

mod error;
mod locate;
mod named_file;
mod ordered;
mod problems;
pub mod read;
mod respelled;
mod short_or_long;

pub use error::{LoadError, Problem, ScenarioError};
pub use error::{did_you_mean, guessed, known_names};
pub use locate::{ValuePath, first_word};
pub use named_file::{file_bytes, file_text, open_file};
pub use ordered::Ordered;
pub use ordered::Patch;
pub use problems::Problems;
pub use read::{parse as parse_ron, read_file};
pub use respelled::Respelled;
pub use short_or_long::short_or_long;
