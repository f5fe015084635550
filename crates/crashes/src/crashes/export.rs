//! Kept counterexamples as files for other tools.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::osi_trace::osi_trace;
use super::regressions::{RegressionError, Regressions};
use super::replay::Replayed;
use crate::ego::{Command, Fault};
use crate::openx::{Crash, OpenX, OpenXError};
use crate::run_dir::{KeptError, RunError, make_dir, write_file};
use crate::testbench::{Episode, passage_of};
use crate::world::Scenario;

/// Files of exported counterexamples, and those that were not exported.
#[derive(Debug)]
pub struct Exports {
    /// Written files: three per counterexample, and a fourth with [`ExportSettings::osi`].
    pub files: Vec<PathBuf>,
    /// Kept counterexamples without any written file.
    pub refused: Vec<NotExported>,
}

/// Files to write besides those of OpenSCENARIO and OpenDRIVE.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExportSettings {
    /// True for `NAME.mcap`: the crash as an OSI trace.
    pub osi: bool,
}

/// Kept counterexample that was not exported.
#[derive(Debug, thiserror::Error)]
#[error("`{}` is not exported: {why}", path.display())]
pub struct NotExported {
    /// Path of the kept counterexample.
    pub path: PathBuf,
    /// Reason of the refusal.
    pub why: ExportRefusal,
}

/// Reason why a kept counterexample is not exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportRefusal {
    /// The crash happened in a grid world.
    #[error("it happens in the grid world `{world}`, and OpenSCENARIO has roads, not cells")]
    Grid {
        /// Name of the world.
        world: String,
    },
    /// OpenSCENARIO cannot express it.
    #[error(transparent)]
    OpenX(#[from] OpenXError),
    /// Its replay differs from the record.
    #[error("its replay differs from what was recorded, at {at}")]
    Differs {
        /// First difference.
        at: String,
    },
    /// The ego or the physics fails.
    #[error("{}: {}", .0.kind.word(), .0.message)]
    Fault(Fault),
}

/// Writes `NAME.xodr`, `NAME.xosc` and `NAME.external.xosc` per counterexample.
///
/// Existing files are replaced. A counterexample whose replay differs from its record is
/// refused. Grid worlds are refused, too, because they have no roads.
///
/// # Errors
/// A kept file is not usable, it names a program without your consent, or the disk
/// refuses.
pub fn export(regressions: &Regressions, dir: &Path) -> Result<Exports, RegressionError> {
    export_with(regressions, dir, ExportSettings::default())
}

/// Writes the files of [`export`], and those that the settings add.
///
/// # Errors
/// As [`export`].
pub fn export_with(
    regressions: &Regressions,
    dir: &Path,
    settings: ExportSettings,
) -> Result<Exports, RegressionError> {
    // All files are replayed before the directory exists, so an unusable one leaves
    // nothing behind.
    let replayed = regressions.replay_recorded()?;
    make_dir(dir).map_err(KeptError::from)?;
    let mut exports = Exports {
        files: Vec::with_capacity(4 * replayed.len()),
        refused: Vec::new(),
    };
    for (kept, replayed) in regressions.kept().iter().zip(&replayed) {
        let stem = replayed.path.file_stem().unwrap_or_default();
        let name = stem.to_string_lossy();
        match as_recorded(replayed, &name, &kept.counterexample.ego) {
            Ok(files) => {
                let written = write_openx(&files, dir, &name).map_err(KeptError::from)?;
                exports.files.extend(written);
                // The trace carries the text of the written road, so it needs no file
                // beside it.
                let road = (format!("{name}.xodr"), files.road);
                let osi = settings.osi.then(|| osi_of(replayed, road)).flatten();
                if let Some(osi) = osi {
                    let path = dir.join(format!("{name}.mcap"));
                    write_file(&path, &osi).map_err(KeptError::from)?;
                    exports.files.push(path);
                }
            }
            Err(why) => exports.refused.push(NotExported {
                path: replayed.path.clone(),
                why,
            }),
        }
    }
    Ok(exports)
}

/// Writes the road, the replay and the scenario for an ego of your own.
///
/// The directory must exist, and the returned paths have this order.
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

/// Returns the files of a replayed counterexample if it equals its record.
fn as_recorded(replayed: &Replayed, name: &str, ego: &str) -> Result<OpenX, ExportRefusal> {
    // Grid worlds are refused later, with a reason of their own.
    if !replayed.is_reproduced() && replayed.scenario.drive().is_some() {
        let difference = replayed.first_difference.as_ref();
        let at = difference.map_or("its verdict".to_owned(), ToString::to_string);
        return Err(ExportRefusal::Differs { at });
    }
    openx(&replayed.scenario, &replayed.episode, name, ego)
}

/// Returns a replayed counterexample as an OSI trace.
fn osi_of(replayed: &Replayed, road: (String, String)) -> Option<Vec<u8>> {
    let episode = &replayed.episode;
    let scenario = repeatable(&replayed.scenario, episode).of_episode(episode);
    osi_trace(&scenario, episode, road)
}

/// Converts an episode into three texts, with `ego` as the name of its ego.
///
/// # Errors
/// The world is a grid, the contact comes before any motion, or the ego fails after the
/// contact.
pub fn openx(
    scenario: &Scenario,
    episode: &Episode,
    name: &str,
    ego: &str,
) -> Result<OpenX, ExportRefusal> {
    // The files state the road of this episode.
    let scenario = repeatable(scenario, episode).of_episode(episode);
    let Some(driving) = scenario.drive() else {
        let world = scenario.name().to_owned();
        return Err(ExportRefusal::Grid { world });
    };
    let (recorded, after) =
        passage_of(&mut scenario.bench(), episode).ok_or(OpenXError::NoMotion)?;
    // The second drive continues after the contact, because the external ego may avoid
    // it.
    let world = driving.world();
    let ghostly = world.ghostly(&episode.start, episode.noise, &episode.actions);
    let crash = Crash {
        name,
        scenario: driving,
        ego,
        episode,
        recorded: &recorded,
        after: after.as_ref(),
        ghostly: &ghostly.map_err(ExportRefusal::Fault)?,
    };
    Ok(crash.files()?)
}

/// Returns the world with an ego that repeats its recorded commands, if any.
/// A foreign ego may not be deterministic. After its last command it coasts.
fn repeatable(scenario: &Scenario, episode: &Episode) -> Scenario {
    // A stock ego is deterministic, so its episodes record no commands.
    if episode.commands.is_empty() {
        return scenario.clone();
    }
    let mut commands = episode.commands.clone();
    // Players go on after the contact, where the record has no command of the ego any
    // more.
    commands.resize(scenario.world().clock().samples(), Command::default());
    scenario.with_commands(&Arc::from(commands))
}
