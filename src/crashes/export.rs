//! Kept counterexamples as files for other tools.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::replay::{RegressionError, Regressions, Replayed};
use crate::ego::{Command, Fault};
use crate::openx::{Crash, OpenX, OpenXError};
use crate::run_dir::{KeptError, RunError, make_dir, write_file};
use crate::scene::World;
use crate::testbench::{Episode, passage_of};
use crate::world::Scenario;

/// What was written of some kept counterexamples, and what was not.
#[derive(Debug)]
pub struct Exports {
    /// The files, three per counterexample.
    pub files: Vec<PathBuf>,
    /// The kept counterexamples of which nothing was written.
    pub refused: Vec<NotExported>,
}

/// A kept counterexample of which nothing was written.
#[derive(Debug, thiserror::Error)]
#[error("`{}` is not exported: {why}", path.display())]
pub struct NotExported {
    /// Where it lies.
    pub path: PathBuf,
    /// Why.
    pub why: ExportRefusal,
}

/// Why nothing is written of a kept counterexample.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportRefusal {
    /// It cannot be said in OpenSCENARIO.
    #[error(transparent)]
    OpenX(#[from] OpenXError),
    /// It is not what was recorded any more.
    #[error("its replay differs from what was recorded, at {at}")]
    Differs {
        /// Where.
        at: String,
    },
    /// The ego or the physics fails.
    #[error("{}: {}", .0.kind.word(), .0.message)]
    Fault(Fault),
}

/// Writes `NAME.xodr`, `NAME.xosc` and `NAME.external.xosc` for every kept
/// counterexample into a directory, in place of what is there.
///
/// What is written is what was recorded: whose replay differs is refused. So
/// are grid worlds, which have no roads.
///
/// # Errors
/// A kept file is not usable, names a program to which nobody consented, or the
/// disk refuses.
pub fn export(regressions: &Regressions, dir: &Path) -> Result<Exports, RegressionError> {
    let replayed = regressions.replay_recorded()?;
    make_dir(dir).map_err(KeptError::from)?;
    let mut exports = Exports {
        files: Vec::with_capacity(3 * replayed.len()),
        refused: Vec::new(),
    };
    for (kept, replayed) in regressions.kept().iter().zip(&replayed) {
        let stem = replayed.path.file_stem().unwrap_or_default();
        let name = stem.to_string_lossy();
        match as_recorded(replayed, &name, &kept.counterexample.ego) {
            Ok(files) => {
                let written = write_openx(&files, dir, &name).map_err(KeptError::from)?;
                exports.files.extend(written);
            }
            Err(why) => exports.refused.push(NotExported {
                path: replayed.path.clone(),
                why,
            }),
        }
    }
    Ok(exports)
}

/// Writes the road, the replay and the scenario for an ego of one's own into a
/// directory that is there, in this order.
///
/// # Errors
/// The disk refuses.
pub fn write_openx(files: &OpenX, dir: &Path, name: &str) -> Result<[PathBuf; 3], RunError> {
    let file = |ending: &str| dir.join(format!("{name}.{ending}"));
    let paths = ["xodr", "xosc", "external.xosc"].map(file);
    let texts = [&files.road, &files.replay, &files.external];
    for (path, text) in paths.iter().zip(texts) {
        write_file(path, text.as_bytes())?;
    }
    Ok(paths)
}

/// The files of a replayed counterexample, if it is what was recorded.
fn as_recorded(replayed: &Replayed, name: &str, ego: &str) -> Result<OpenX, ExportRefusal> {
    if !replayed.is_reproduced() && replayed.scenario.drive().is_some() {
        let difference = replayed.first_difference.as_ref();
        let at = difference.map_or("its verdict".to_owned(), ToString::to_string);
        return Err(ExportRefusal::Differs { at });
    }
    openx(&replayed.scenario, &replayed.episode, name, ego)
}

/// The three files of an episode, as texts; `ego` is what its ego is called.
///
/// # Errors
/// It happened in a grid world, before anybody moved, or its ego fails beyond
/// the contact.
pub fn openx(
    scenario: &Scenario,
    episode: &Episode,
    name: &str,
    ego: &str,
) -> Result<OpenX, ExportRefusal> {
    let scenario = repeatable(scenario, episode);
    let World::Drive(world) = scenario.world() else {
        let world = scenario.name().to_owned();
        return Err(OpenXError::Grid { world }.into());
    };
    let recorded = passage_of(&mut scenario.bench(), episode);
    let ghostly = world.ghostly(&episode.start, episode.noise, &episode.actions);
    let crash = Crash {
        name,
        scenario: &scenario,
        ego,
        episode,
        recorded: &recorded.ok_or(OpenXError::NobodyMoves)?,
        ghostly: &ghostly.map_err(ExportRefusal::Fault)?,
    };
    Ok(crash.files()?)
}

/// The same world; where nobody here wrote the ego it repeats its commands, and
/// coasts behind the last of them.
fn repeatable(scenario: &Scenario, episode: &Episode) -> Scenario {
    if episode.commands.is_empty() {
        return scenario.clone();
    }
    let mut commands = episode.commands.clone();
    commands.resize(scenario.world().clock().samples(), Command::default());
    scenario.with_commands(&Arc::from(commands))
}
