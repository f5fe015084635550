//! Ctrl-C and exits raised inside Python code of an ego or ado.

use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;

/// Ctrl-C or an exit inside an ego, which is no fault of the ego.
static INTERRUPTED: Mutex<Option<PyErr>> = Mutex::new(None);

/// Keeps an exception that ends the program, not only the episode.
pub(crate) fn note_interrupt(raised: PyErr) {
    let mut slot = INTERRUPTED.lock().unwrap_or_else(PoisonError::into_inner);
    *slot = Some(raised);
}

/// Returns true if an exception ends the program.
pub(crate) fn is_interrupt_noted() -> bool {
    let slot = INTERRUPTED.lock().unwrap_or_else(PoisonError::into_inner);
    slot.is_some()
}

/// Raises the exception that ends the program, not only the episode.
pub(crate) fn check_interrupted() -> PyResult<()> {
    let mut slot = INTERRUPTED.lock().unwrap_or_else(PoisonError::into_inner);
    // Taken, so that the next call begins without the interrupt of this one.
    slot.take().map_or(Ok(()), Err)
}
