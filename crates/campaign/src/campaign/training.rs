//! Training as a piece, with its run directory as its checkpoint.

use std::path::{Path, PathBuf};

use super::error::CampaignError;
use super::plan::{Plan, PlannedTraining};
use crate::experiment::Watch;
use crate::run_dir::{RunDir, RunError, file_name};
use crate::training::{TrainRequest, TrainSession};
use crate::world::Scenario;

/// Returns the path of a training in the directory of its plan.
pub(super) fn dir_of(dir: &Path, plan: &Plan, training: &PlannedTraining) -> PathBuf {
    let world = plan.worlds.get(training.world);
    let name = world.map_or("", |world| &world.name);
    let nth = training.world;
    let named = format!("{nth}-{}-{}", file_name(name), training.seed);
    dir.join("trainings").join(named)
}

/// Trains from the start or from the last checkpoint. `None`: stopped.
pub(super) fn train(
    path: &Path,
    world: &Scenario,
    training: &PlannedTraining,
    watch: &Watch<'_>,
) -> Result<Option<RunDir>, CampaignError> {
    let request = TrainRequest {
        seed: Some(training.seed),
        decisions: training.decisions,
        plant: world.plant().plant(),
        ..TrainRequest::default()
    };
    let begun = RunDir::open(path).is_ok();
    let mut session = if begun {
        TrainSession::resume(world, path, &request)?
    } else {
        TrainSession::begin(world, path, &request)?
    };
    // A training may have finished just before its piece could be written.
    if !session.run().manifest().is_finished() {
        session.train(watch)?;
    }
    if session.run().manifest().is_finished() {
        // It is opened again from disk, as the pieces that depend on it do.
        Ok(Some(finished(path)?))
    } else {
        Ok(None)
    }
}

/// Opens a finished training.
///
/// # Errors
/// Returns an error if the training is unfinished or damaged.
pub(super) fn finished(path: &Path) -> Result<RunDir, RunError> {
    let run = RunDir::open(path)?;
    // Loading the policy verifies it.
    run.policy_bundle()?;
    Ok(run)
}
