//! Failures of the crate as exceptions, with the text a terminal would show.

use brakecheck::cli::{Exit, Failure, plain_theme};
use pyo3::prelude::*;
use pyo3::types::PyType;

/// Columns of the text of an exception.
const WIDTH: usize = 100;

/// Exception of a class in `brakecheck/errors.py`, with a message.
pub(crate) fn raised(class: &str, message: String) -> PyErr {
    Python::attach(|py| {
        let class = py
            // The classes are written in Python, where users catch them and read their
            // documentation.
            .import("brakecheck.errors")
            .and_then(|module| module.getattr(class))
            .and_then(|class| Ok(class.cast_into::<PyType>()?));
        match class {
            Ok(class) => PyErr::from_type(class, (message.trim_end().to_owned(),)),
            Err(error) => error,
        }
    })
}

/// Error of a wrong input, with the mistake and the fix.
pub(crate) fn wrong(what: impl Into<String>, help: impl Into<String>) -> PyErr {
    failed(Failure::input(what, help))
}

/// Returns a failure as the exception of its exit code.
pub(crate) fn failed(failure: impl Into<Failure>) -> PyErr {
    let failure = failure.into();
    let class = match failure.exit {
        Exit::Input => "InputError",
        Exit::NotIdentical => "NotIdenticalError",
        Exit::Fault | Exit::Done | Exit::Counterexample | Exit::Interrupted => "FaultError",
    };
    raised(class, failure.render(plain_theme(), WIDTH))
}
