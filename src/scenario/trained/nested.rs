//! Runs within runs: the world of a run may hold trained ados of its own.
//!
//! Assembling a world assembles the worlds of its runs first, by recursion.
//! Whoever writes files can make that go on for ever (a run whose world names
//! the run itself) or for too long (texts within texts), so the runs are
//! walked before, down to a limit.

use std::path::PathBuf;

use super::super::file::{AgentFile, DriveFile, LightFile, ScenarioFile};
use super::super::read;
use super::{Refused, Run, TrainedFile, opened, refused};

/// Most runs within each other; each costs some of the stack.
const MOST_NESTED: usize = 16;
/// Names of a chain that are shown at its beginning if it is too long.
const SHOWN: usize = 3;

/// Refuses a run that is within itself, or too many within each other.
///
/// What else is wrong with them is found when they are assembled.
pub(super) fn check(run: &Run) -> Result<(), Refused> {
    walk(run, &mut Vec::new())
}

/// A run on the way down: its name and, if it was found there, its directory.
type Link = (String, Option<PathBuf>);

fn walk(run: &Run, chain: &mut Vec<Link>) -> Result<(), Refused> {
    let mut above = chain.iter();
    let again = run.dir.is_some() && above.any(|(_, dir)| *dir == run.dir);
    chain.push((run.from.clone(), run.dir.clone()));
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
    for inner in runs_in(run) {
        walk(&inner, chain)?;
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
fn runs_in(run: &Run) -> Vec<Run> {
    let Ok(read::Kind::Scenario) = read::kind(&run.world) else {
        return Vec::new();
    };
    let Ok(file) = read::parse::<ScenarioFile>(&run.world) else {
        return Vec::new();
    };
    let trained = file.agents.iter().filter_map(trained);
    let runs = trained.filter_map(|trained| opened(&trained.run, &run.world_name()).ok());
    runs.collect()
}

fn trained(agent: &AgentFile) -> Option<&TrainedFile> {
    match agent {
        AgentFile::Vehicle { drive, .. } | AgentFile::Pedestrian { drive, .. } => match drive {
            DriveFile::Trained(file) => Some(file),
            _ => None,
        },
        AgentFile::Light { drive, .. } => match drive {
            LightFile::Trained(file) => Some(file),
            _ => None,
        },
    }
}
