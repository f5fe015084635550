//! Episodes of earlier trainings and kept counterexamples, to learn from.
//!
//! The paper's Figure 4 draws a bank of past experience. Here it is a list of starts with
//! the actions that succeeded there, against any ego. A training tries them against its
//! own ego, and those that succeed again are its first demonstrations.

use std::path::{Path, PathBuf};

use crate::ron_file::file_text;
use crate::run_dir::{Counterexample, KeptError, RunDir, RunError};
use crate::testbench::KnownEpisode;
use crate::world::Scenario;

/// Greatest number of episodes that a training takes from its bank.
///
/// Each is played once before the training, and more teach little.
const MOST: usize = 2000;

/// Error: a bank cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BankError {
    /// Path that is neither a run, nor kept counterexamples.
    #[error("`{path}` contains neither a run nor kept counterexamples")]
    Empty {
        /// Path of the bank.
        path: PathBuf,
    },
    /// Episodes of a world with other starts or actions.
    #[error("the episodes of `{path}` do not fit `{world}`: {why}")]
    Unlike {
        /// Path of the bank.
        path: PathBuf,
        /// World of the training.
        world: String,
        /// First difference.
        why: String,
    },
    /// Learner that uses no demonstrations.
    #[error("the learner `{learner}` does not learn from the episodes of others")]
    Learner {
        /// Name of the learner.
        learner: String,
    },
    /// Run that cannot be read.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Kept counterexample that cannot be read.
    #[error(transparent)]
    Kept(#[from] KeptError),
}

impl BankError {
    /// Returns the fix. `None`: the wrapped error has its own.
    pub fn help(&self) -> Option<String> {
        let help = match self {
            BankError::Empty { .. } => {
                "name a run directory, or a directory that `--keep` or `crashes` has filled"
            }
            BankError::Unlike { .. } => {
                "name runs of this world; their egos and rules may differ, their starts and \
                 actions not"
            }
            BankError::Learner { .. } => {
                "leave out `--learner` and `learner:` for the default, which learns from them"
            }
            BankError::Run(_) | BankError::Kept(_) => return None,
        };
        Some(help.to_owned())
    }
}

/// Reads the episodes of runs and of kept counterexamples, for a training in `world`.
///
/// A path is a run directory, a directory with kept counterexamples, or one of them.
/// At most 2000 episodes are returned, spread evenly over all.
///
/// # Errors
/// A path contains no episode, an episode does not fit the world, or the learner of the
/// world uses no demonstrations.
pub(super) fn gather(world: &Scenario, paths: &[PathBuf]) -> Result<Vec<KnownEpisode>, BankError> {
    if !paths.is_empty() && world.learner.seeding().is_none() {
        return Err(BankError::Learner {
            learner: world.learner.name().to_owned(),
        });
    }
    let mut all = Vec::new();
    for path in paths {
        let known = if path.join("manifest.json").is_file() {
            of_run(world, path)?
        } else {
            of_files(world, path)?
        };
        all.extend(known);
    }
    // Evenly and not the first ones, which an early and weak ado has found.
    let every = all.len().div_ceil(MOST).max(1);
    Ok(all.into_iter().step_by(every).collect())
}

/// Returns the successes of a training, which all began from training starts.
fn of_run(world: &Scenario, path: &Path) -> Result<Vec<KnownEpisode>, BankError> {
    let run = RunDir::open(path)?;
    let theirs = run.scenario()?;
    fits(world, &theirs, path)?;
    // An unfinished training has successes to learn from as well.
    let stored = run.counterexamples_so_far()?;
    let noise = run.noise_of(&stored)?;
    let pairs = stored.all().iter().zip(noise);
    let known = pairs.map(|(success, noise)| KnownEpisode {
        noise,
        start: success.start.clone(),
        actions: success.actions.clone(),
    });
    Ok(known.collect())
}

/// Returns the counterexamples in a file or a directory.
fn of_files(world: &Scenario, path: &Path) -> Result<Vec<KnownEpisode>, BankError> {
    let empty = || BankError::Empty { path: path.into() };
    let files = match std::fs::read_dir(path) {
        Ok(entries) => {
            let mut files: Vec<PathBuf> = entries.flatten().map(|it| it.path()).collect();
            files.retain(|file| file.extension().is_some_and(|end| end == "ron"));
            // The order of a directory differs between file systems.
            files.sort();
            files
        }
        // A path that is no directory may be a single counterexample.
        Err(_) if file_text(path).is_ok() => vec![path.to_owned()],
        Err(_) => return Err(empty()),
    };
    let mut known = Vec::with_capacity(files.len());
    let mut checked: Option<String> = None;
    for file in files {
        let kept = Counterexample::load(&file)?;
        let theirs = kept.scenario(&file)?;
        // Most files are of one world, whose actions need one comparison.
        if checked.as_ref() != Some(&kept.world_file) {
            fits(world, &theirs, &file)?;
            checked = Some(kept.world_file.clone());
        }
        known.push(KnownEpisode {
            start: kept.start(&theirs, &file)?,
            noise: kept.noise,
            actions: kept.actions,
        });
    }
    // An empty directory is more likely a mistyped path than a wish.
    if known.is_empty() {
        return Err(empty());
    }
    Ok(known)
}

/// Checks that episodes of one world can be played in another.
///
/// Egos and rules may differ. Starts and joint actions must mean the same.
fn fits(world: &Scenario, theirs: &Scenario, path: &Path) -> Result<(), BankError> {
    let unlike = |why: String| {
        Err(BankError::Unlike {
            path: path.into(),
            world: world.name().to_owned(),
            why,
        })
    };
    let names = |world: &Scenario| -> Vec<String> {
        let axes = world.axes().into_iter();
        axes.map(|axis| axis.name).collect()
    };
    // By name and order: a start is a list of numbers without names.
    let (ours, others) = (names(world), names(theirs));
    if ours != others {
        return unlike(format!(
            "starts have `{}` there and `{}` here",
            others.join("`, `"),
            ours.join("`, `")
        ));
    }
    let count = |world: &Scenario| world.spaces().actions;
    if count(world) != count(theirs) {
        return unlike(format!(
            "there are {} joint actions there and {} here",
            count(theirs),
            count(world)
        ));
    }
    // An episode keeps the numbers of its actions, so each must mean the same here.
    let other = (0..count(world)).find(|&it| world.action_label(it) != theirs.action_label(it));
    match other {
        Some(action) => unlike(format!(
            "action {action} is `{}` there and `{}` here",
            theirs.action_label(action),
            world.action_label(action)
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::TensorFile;
    use crate::run_dir::{Beginning, Done};
    use crate::seed::{Purpose, StartKey};
    use crate::testbench::{FIRST_KNOWN, Success};

    #[test]
    fn a_success_at_a_banked_start_has_the_noise_of_that_start() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let dir = tempfile::tempdir().expect("scratch");
        let path = dir.path().join("run");
        let bench = world.bench();
        let start = bench.draw(StartKey {
            purpose: Purpose::Train,
            seed: 8,
            index: 3,
        });
        let known = KnownEpisode {
            start: start.clone(),
            noise: 77,
            actions: vec![0, 1],
        };
        let with = Beginning {
            bank: std::slice::from_ref(&known),
            ..Beginning::default()
        };
        let mut run = RunDir::begin(&path, &world, 5, with).expect("begun");
        let success = |index| Success {
            decisions: 2,
            index,
            start: start.clone(),
            actions: vec![0, 1],
            by: 1.0,
        };
        let successes = [success(FIRST_KNOWN), success(4)];
        run.append_counterexamples(&successes).expect("written");
        let checkpoint = TensorFile::new("test");
        run.save_checkpoint(&checkpoint, Done::default())
            .expect("written");
        drop(run);
        let found = of_run(&world, &path).expect("two episodes");
        assert_eq!(found[0], known);
        // Another start is that of its key, as ever.
        let key = StartKey {
            purpose: Purpose::Train,
            seed: 5,
            index: 4,
        };
        assert_eq!(found[1].noise, bench.noise_of(key));
        assert_eq!(found[1].start, bench.draw(key));
    }
}
