//! Failures of the k-th step on the disk, for tests.
//!
//! Plans are distinguished by directory, so tests can run in parallel.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::run_files::disk::before_each_step;

/// Kind of a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum How {
    /// The step and all later steps fail, as if the program was killed there.
    Killed,
    /// The step fails and later steps succeed, as on a disk that is full for a moment.
    Refused,
}

struct InjectedCrash {
    under: PathBuf,
    at: u64,
    how: How,
    done: u64,
}

static PLANS: Mutex<Vec<InjectedCrash>> = Mutex::new(Vec::new());

fn plans() -> MutexGuard<'static, Vec<InjectedCrash>> {
    PLANS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Hook before every step that changes the disk.
fn step(path: &Path) -> io::Result<()> {
    let mut plans = plans();
    let Some(plan) = plans.iter_mut().find(|plan| path.starts_with(&plan.under)) else {
        return Ok(());
    };
    plan.done += 1;
    match plan.how {
        How::Killed if plan.at <= plan.done => Err(io::Error::other("killed here")),
        How::Refused if plan.at == plan.done => Err(io::ErrorKind::StorageFull.into()),
        _ => Ok(()),
    }
}

/// Runs `act` while step number `at` (from 1) under a directory fails.
///
/// Returns the number of steps that were begun as well.
pub(crate) fn failing<T>(under: &Path, at: u64, how: How, act: impl FnOnce() -> T) -> (T, u64) {
    before_each_step(step);
    plans().push(InjectedCrash {
        under: under.to_owned(),
        at,
        how,
        done: 0,
    });
    let result = act();
    let mut plans = plans();
    let place = plans.iter().position(|plan| plan.under == under);
    let done = place.map_or(0, |place| plans.swap_remove(place).done);
    (result, done)
}
