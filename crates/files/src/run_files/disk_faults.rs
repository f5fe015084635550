//! Failures of the k-th step on the disk, for tests.
//!
//! They are here and not in a test, because the unit tests of several crates need them.
//! Plans are distinguished by directory, so tests can run in parallel.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Kind of a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepFailure {
    /// The step and all later steps fail, as if the program was killed there.
    Killed,
    /// The step fails and later steps succeed, as on a disk that is full for a moment.
    Refused,
}

struct FailurePlan {
    under: PathBuf,
    at: u64,
    failure: StepFailure,
    done: u64,
}

/// Empty outside of tests: a lock costs nothing beside a change of the disk.
static PLANS: Mutex<Vec<FailurePlan>> = Mutex::new(Vec::new());

fn plans() -> MutexGuard<'static, Vec<FailurePlan>> {
    PLANS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins a step that changes a path, which fails if a plan says so.
pub(super) fn step(path: &Path) -> io::Result<()> {
    let mut plans = plans();
    let Some(plan) = plans.iter_mut().find(|plan| path.starts_with(&plan.under)) else {
        return Ok(());
    };
    plan.done += 1;
    match plan.failure {
        StepFailure::Killed if plan.at <= plan.done => Err(io::Error::other("killed here")),
        StepFailure::Refused if plan.at == plan.done => Err(io::ErrorKind::StorageFull.into()),
        _ => Ok(()),
    }
}

/// Runs `act` while step number `at` (from 1) under a directory fails.
///
/// Returns the number of steps that were begun as well.
pub fn failing<T>(
    under: &Path,
    at: u64,
    failure: StepFailure,
    act: impl FnOnce() -> T,
) -> (T, u64) {
    plans().push(FailurePlan {
        under: under.to_owned(),
        at,
        failure,
        done: 0,
    });
    let result = act();
    let mut plans = plans();
    let place = plans.iter().position(|plan| plan.under == under);
    let done = place.map_or(0, |place| plans.swap_remove(place).done);
    (result, done)
}
