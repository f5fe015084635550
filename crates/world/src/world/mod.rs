//! Loading of RON world files, as checked [`Scenario`]s.
//!
//! Architecture Invariant: after a `Scenario` is loaded, no user mistake is
//! possible in it. Every earlier mistake has a place, a reason and, where known,
//! a fix ([`ScenarioError`]). All spans, helps and limits are in this module.
//!
//! ```
//! # use brakecheck_world as brakecheck;
//! use brakecheck::world::Scenario;
//!
//! let broken = Scenario::parse("mine.ron", "Scenario(name: \"mine\", clok: ())");
//! let error = broken.unwrap_err();
//! assert!(error.to_string().starts_with("mine.ron:1:"));
//! ```

mod ado_actions;
mod agents;
mod bodies;
mod build;
mod changed;
mod check;
mod counts_check;
mod dry_run;
mod environment;
pub mod family;
mod family_check;
mod grid;
mod grid_change;
mod includes;
mod kind_of_world;
mod language;
mod lights;
mod limits;
mod obstacles;
mod odd_starts;
mod open_drive;
mod per_ado;
mod plans;
mod points;
mod preventability;
mod quantity;
mod road_ado;
mod roads;
mod rule_spec;
mod run_lookup;
mod runs;
mod scenario;
pub mod scenario_kind;
mod shipped;
mod slope_and_wind;
mod starts;
mod storyboards;
mod structure;
mod traffic;
mod traffic_world;
mod trained;
mod turns;
mod vacuous;
mod variants;
mod warnings;
mod weather;

use std::path::Path as FilePath;

use crate::ron_file::{Respelled, read};
use crate::world_file::{self, GridFile, ScenarioFile, WorldFile};

pub use crate::ron_file::{LoadError, Patch, Problem, ScenarioError};
pub use crate::scene::drive::Sensors;
pub use crate::scene::grid::{AtWall, Horizon, Starts};
pub use crate::sim::PlantKind;
pub use crate::testbench::Repeats;
pub use crate::world_file::{
    AdoLawFile, Change, DeclaredTrafficFile, EncounterRate, FittedFile, GridChange, MarkovFile,
    OnsetFile, StartLawFile, TrainingGoal,
};
pub use family::TrainingEgos;
pub use rule_spec::RuleSpec;
pub use run_lookup::{ListedFiles, RunsOnDisk};
pub use runs::{NamedRun, RunRefused, RunSource};
pub use scenario::{ChangeError, Scenario};
pub use scenario_kind::NotAGrid;
pub use scenario_kind::{DriveScenario, GridScenario, ScenarioKind};
pub use traffic_world::LawSignal;

impl Scenario {
    /// Reads and checks a world file. `runs` finds the runs that it refers to.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, or is not a valid world.
    pub fn load_with(path: &FilePath, runs: &dyn RunSource) -> Result<Scenario, LoadError> {
        let file = path.display().to_string();
        let text = read::text(&file, path)?;
        Scenario::parse_with(&file, &text, runs)
            .map_err(|error| LoadError::Scenario(Box::new(error)))
    }

    /// Checks a world that was built as a value. Errors have places in its text.
    ///
    /// No file is read, so a value that refers to a run directory is refused.
    ///
    /// # Errors
    ///
    /// Returns the mistakes, with their places and fixes.
    ///
    /// ```
    /// # use brakecheck_world as brakecheck;
    /// # use brakecheck_world_file::world_file;
    /// use brakecheck::world::Scenario;
    /// use world_file::WorldFile;
    ///
    /// let text = Scenario::shipped("acc").expect("it is shipped")?.text;
    /// let WorldFile::Scenario(mut value) = world_file::parse("acc.ron", &text)? else {
    ///     panic!("a driving world");
    /// };
    /// value.name = "slow_acc".to_owned();
    /// assert_eq!(Scenario::of(&WorldFile::Scenario(value))?.name(), "slow_acc");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(world: &WorldFile) -> Result<Scenario, ScenarioError> {
        let file = format!("{}.ron", world.name());
        match world_file::text(world) {
            Ok(text) => Scenario::parse(&file, &text),
            Err(error) => Err(ScenarioError {
                file,
                text: String::new(),
                problems: vec![Problem {
                    what: error.to_string(),
                    span: 0..0,
                    label: "not written".to_owned(),
                    help: None,
                }],
            }),
        }
    }

    /// Checks the text of a world file. `file` is its name in errors.
    ///
    /// No file is read, so a text that refers to a run directory is refused.
    ///
    /// # Errors
    ///
    /// Returns the mistakes, with their places and fixes.
    pub fn parse(file: &str, text: &str) -> Result<Scenario, ScenarioError> {
        Scenario::parse_with(file, text, &runs::Nowhere)
    }

    /// Checks the text of a world file whose runs `runs` finds.
    ///
    /// # Errors
    ///
    /// Returns the mistakes, with their places and fixes.
    pub fn parse_with(
        file: &str,
        text: &str,
        runs: &dyn RunSource,
    ) -> Result<Scenario, ScenarioError> {
        // Some editors begin a file with a byte order mark.
        let text = read::without_mark(text);
        let fail = |problems| ScenarioError {
            file: file.to_owned(),
            text: text.to_owned(),
            problems,
        };
        let one = |problem| fail(vec![problem]);
        // The kind decides the type to read, so that errors name the fields of
        // that kind.
        match kind_of_world::kind(text).map_err(one)? {
            kind_of_world::WorldKind::Scenario => {
                let parsed = match read::parse(text) {
                    Ok(parsed) => parsed,
                    Err(first) => return Err(fail(misspelt(file, text, runs, first))),
                };
                let origin = runs::IncludingFile {
                    name: file,
                    source: runs,
                };
                match includes::expanded(origin, text, &parsed).map_err(fail)? {
                    // The places of mistakes are then those of the whole text.
                    Some(whole) => Scenario::parse_with(file, &whole, runs),
                    None => build::build(file, runs, text, parsed).map_err(fail),
                }
            }
            kind_of_world::WorldKind::Grid => {
                let parsed = read::parse(text).map_err(one)?;
                grid::build(text, parsed).map_err(fail)
            }
        }
    }

    /// Returns whether the text of a world file can be read to its end, past misspelt names.
    ///
    /// Otherwise the last mistake of [`Scenario::parse`] hides those after it.
    pub fn is_readable(text: &str) -> bool {
        let text = read::without_mark(text);
        match kind_of_world::kind(text) {
            Ok(kind_of_world::WorldKind::Scenario) => {
                Respelled::<ScenarioFile>::of(text).value.is_some()
            }
            Ok(kind_of_world::WorldKind::Grid) => read::parse::<GridFile>(text).is_ok(),
            // A file of another kind hides no mistakes of a world.
            Err(_) => true,
        }
    }
}

/// Returns the mistakes of a world file that cannot be read, also those after misspelt names.
///
/// `first` is the first of them.
fn misspelt(file: &str, text: &str, runs: &dyn RunSource, first: Problem) -> Vec<Problem> {
    let mut read = Respelled::<ScenarioFile>::of(text);
    let mut problems = std::mem::take(&mut read.problems);
    if let Some(parsed) = read.value.take() {
        let origin = runs::IncludingFile {
            name: file,
            source: runs,
        };
        let later = match includes::expanded(origin, &read.text, &parsed) {
            Ok(None) => build::build(file, runs, &read.text, parsed).err(),
            // The places of mistakes in an included file are not those of the text.
            Ok(Some(_)) => None,
            Err(later) => Some(later),
        };
        problems.extend(later.into_iter().flatten().map(|problem| Problem {
            span: read.original(&problem.span),
            ..problem
        }));
    }
    if problems.is_empty() {
        // Invariant: the same text is read twice, so the first mistake is among these.
        problems.push(first);
    }
    problems
}
