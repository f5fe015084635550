//! Run directories, as Python reads them.

use std::path::PathBuf;

use brakecheck::run::RunDir;
use brakecheck::scenario::Scenario;
use pyo3::prelude::*;

use crate::ado::RawPolicy;
use crate::convert::objects;
use crate::error::{failed, wrong};
use crate::world::RawWorld;

/// A run directory; `brakecheck.Run` is built on it.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawRun(PathBuf);

#[pymethods]
impl RawRun {
    #[new]
    fn new(path: PathBuf) -> PyResult<RawRun> {
        let run = RawRun(path);
        run.open()?;
        Ok(run)
    }

    /// What it was: the fields of its manifest.
    fn manifest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        objects(py, self.open()?.manifest())
    }

    /// The rows of its closing evaluation.
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        objects(py, &self.open()?.report().map_err(failed)?)
    }

    /// How training went, line by line.
    fn progress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        objects(py, &self.open()?.progress().map_err(failed)?)
    }

    /// The world it was trained in, on the plant it was trained on.
    fn world(&self, allow_programs: bool) -> PyResult<RawWorld> {
        let world = self.scenario()?.allow_programs(allow_programs);
        Ok(RawWorld(world))
    }

    /// The trained ado; a conditional one is told of the ego what is given.
    fn policy(&self, told: Vec<(String, f64)>) -> PyResult<RawPolicy> {
        let (run, world) = (self.open()?, self.scenario()?);
        let (policy, observation) = match (world.family(), world.plant().plant()) {
            (Some(family), Some(plant)) if !run.manifest().told.is_empty() => {
                let member = match told.is_empty() {
                    true => family.nominal(plant),
                    false => {
                        let member = family.member_named(&told.into_iter().collect(), plant);
                        let help =
                            || format!("the family varies: {}", run.manifest().told.join(", "));
                        member.map_err(|error| wrong(error.to_string(), help()))?
                    }
                };
                let policy = run.policy_told(&member).map_err(failed)?;
                (policy, world.world().spaces().observation)
            }
            _ if !told.is_empty() => {
                return Err(wrong(
                    format!("the ado in `{}` is not told parameters", self.0.display()),
                    "leave out `told`",
                ));
            }
            _ => (run.policy().map_err(failed)?, world.spaces().observation),
        };
        Ok(RawPolicy {
            policy,
            observation,
        })
    }
}

impl RawRun {
    fn open(&self) -> PyResult<RunDir> {
        RunDir::open(&self.0).map_err(failed)
    }

    fn scenario(&self) -> PyResult<Scenario> {
        self.open()?.scenario().map_err(failed)
    }
}
