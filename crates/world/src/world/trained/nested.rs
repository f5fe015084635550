//! Nested runs: the world of a run may contain trained ados itself.
//!
//! Assembling a world assembles the worlds of its runs first, by recursion. A
//! file can make that endless (a run whose world refers to the run itself) or
//! too long (texts within texts). So the runs are traversed beforehand, down to
//! a limit.

use super::run::{LoadedRun, opened};
use crate::ron_file::read;
use crate::world::kind_of_world;
use crate::world::runs::{RunRefused, WorldOrigin, refused};
use crate::world_file::{AgentFile, DriveFile, LightFile, ScenarioFile, TrainedFile};

/// Greatest nesting depth of runs, because each level takes some of the stack.
const MOST_NESTED: usize = 16;
/// Number of names at the start of a long chain that are shown.
const SHOWN: usize = 3;

/// Refuses a run that contains itself, or too many nested runs.
///
/// Other mistakes are found when they are assembled.
pub(super) fn check(run: &LoadedRun, origin: WorldOrigin<'_>) -> Result<(), RunRefused> {
    walk(run, origin, &mut Vec::new())
}

/// Nested run: its name and, if it was found on the disk, its identity.
type Link = (String, Option<String>);

fn walk(run: &LoadedRun, origin: WorldOrigin<'_>, chain: &mut Vec<Link>) -> Result<(), RunRefused> {
    let mut above = chain.iter();
    // Runs in the text have no identity. They cannot contain themselves, since
    // texts are finite.
    let again = run.identity.is_some() && above.any(|(_, other)| *other == run.identity);
    chain.push((run.from.clone(), run.identity.clone()));
    if again {
        return Err(refused(
            format!("the run `{}` is within itself: {}", run.from, names(chain)),
            "the world of a run names runs that were trained before it: \
             train one of these again in a world without the others",
        ));
    }
    if chain.len() > MOST_NESTED {
        let begins = names(&chain[..SHOWN]);
        return Err(refused(
            format!("more than {MOST_NESTED} runs within each other: {begins} → …"),
            "train an ado again in a world whose trained ados were trained among others",
        ));
    }
    for inner in runs_in(run, origin) {
        walk(&inner, origin, chain)?;
    }
    // A run may occur twice side by side, but not within itself.
    chain.pop();
    Ok(())
}

/// Names of a chain, outermost first.
fn names(chain: &[Link]) -> String {
    let names: Vec<&str> = chain.iter().map(|(name, _)| name.as_str()).collect();
    names.join(" → ")
}

/// Runs in the world of a run, as far as they can be read.
fn runs_in(run: &LoadedRun, origin: WorldOrigin<'_>) -> Vec<LoadedRun> {
    let Ok(kind_of_world::WorldKind::Scenario) = kind_of_world::kind(&run.world) else {
        return Vec::new();
    };
    let Ok(file) = read::parse::<ScenarioFile>(&run.world) else {
        return Vec::new();
    };
    let trained = file.agents.iter().filter_map(trained);
    // References of the inner world are relative to its own file.
    let inner = WorldOrigin {
        file: &run.world_name(),
        ..origin
    };
    let runs = trained.filter_map(|trained| opened(&trained.run, inner).ok());
    runs.collect()
}

fn trained(agent: &AgentFile) -> Option<&TrainedFile> {
    match agent {
        AgentFile::Vehicle { drive, .. } | AgentFile::Pedestrian { drive, .. } => match drive {
            DriveFile::Trained(file) => Some(file),
            _ => None,
        },
        AgentFile::Obstacle { .. }
        | AgentFile::Weather(_)
        | AgentFile::Road(_)
        | AgentFile::Turns { .. } => None,
        AgentFile::Light { drive, .. } => match drive {
            LightFile::Trained(file) => Some(file),
            _ => None,
        },
    }
}
