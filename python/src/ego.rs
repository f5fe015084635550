//! Callables as systems under test.

use std::sync::Arc;
use std::time::Duration;

use brakecheck::ego::{Controller, Process};
use brakecheck::experiment::ControllerFactory;
use brakecheck::experiment::EgoUnderTest;
use brakecheck::world::Scenario;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyType};

use crate::controller::{Maker, PythonController, Source};
use crate::error::{failed, wrong};
use crate::percept::number;

/// Returns the egos of `given`: a name, a file, the words of a program, or Python
/// objects.
pub(crate) fn egos(
    world: &Scenario,
    given: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<EgoUnderTest>> {
    let Some(given) = given.filter(|given| !given.is_none()) else {
        return Ok(vec![EgoUnderTest::nominal(world)]);
    };
    if let Ok(name) = given.cast::<PyString>() {
        return EgoUnderTest::find(world, name.to_cow()?.as_ref()).map_err(failed);
    }
    if given.cast::<PyList>().is_ok() {
        let command: Vec<String> = given.extract()?;
        if command.is_empty() {
            return Err(wrong(
                "an empty list is no program",
                "give its words, such as [\"python3\", \"ego.py\"]",
            ));
        }
        let program = EgoUnderTest::program(world, &command).map_err(failed)?;
        return Ok(vec![program]);
    }
    let (name, factory) = factory(given)?;
    let own = EgoUnderTest::own(world, &name, factory).map_err(failed)?;
    Ok(vec![own])
}

/// Returns true if Python code plays the ego.
pub(crate) fn is_python(given: Option<&Bound<'_, PyAny>>) -> bool {
    given.is_some_and(|given| {
        !(given.is_none() || given.cast::<PyString>().is_ok() || given.cast::<PyList>().is_ok())
    })
}

/// Returns a maker of controllers from a class, an object or a function, and its name.
pub(crate) fn factory(given: &Bound<'_, PyAny>) -> PyResult<(String, ControllerFactory)> {
    let is_class = given.cast::<PyType>().is_ok();
    let has_control = given.hasattr("control")?;
    let source = match (is_class, has_control) {
        (true, true) => Source::Class,
        (false, true) => Source::Object,
        (false, false) if given.is_callable() => Source::Function,
        _ => {
            return Err(wrong(
                format!("{} is no ego", given.repr()?),
                "an ego is a function of a percept, or a class or an object with \
                 `reset(seed)` and `control(percept)`",
            ));
        }
    };
    let named = match source {
        // An object has no name of its own, so its class gives one.
        Source::Object => given.get_type().into_any(),
        Source::Class | Source::Function => given.clone(),
    };
    let name = (match named.getattr("__qualname__") {
        Ok(name) => name.extract::<String>()?,
        // A `functools.partial` is callable and has no name.
        Err(_) => given.get_type().qualname()?.to_string(),
    })
    // Names become parts of file names and tables, and `<lambda>` disturbs both.
    .replace(".<locals>", "")
    .replace(['<', '>'], "");
    let maker = Maker {
        given: Arc::new(given.clone().unbind()),
        source,
        name: name.clone(),
        deadline: deadline(given)?,
        fresh: match given.getattr_opt("fresh")? {
            Some(fresh) => fresh.extract()?,
            None => false,
        },
    };
    let make = move || Box::new(PythonController::new(&maker)) as Box<dyn Controller>;
    Ok((name, Arc::new(make)))
}

/// Longest wait for an answer: `timeout_s` of the ego, as in `Process(…)` of a world
/// file.
fn deadline(given: &Bound<'_, PyAny>) -> PyResult<Duration> {
    // The limits of `timeout_s` are those of a program, so its own check is asked.
    let mut program = Process::new(["python"]);
    if let Some(timeout_s) = given.getattr_opt("timeout_s")? {
        program.timeout_s = number(&timeout_s)?;
    }
    match program.flaw() {
        Some((_, what, help)) => Err(wrong(what, help)),
        None => Ok(Duration::from_secs_f64(program.timeout_s)),
    }
}
