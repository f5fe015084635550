//! Callables as ados, and trained policies as callables.

use std::sync::{Arc, Mutex, PoisonError};

use brakecheck::rl::Policy;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::error::wrong;
use crate::python_thread::{Unanswered, call};

/// A Python callable from observations to joint actions.
pub(crate) struct PythonPolicy {
    act: Arc<Py<PyAny>>,
    actions: usize,
    neutral: usize,
    /// The first exception, which the evaluation raises.
    failed: Mutex<Option<PyErr>>,
}

impl PythonPolicy {
    /// `act` takes an observation as float32 and returns an action below `actions`.
    pub(crate) fn new(act: &Bound<'_, PyAny>, actions: usize, neutral: usize) -> PythonPolicy {
        PythonPolicy {
            act: Arc::new(act.clone().unbind()),
            actions,
            neutral,
            failed: Mutex::new(None),
        }
    }

    /// Raises its exception.
    pub(crate) fn check(&self) -> PyResult<()> {
        let mut slot = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
        slot.take().map_or(Ok(()), Err)
    }

    fn ask(&self, obs: &[f32]) -> Result<usize, Unanswered> {
        let (act, obs, actions) = (self.act.clone(), obs.to_vec(), self.actions);
        let ask = move |py: Python<'_>| {
            let obs = (PyArray1::from_vec(py, obs),).into_pyobject(py)?;
            Ok((act.clone_ref(py), obs.unbind()))
        };
        call(None, ask, move |answer| {
            // Policies return numpy integers or arrays of one element, which are no int
            // of Python.
            let number = answer
                .call_method0("__index__")
                .or_else(|_| answer.call_method0("item"));
            match number.and_then(|number| number.extract::<usize>()) {
                Ok(action) if action < actions => Ok(action),
                _ => Err(wrong(
                    format!("the ado answered {}", answer.repr()?),
                    format!("an action is a whole number from 0 to {}", actions - 1),
                )),
            }
        })
    }
}

impl Policy for PythonPolicy {
    fn act(&self, obs: &[f32]) -> usize {
        let failed = || self.failed.lock().unwrap_or_else(PoisonError::into_inner);
        // After an exception the callable is not asked again, since the evaluation will
        // raise it anyway.
        if failed().is_some() {
            return self.neutral;
        }
        match self.ask(obs) {
            Ok(action) => action,
            // Whoever listens for Ctrl-C raises that.
            Err(Unanswered::Late { .. } | Unanswered::Stopped) => self.neutral,
            Err(Unanswered::Raised(error)) => {
                // Threads may fail at once, and the first exception is the one to report.
                failed().get_or_insert(error);
                self.neutral
            }
        }
    }

    /// Unknown.
    fn value(&self, _obs: &[f32]) -> f32 {
        0.0
    }
}

/// A trained policy.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawPolicy {
    pub(crate) policy: Box<dyn Policy>,
    pub(crate) observation: usize,
}

#[pymethods]
impl RawPolicy {
    /// Returns the greedy action. Ties go to the lowest index.
    fn act(&self, obs: PyReadonlyArray1<'_, f32>) -> PyResult<usize> {
        Ok(self.policy.act(self.checked(&obs)?))
    }

    /// Draws an action at a temperature, equal for equal `unit` in [0, 1).
    ///
    /// Ados with separate policies share the number.
    fn sample(
        &self,
        obs: PyReadonlyArray1<'_, f32>,
        temperature: f64,
        unit: f64,
    ) -> PyResult<usize> {
        if !(1e-6..=1e6).contains(&temperature) || !(0.0..1.0).contains(&unit) {
            return Err(wrong(
                format!("a draw at temperature {temperature} with {unit}"),
                "give a temperature from 1e-6 to 1e6 and a number in [0, 1)",
            ));
        }
        Ok(self
            .policy
            .sample(self.checked(&obs)?, temperature, &mut || unit))
    }

    /// Returns the expected return from here.
    fn value(&self, obs: PyReadonlyArray1<'_, f32>) -> PyResult<f32> {
        Ok(self.policy.value(self.checked(&obs)?))
    }
}

impl RawPolicy {
    fn checked<'a>(&self, obs: &'a PyReadonlyArray1<'_, f32>) -> PyResult<&'a [f32]> {
        let slice = obs.as_slice()?;
        if slice.len() == self.observation {
            Ok(slice)
        } else {
            Err(wrong(
                format!("an observation of {} numbers", slice.len()),
                format!("this ado observes {}", self.observation),
            ))
        }
    }
}
