//! The program itself.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the command line on `arguments`, its own name first, and returns the exit code.
///
/// Help or a wrong command line ends the process.
#[pyfunction]
pub(crate) fn run_program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| brakecheck::cli::main_of(arguments) as u8)
}
