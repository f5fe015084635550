#![cfg(test)]
//! Lets the k-th step on the disk fail, for tests.
//!
//! Plans are told apart by directory, so that tests may run side by side.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What becomes of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum How {
    /// It and all later ones do not happen, as if the program was killed there.
    Killed,
    /// It fails and later ones do not, as on a disk that is full for a moment.
    Refused,
}

struct Plan {
    under: PathBuf,
    at: u64,
    how: How,
    done: u64,
}

static PLANS: Mutex<Vec<Plan>> = Mutex::new(Vec::new());

fn plans() -> MutexGuard<'static, Vec<Plan>> {
    PLANS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Before every step that changes the disk.
pub(super) fn step(path: &Path) -> io::Result<()> {
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

/// Does something during which the step number `at` (from 1) under a directory
/// fails; says how many steps were begun.
pub(crate) fn failing<T>(under: &Path, at: u64, how: How, act: impl FnOnce() -> T) -> (T, u64) {
    plans().push(Plan {
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
