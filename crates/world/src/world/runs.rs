//! Runs that a world file refers to, found by a source outside of this module.

use super::rule_spec::RuleSpec;
use crate::ron_file::Problem;
use crate::scene::drive::DriveWorld;
use crate::stl::Names;

/// Parts of a finished run that a world requires.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedRun {
    /// Identity of the run, independent of the name that found it.
    pub identity: String,
    /// World file of the run, verbatim.
    pub world: String,
    /// Policy of the run: bytes of a safetensors file.
    pub policy: Vec<u8>,
}

/// Run that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct RunRefused {
    /// Reason in one sentence.
    pub what: String,
    /// Advice for the author of the world.
    pub help: String,
}

pub(super) fn refused(what: String, help: &str) -> RunRefused {
    RunRefused {
        what,
        help: help.to_owned(),
    }
}

/// Source of runs by their names in world files.
///
/// [`super::RunsOnDisk`] finds directories.
pub trait RunSource {
    /// Returns the finished run `name` of the world file `file`.
    ///
    /// # Errors
    ///
    /// Returns an error if the run is missing, unfinished or damaged.
    fn find(&self, name: &str, file: &str) -> Result<NamedRun, RunRefused>;

    /// Returns the text of the file `name` that the world file `file` includes: a rule
    /// file or a traffic model.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read. A source of runs only finds none.
    fn text(&self, name: &str, file: &str) -> Result<String, RunRefused> {
        // Only sources on disk use the name, to look beside the file.
        let _ = file;
        Err(refused(
            format!("the file `{name}` is not looked for: this world is a text without a file"),
            "load the world from its file, or use `Scenario::parse_with`",
        ))
    }
}

/// World file that includes others.
#[derive(Clone, Copy)]
pub(super) struct IncludingFile<'a> {
    pub(super) name: &'a str,
    /// Source of the files that it includes.
    pub(super) source: &'a dyn RunSource,
}

impl IncludingFile<'_> {
    /// Returns the text of an included file.
    pub(super) fn text(&self, name: &str) -> Result<String, RunRefused> {
        self.source.text(name, self.name)
    }
}

/// Source without any run, for texts without a file.
pub(super) struct Nowhere;

impl RunSource for Nowhere {
    fn find(&self, name: &str, _file: &str) -> Result<NamedRun, RunRefused> {
        Err(refused(
            format!("the run `{name}` is not looked for: this world is a text without a file"),
            "load the world from its file, or use `Scenario::parse_with`",
        ))
    }
}

/// World of a run, with its rules and the names that they use.
pub(super) struct InnerWorld {
    pub(super) world: DriveWorld,
    pub(super) rules: Vec<RuleSpec>,
    pub(super) names: Names,
}

/// World of a text. `None` for a grid.
pub(super) type Assembled = Result<Option<InnerWorld>, Vec<Problem>>;

/// Origin of a world: the name of its file, and the source of its runs.
#[derive(Clone, Copy)]
pub(super) struct WorldOrigin<'a> {
    pub(super) file: &'a str,
    pub(super) runs: &'a dyn RunSource,
    /// Function that assembles the world of a run within this world.
    pub(super) assemble: fn(WorldOrigin<'_>, &str) -> Assembled,
}
