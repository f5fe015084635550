//! An ado trained anew for one changed ego: what reuse saves, and what it costs.

use super::train_loop::{TrainError, train};
use crate::experiment::Watch;
use crate::run_dir::{Beginning, ChangedEgo, RequestedTraining, RunDir, RunError, file_name};
use crate::world::{Scenario, TrainingEgos};

/// The ado that was trained for a changed ego, under `RUN/retrained/`.
///
/// It is trained now as far as it is not there yet, with the seed of `run` and
/// the learner its world names for a nominal ego; `changed` is the world with
/// that ego. `None`: stopped from outside; what was trained is kept.
///
/// # Errors
/// Training fails, the disk refuses, or the directory holds another ado.
pub fn retrained(
    run: &RunDir,
    ego: &ChangedEgo,
    changed: &Scenario,
    watch: &Watch<'_>,
) -> Result<Option<RunDir>, TrainError> {
    let plain = changed.training_against(TrainingEgos::Nominal);
    let changed = plain.as_ref().unwrap_or(changed);
    let plant = format!("{:?}", changed.plant()).to_lowercase();
    let name = file_name(&format!("{}-{plant}", ego.name));
    let path = run.path().join("retrained").join(name);
    let seed = run.manifest().seed;
    let mut own = match RunDir::resume(&path) {
        Ok(own) => own,
        Err(RunError::NotARun { .. }) => {
            let ego = Some(ego.clone());
            RunDir::begin(&path, changed, seed, Beginning { from: None, ego })?
        }
        Err(error) => return Err(error.into()),
    };
    own.must_be_of(RequestedTraining {
        scenario: changed,
        seed,
        ego: Some(ego),
    })?;
    let trained = train(changed, &mut own, watch)?;
    Ok((!trained.interrupted).then_some(own))
}
