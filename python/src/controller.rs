//! Controllers written in Python, with deadlines.

use std::cell::RefCell;
use std::sync::Arc;
use std::time::Duration;

use brakecheck::ego::{Briefing, Command, Controller, Fault, FaultKind, Percept};
use pyo3::exceptions::{PyKeyboardInterrupt, PySystemExit};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::convert::objects;
use crate::interrupt::note_interrupt;
use crate::percept::{self, commanded};
use crate::python_thread::{Unanswered, call};

/// Characters of a traceback that a fault keeps, from its end.
const TRACEBACK: usize = 4000;

/// Source of new controllers in Python.
#[derive(Clone, Copy)]
pub(crate) enum Source {
    /// A class, of which each controller is an instance.
    Class,
    /// An object, of which each controller is a deep copy, so that parallel episodes
    /// share no state.
    Object,
    /// A function, which uses the percept alone.
    Function,
}

/// Python objects of which controllers are made, with their deadline.
#[derive(Clone)]
pub(crate) struct Maker {
    pub(crate) given: Arc<Py<PyAny>>,
    pub(crate) source: Source,
    pub(crate) name: String,
    /// Longest wait for an answer.
    pub(crate) deadline: Duration,
    /// Make an instance for every episode, so that none keeps state.
    pub(crate) fresh: bool,
}

/// An ego in Python, its methods looked up once.
struct Instance {
    control: Py<PyAny>,
    brief: Option<Py<PyAny>>,
    reset: Option<Py<PyAny>>,
    fork: Option<Py<PyAny>>,
}

impl Instance {
    fn of(object: &Bound<'_, PyAny>) -> PyResult<Instance> {
        let method = |name| -> PyResult<Option<Py<PyAny>>> {
            let found = object.getattr_opt(name)?;
            Ok(found.filter(|it| !it.is_none()).map(Bound::unbind))
        };
        Ok(Instance {
            control: object.getattr("control")?.unbind(),
            brief: method("brief")?,
            reset: method("reset")?,
            fork: method("fork")?,
        })
    }

    fn function(function: &Py<PyAny>) -> Instance {
        Instance {
            control: Python::attach(|py| function.clone_ref(py)),
            brief: None,
            reset: None,
            fork: None,
        }
    }
}

/// A controller in Python.
pub(crate) struct PythonController {
    maker: Maker,
    /// `None` if none was made or it did not answer. The next episode makes another.
    instance: RefCell<Option<Arc<Instance>>>,
    briefing: Option<Briefing>,
    /// A fault outside of an answer, which the next answer reports.
    failed: RefCell<Option<Fault>>,
}

impl PythonController {
    pub(crate) fn new(maker: &Maker) -> PythonController {
        let controller = PythonController {
            maker: maker.clone(),
            instance: RefCell::new(None),
            briefing: None,
            failed: RefCell::new(None),
        };
        controller.make();
        controller
    }

    /// Makes the instance that plays the next episodes, and briefs it.
    fn make(&self) {
        let (given, source) = (self.maker.given.clone(), self.maker.source);
        let ask = move |py: Python<'_>| match source {
            Source::Object => {
                let copy = py.import("copy")?.getattr("deepcopy")?;
                Ok((copy.unbind(), arguments(py, given.bind(py))?))
            }
            Source::Class | Source::Function => {
                Ok((given.clone_ref(py), PyTuple::empty(py).unbind()))
            }
        };
        let made = match source {
            Source::Class | Source::Object => call(self.limit(), ask, Instance::of),
            // A function has no state, so all controllers share it.
            Source::Function => Ok(Instance::function(&self.maker.given)),
        };
        match made {
            Ok(instance) => {
                *self.instance.borrow_mut() = Some(Arc::new(instance));
                self.brief_instance();
            }
            Err(why) => self.fail(FaultKind::CannotStart, why, "made"),
        }
    }

    /// Drops an ego that fails at its briefing. The next episode makes another.
    fn brief_instance(&self) {
        let Some(briefing) = self.briefing.clone() else {
            return;
        };
        let went_well = self.tell(
            "briefed",
            |instance| instance.brief.as_ref(),
            move |py| arguments(py, &objects(py, &briefing)?),
        );
        if !went_well {
            self.instance.replace(None);
        }
    }

    /// Calls an optional method of an ego, and returns true without a fault.
    fn tell(
        &self,
        occasion: &str,
        method: fn(&Instance) -> Option<&Py<PyAny>>,
        with: impl FnOnce(Python<'_>) -> PyResult<Py<PyTuple>> + Send + 'static,
    ) -> bool {
        let Some(instance) = self.instance.borrow().clone() else {
            return false;
        };
        if method(&instance).is_none() {
            return true;
        }
        let ask = move |py: Python<'_>| match method(&instance) {
            Some(method) => Ok((method.clone_ref(py), with(py)?)),
            None => Ok((py.None(), PyTuple::empty(py).unbind())),
        };
        let answer = call(self.limit(), ask, |_| Ok(()));
        answer
            .map_err(|why| self.fail(FaultKind::Error, why, occasion))
            .is_ok()
    }

    fn limit(&self) -> Option<Duration> {
        Some(self.maker.deadline)
    }

    fn fail(&self, kind: FaultKind, why: Unanswered, occasion: &str) {
        let fault = self.fault(kind, why, occasion);
        self.failed.replace(Some(fault));
    }

    /// Returns the reason of a missing answer as a fault. An instance that is still busy
    /// is abandoned.
    fn fault(&self, kind: FaultKind, why: Unanswered, occasion: &str) -> Fault {
        match why {
            Unanswered::Raised(error) => raised(kind, &error),
            Unanswered::Late { stack } => {
                self.instance.replace(None);
                let (name, seconds) = (&self.maker.name, self.maker.deadline.as_secs_f64());
                let what = format!("`{name}` gave no answer within {seconds} s when {occasion}");
                Fault::new(FaultKind::Timeout, what).with_stderr(last(&stack))
            }
            Unanswered::Stopped => {
                self.instance.replace(None);
                Fault::error("stopped by Ctrl-C")
            }
        }
    }
}

impl Controller for PythonController {
    fn brief(&mut self, briefing: &Briefing) {
        self.briefing = Some(briefing.clone());
        self.brief_instance();
    }

    fn reset(&mut self, seed: u64) {
        // An episode does not inherit the fault of the one before it.
        self.failed.replace(None);
        if self.maker.fresh {
            self.instance.replace(None);
        }
        // An instance that was late is gone, and the next episode deserves a new one.
        if self.instance.borrow().is_none() {
            self.make();
        }
        if self.failed.borrow().is_none() {
            self.tell(
                "asked to reset",
                |instance| instance.reset.as_ref(),
                move |py| arguments(py, &seed.into_pyobject(py)?.into_any()),
            );
        }
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        if let Some(fault) = &*self.failed.borrow() {
            return Err(fault.clone());
        }
        let Some(instance) = self.instance.borrow().clone() else {
            return Err(Fault::error("the ego was asked after its episode ended"));
        };
        let seen = percept::Percept::from(percept);
        let ask = move |py: Python<'_>| {
            let seen = Bound::new(py, seen)?.into_any();
            Ok((instance.control.clone_ref(py), arguments(py, &seen)?))
        };
        call(self.limit(), ask, commanded).map_err(|why| {
            let occasion = format!("asked for a command at {:.3} s", percept.time_s);
            self.fault(FaultKind::Error, why, &occasion)
        })
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        let instance = self.instance.borrow().clone()?;
        if self.failed.borrow().is_some() {
            return None;
        }
        let forked = match self.maker.source {
            // It has no state.
            Source::Function => Some(instance),
            Source::Class | Source::Object => self.forked(instance)?.map(Arc::new),
        };
        Some(Box::new(PythonController {
            maker: self.maker.clone(),
            failed: RefCell::new(self.failed.borrow().clone()),
            instance: RefCell::new(forked),
            briefing: self.briefing.clone(),
        }))
    }
}

impl PythonController {
    /// Returns a copy by `fork` of an instance. The outer `None` means that it makes none.
    /// The inner `None` means that it did not answer, which is a fault of both.
    fn forked(&self, instance: Arc<Instance>) -> Option<Option<Instance>> {
        instance.fork.as_ref()?;
        let ask = move |py: Python<'_>| {
            let fork = instance
                .fork
                .as_ref()
                .map(|fork| fork.clone_ref(py))
                .unwrap_or_else(|| py.None());
            Ok((fork, PyTuple::empty(py).unbind()))
        };
        let copied = call(self.limit(), ask, |copy| {
            // `fork` may return None to state that it makes no copy here.
            if copy.is_none() {
                Ok(None)
            } else {
                Instance::of(copy).map(Some)
            }
        });
        match copied {
            Ok(copy) => copy.map(Some),
            // An ego whose copy fails is played from the start, which is slower and as
            // correct.
            Err(Unanswered::Raised(_)) => None,
            Err(why) => {
                self.fail(FaultKind::Error, why, "asked to fork");
                Some(None)
            }
        }
    }
}

fn arguments(py: Python<'_>, one: &Bound<'_, PyAny>) -> PyResult<Py<PyTuple>> {
    PyTuple::new(py, [one]).map(Bound::unbind)
}

/// An exception as a fault, with the end of its traceback.
fn raised(kind: FaultKind, error: &PyErr) -> Fault {
    Python::attach(|py| {
        if error.is_instance_of::<PyKeyboardInterrupt>(py)
            || error.is_instance_of::<PySystemExit>(py)
        {
            // `sys.exit` in an ego ends the program and is no finding about the ego.
            note_interrupt(error.clone_ref(py));
        }
        let traceback = error.traceback(py).and_then(|it| it.format().ok());
        let said = error.to_string();
        // Tables have room for a single line, and the whole text is in the end of the
        // traceback.
        let line = said.lines().next().unwrap_or_default().to_owned();
        let traceback = last(&traceback.unwrap_or_default());
        Fault::new(kind, line).with_stderr(format!("{traceback}{said}"))
    })
}

/// The end of a traceback.
fn last(traceback: &str) -> String {
    let skip = traceback.chars().count().saturating_sub(TRACEBACK);
    // By characters, because a cut in the middle of one would panic.
    traceback.chars().skip(skip).collect()
}
