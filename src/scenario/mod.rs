//! From a RON world file to a checked [`Scenario`].
//!
//! Architecture Invariant: after a `Scenario` is loaded no user mistake is
//! possible in it; every mistake before has a place, a reason and, where known,
//! a cure ([`ScenarioError`]). All spans, helps and limits live on this floor.
//!
//! ```
//! use brakecheck::scenario::Scenario;
//!
//! let broken = Scenario::parse("mine.ron", "Scenario(name: \"mine\", clok: ())");
//! let error = broken.unwrap_err();
//! assert!(error.to_string().starts_with("mine.ron:1:"));
//! ```

mod build;
mod cast;
mod changed;
mod check;
mod counting;
mod error;
mod family;
mod file;
mod grid;
mod kinship;
mod language;
mod limits;
mod locate;
mod named_file;
mod ordered;
mod plans;
mod points;
mod preventing;
mod problems;
mod quantity;
mod read;
mod repeats;
mod roads;
mod runs;
mod shipped;
mod starts;
mod structure;
mod trained;
mod trial;
mod vacuous;
mod variants;
mod warnings;
mod world;

use std::path::Path as FilePath;

use serde::de::DeserializeOwned;

pub use error::{LoadError, Problem, ScenarioError};
pub(crate) use error::{guessed, known_names};
pub use family::{Against, Family, Member, MisfitMember, NoMember};
pub use file::{Change, GridChange};
pub use locate::Path;
pub(crate) use named_file::{file_bytes, file_text};
pub(crate) use ordered::Ordered;
pub use ordered::Patch;
pub use quantity::{Quantity, Varied};
pub use repeats::Repeats;
pub use runs::{NamedRun, RunRefused, RunSource};
pub use structure::Structure;
pub use world::{ChangeError, RuleSpec, Scenario};

/// A RON file that is no world: its name, its text and what it holds.
///
/// # Errors
/// It cannot be read, or holds something else.
pub(crate) fn read_file<T: DeserializeOwned>(
    path: &FilePath,
) -> Result<(String, String, T), LoadError> {
    let file = path.display().to_string();
    let text = read::text(&file, path)?;
    let text = read::without_mark(&text).to_owned();
    match read::parse(&text) {
        Ok(value) => Ok((file, text, value)),
        Err(problem) => Err(LoadError::Scenario(Box::new(ScenarioError {
            file,
            text,
            problems: vec![problem],
        }))),
    }
}

impl Scenario {
    /// Reads and checks a world file; `runs` finds the runs that it names.
    ///
    /// # Errors
    /// The file cannot be read, or it is not a world.
    pub fn load_with(path: &FilePath, runs: &dyn RunSource) -> Result<Scenario, LoadError> {
        let file = path.display().to_string();
        let text = read::text(&file, path)?;
        Scenario::parse_with(&file, &text, runs)
            .map_err(|error| LoadError::Scenario(Box::new(error)))
    }

    /// Checks the text of a world file; `file` names it in errors.
    ///
    /// Nothing is read: a text that names a run directory is refused.
    ///
    /// # Errors
    /// What is wrong, where, and how to cure it.
    pub fn parse(file: &str, text: &str) -> Result<Scenario, ScenarioError> {
        Scenario::parse_with(file, text, &runs::Nowhere)
    }

    /// The same of a text whose runs `runs` finds.
    ///
    /// # Errors
    /// What is wrong, where, and how to cure it.
    pub fn parse_with(
        file: &str,
        text: &str,
        runs: &dyn RunSource,
    ) -> Result<Scenario, ScenarioError> {
        let text = read::without_mark(text);
        let fail = |problems| ScenarioError {
            file: file.to_owned(),
            text: text.to_owned(),
            problems,
        };
        let one = |problem| fail(vec![problem]);
        match read::kind(text).map_err(one)? {
            read::Kind::Scenario => {
                let parsed = read::parse(text).map_err(one)?;
                build::build(file, runs, text, parsed).map_err(fail)
            }
            read::Kind::Grid => {
                let parsed = read::parse(text).map_err(one)?;
                grid::build(text, parsed).map_err(fail)
            }
        }
    }
}
