//! Runs within runs: the world of a run may hold trained ados of its own.
//!
//! Assembling a world assembles the worlds of its runs first, by recursion.
//! Whoever writes files can make that go on for ever (a run whose world names
//! the run itself) or for too long (texts within texts), so the runs are
//! walked before, down to a limit.

use super::run::{Run, TrainedFile, opened};
use crate::world::file::{AgentFile, DriveFile, LightFile, ScenarioFile};
use crate::world::read;
use crate::world::runs::{Origin, RunRefused, refused};

/// Most runs within each other; each costs some of the stack.
const MOST_NESTED: usize = 16;
/// Names of a chain that are shown at its beginning if it is too long.
const SHOWN: usize = 3;

/// Refuses a run that is within itself, or too many within each other.
///
/// What else is wrong with them is found when they are assembled.
pub(super) fn check(run: &Run, origin: Origin<'_>) -> Result<(), RunRefused> {
    walk(run, origin, &mut Vec::new())
}

/// A run on the way down: its name and, if it was found, its identity.
type Link = (String, Option<String>);

fn walk(run: &Run, origin: Origin<'_>, chain: &mut Vec<Link>) -> Result<(), RunRefused> {
    let mut above = chain.iter();
    let again = run.identity.is_some() && above.any(|(_, other)| *other == run.identity);
    chain.push((run.from.clone(), run.identity.clone()));
    if again {
        return Err(refused(
            format!("the run `{}` is within itself: {}", run.from, names(chain)),
            "the world of a run names runs that were trained before it: \
             train one of these again in a world without the others",
        ));
    }
    if MOST_NESTED < chain.len() {
        let begins = names(&chain[..SHOWN]);
        return Err(refused(
            format!("more than {MOST_NESTED} runs within each other: {begins} → …"),
            "train an ado again in a world whose trained ados were trained among others",
        ));
    }
    for inner in runs_in(run, origin) {
        walk(&inner, origin, chain)?;
    }
    chain.pop();
    Ok(())
}

/// The names of a chain, outermost first.
fn names(chain: &[Link]) -> String {
    let names: Vec<&str> = chain.iter().map(|(name, _)| name.as_str()).collect();
    names.join(" → ")
}

/// The runs that the world of a run holds, as far as they can be read.
fn runs_in(run: &Run, origin: Origin<'_>) -> Vec<Run> {
    let Ok(read::Kind::Scenario) = read::kind(&run.world) else {
        return Vec::new();
    };
    let Ok(file) = read::parse::<ScenarioFile>(&run.world) else {
        return Vec::new();
    };
    let trained = file.agents.iter().filter_map(trained);
    let inner = Origin {
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
        AgentFile::Obstacle { .. } => None,
        AgentFile::Light { drive, .. } => match drive {
            LightFile::Trained(file) => Some(file),
            _ => None,
        },
    }
}
