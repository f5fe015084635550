//! Anything callable as a system under test.

use std::sync::{Arc, Mutex, PoisonError};

use brakecheck::campaign::EgoUnderTest;
use brakecheck::ego::{Briefing, Command, Controller, Fault, FaultKind, Percept};
use brakecheck::scenario::Scenario;
use brakecheck::scene::drive::ControllerFactory;
use pyo3::exceptions::{PyKeyboardInterrupt, PySystemExit};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyType};

use crate::convert::objects;
use crate::error::{failed, wrong};
use crate::percept::{self, commanded};

/// Characters of a traceback that a fault keeps, from its end.
const TRACEBACK: usize = 4000;

/// What somebody who pressed Ctrl-C raised inside an ego; it is no fault of it.
static INTERRUPTED: Mutex<Option<PyErr>> = Mutex::new(None);

/// Raises what was raised to end the program, not the episode.
pub(crate) fn check_interrupted() -> PyResult<()> {
    let mut slot = INTERRUPTED.lock().unwrap_or_else(PoisonError::into_inner);
    slot.take().map_or(Ok(()), Err)
}

/// The egos that `given` means: a name, a file, the words of a program, or
/// Python objects.
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

/// Whether Python code plays the ego.
pub(crate) fn is_python(given: Option<&Bound<'_, PyAny>>) -> bool {
    given.is_some_and(|given| {
        !(given.is_none() || given.cast::<PyString>().is_ok() || given.cast::<PyList>().is_ok())
    })
}

/// What makes controllers of a class, of an object or of a function, and its name.
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
        Source::Object => given.get_type().into_any(),
        Source::Class | Source::Function => given.clone(),
    };
    let name = match named.getattr("__qualname__") {
        Ok(name) => name.extract::<String>()?,
        Err(_) => given.get_type().qualname()?.to_string(),
    };
    let name = name.replace(".<locals>", "").replace(['<', '>'], "");
    let object: Arc<Py<PyAny>> = Arc::new(given.clone().unbind());
    let make = move || {
        let made = Python::attach(|py| source.controller(object.bind(py)));
        let controller: Box<dyn Controller> = match made {
            Ok(controller) => Box::new(controller),
            Err(error) => Box::new(NotMade(fault(FaultKind::CannotStart, &error))),
        };
        controller
    };
    Ok((name, Arc::new(make)))
}

/// What Python gave: how fresh controllers are made of it.
#[derive(Clone, Copy)]
enum Source {
    /// An instance each.
    Class,
    /// A deep copy each, so that episodes that are played at the same time do
    /// not meet in it.
    Object,
    /// The function itself: it answers from the percept alone.
    Function,
}

impl Source {
    fn controller(self, given: &Bound<'_, PyAny>) -> PyResult<PythonController> {
        match self {
            Source::Class => PythonController::of(&given.call0()?),
            Source::Object => {
                let copied = given
                    .py()
                    .import("copy")?
                    .call_method1("deepcopy", (given,));
                PythonController::of(&copied?)
            }
            Source::Function => Ok(PythonController {
                object: given.clone().unbind(),
                control: given.clone().unbind(),
                is_function: true,
                failed: None,
            }),
        }
    }
}

/// A controller in Python.
struct PythonController {
    object: Py<PyAny>,
    /// Its bound method `control`, looked up once.
    control: Py<PyAny>,
    is_function: bool,
    /// What went wrong where nobody could be told: the next answer says it.
    failed: Option<Fault>,
}

impl PythonController {
    fn of(object: &Bound<'_, PyAny>) -> PyResult<PythonController> {
        Ok(PythonController {
            object: object.clone().unbind(),
            control: object.getattr("control")?.unbind(),
            is_function: false,
            failed: None,
        })
    }

    /// Calls a method that an ego need not have.
    fn tell(&mut self, method: &str, with: impl FnOnce(Python<'_>) -> PyResult<Py<PyAny>>) {
        if self.is_function {
            return;
        }
        let told = Python::attach(|py| {
            let object = self.object.bind(py);
            let Some(method) = object.getattr_opt(method)? else {
                return Ok(());
            };
            method.call1((with(py)?,)).map(drop)
        });
        if let Err(error) = told {
            self.failed = Some(fault(FaultKind::Error, &error));
        }
    }
}

impl Controller for PythonController {
    fn brief(&mut self, briefing: &Briefing) {
        self.tell("brief", |py| Ok(objects(py, briefing)?.unbind()));
    }

    fn reset(&mut self, seed: u64) {
        self.failed = None;
        self.tell("reset", |py| {
            Ok(seed.into_pyobject(py)?.into_any().unbind())
        });
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        if let Some(fault) = self.failed.take() {
            return Err(fault);
        }
        let answer = Python::attach(|py| {
            let percept = Bound::new(py, percept::Percept::from(percept))?;
            commanded(&self.control.bind(py).call1((percept,))?)
        });
        answer.map_err(|error| fault(FaultKind::Error, &error))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        if self.failed.is_some() {
            return None;
        }
        let forked = Python::attach(|py| {
            let object = self.object.bind(py);
            if self.is_function {
                return Some(PythonController {
                    object: object.clone().unbind(),
                    control: self.control.clone_ref(py),
                    is_function: true,
                    failed: None,
                });
            }
            let fork = object.getattr_opt("fork").ok()??;
            let copy = fork.call0().ok().filter(|copy| !copy.is_none())?;
            PythonController::of(&copy).ok()
        });
        forked.map(|controller| Box::new(controller) as Box<dyn Controller>)
    }
}

/// An ego whose constructor failed: every episode says so.
#[derive(Clone)]
struct NotMade(Fault);

impl Controller for NotMade {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
        Err(self.0.clone())
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

/// An exception as a fault, with the end of its traceback.
fn fault(kind: FaultKind, error: &PyErr) -> Fault {
    Python::attach(|py| {
        if error.is_instance_of::<PyKeyboardInterrupt>(py)
            || error.is_instance_of::<PySystemExit>(py)
        {
            let mut slot = INTERRUPTED.lock().unwrap_or_else(PoisonError::into_inner);
            *slot = Some(error.clone_ref(py));
        }
        let traceback = error.traceback(py).and_then(|it| it.format().ok());
        let traceback = traceback.unwrap_or_default();
        let skip = traceback.chars().count().saturating_sub(TRACEBACK);
        let traceback: String = traceback.chars().skip(skip).collect();
        let said = error.to_string();
        let line = said.lines().next().unwrap_or_default().to_owned();
        Fault::new(kind, line).with_stderr(format!("{traceback}{said}"))
    })
}
