//! Run directories for Python.

use std::path::PathBuf;

use brakecheck::run_dir::RunDir;
use brakecheck::world::Scenario;
use pyo3::prelude::*;

use crate::ado::RawPolicy;
use crate::convert::objects;
use crate::error::failed;
use crate::world::RawWorld;

/// Run directory of `brakecheck.Run`.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawRun(PathBuf);

#[pymethods]
impl RawRun {
    #[new]
    fn new(path: PathBuf) -> PyResult<RawRun> {
        let run = RawRun(path);
        // A wrong path is an error here and not at the first use.
        run.open()?;
        Ok(run)
    }

    /// Returns the fields of its manifest.
    fn manifest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        objects(py, self.open()?.manifest())
    }

    /// Returns the rows of its closing evaluation.
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        objects(py, &self.open()?.report().map_err(failed)?)
    }

    /// Returns the reports of its learner, line by line.
    fn progress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        objects(py, &self.open()?.progress().map_err(failed)?)
    }

    /// Returns the world of the training, on its plant.
    fn world(&self, allow_programs: bool) -> PyResult<RawWorld> {
        let world = self.scenario()?.allow_programs(allow_programs);
        Ok(RawWorld(world))
    }

    /// Returns the trained ado.
    fn policy(&self) -> PyResult<RawPolicy> {
        let policy = self.open()?.policy().map_err(failed)?;
        let observation = self.scenario()?.spaces().observation;
        Ok(RawPolicy {
            policy,
            observation,
        })
    }
}

impl RawRun {
    fn open(&self) -> PyResult<RunDir> {
        // Opened anew at each call, because a training may still write to it.
        RunDir::open(&self.0).map_err(failed)
    }

    fn scenario(&self) -> PyResult<Scenario> {
        self.open()?.scenario().map_err(failed)
    }
}
