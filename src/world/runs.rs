//! Runs that a world file names, as this floor knows them: found by others.

use super::error::Problem;
use crate::scene::World;

/// A finished run: what of it a world needs that names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedRun {
    /// The same for the same run, whatever name it was found by.
    pub identity: String,
    /// Its world file, verbatim.
    pub world: String,
    /// Its policy: the bytes of a safetensors file.
    pub policy: Vec<u8>,
}

/// A run cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct RunRefused {
    /// Why the run cannot be used, in a sentence.
    pub what: String,
    /// What the author of the world can do about it.
    pub help: String,
}

pub(super) fn refused(what: String, help: &str) -> RunRefused {
    RunRefused {
        what,
        help: help.to_owned(),
    }
}

/// Finds runs by the names that world files give them.
///
/// Nothing on this floor opens a run directory; `run_dir::RunsOnDisk` does.
pub trait RunSource {
    /// The finished run that is called `name` in the world file `file`.
    ///
    /// # Errors
    /// There is none, it is not finished, or it is damaged.
    fn find(&self, name: &str, file: &str) -> Result<NamedRun, RunRefused>;
}

/// For texts without a file: there is nowhere to look.
pub(super) struct Nowhere;

impl RunSource for Nowhere {
    fn find(&self, name: &str, _file: &str) -> Result<NamedRun, RunRefused> {
        Err(refused(
            format!("the run `{name}` is not looked for: this world is a text without a file"),
            "load the world from its file, or use `Scenario::parse_with`",
        ))
    }
}

/// A world from its text; `None`: it is a grid.
pub(super) type Assembled = Result<Option<World>, Vec<Problem>>;

/// Where a world comes from: its file's name, and who finds the runs it names.
#[derive(Clone, Copy)]
pub(super) struct Origin<'a> {
    pub(super) file: &'a str,
    pub(super) runs: &'a dyn RunSource,
    /// Assembles the world of a run, which stands within this one.
    pub(super) assemble: fn(Origin<'_>, &str) -> Assembled,
}
