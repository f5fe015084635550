//! Ado trained for one changed ego, as a baseline of reuse.

use super::train_loop::{TrainError, train};
use crate::experiment::Watch;
use crate::run_dir::{Beginning, ChangedEgo, RequestedTraining, RunDir, RunError, file_name};
use crate::world::{Scenario, TrainingEgos};

/// Returns the ado that is trained for a changed ego, under `RUN/retrained/`.
///
/// An unfinished training is completed now, with the seed of `run` and the world's
/// learner for a nominal ego. `changed` is the world with the ego. `None`: stopped. The
/// finished part of the training is kept.
///
/// # Errors
/// Training fails, the disk refuses, or the directory holds another ado.
pub fn retrained(
    run: &RunDir,
    ego: &ChangedEgo,
    changed: &Scenario,
    watch: &Watch<'_>,
) -> Result<Option<RunDir>, TrainError> {
    // In the family of its world it would be trained against many egos.
    let plain = changed.training_against(TrainingEgos::Nominal);
    let changed = plain.as_ref().unwrap_or(changed);
    // Ados of two plants are different, and neither may overwrite the other.
    let name = file_name(&format!("{}-{}", ego.name, changed.plant()));
    let path = run.path().join("retrained").join(name);
    let seed = run.manifest().seed;
    let mut own = match RunDir::resume(&path) {
        Ok(own) => own,
        Err(RunError::NotARun { .. }) => {
            let ego = Some(ego.clone());
            RunDir::begin(
                &path,
                changed,
                seed,
                Beginning {
                    ego,
                    ..Beginning::default()
                },
            )?
        }
        Err(error) => return Err(error.into()),
    };
    // The directory may be left from another edition of the world, or of the ego.
    own.must_be_of(RequestedTraining {
        scenario: changed,
        seed,
        ego: Some(ego),
    })?;
    let trained = train(changed, &mut own, watch)?;
    Ok((!trained.interrupted).then_some(own))
}
