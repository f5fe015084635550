//! Kept counterexamples: played again, looked at, written for other tools.

use std::path::PathBuf;

use brakecheck::campaign::{Regressions, Replayed, export};
use brakecheck::cli::Failure;
use brakecheck::view;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use serde_json::json;

use crate::bench::columns;
use crate::convert::objects;
use crate::ego::{factory, is_python};
use crate::error::{failed, raised};
use crate::watch::Running;

/// Which kept files are replayed, and against whom.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct ReplayAsked {
    path: PathBuf,
    episode: Option<String>,
    ego: Option<Py<PyAny>>,
    allow_programs: bool,
}

/// Plays kept counterexamples again.
#[pyfunction]
pub(crate) fn replay_kept(
    py: Python<'_>,
    asked: ReplayAsked,
    running: Running,
) -> PyResult<Vec<RawReplayed>> {
    let found = Regressions::find(&asked.path, asked.episode.as_deref()).map_err(failed)?;
    let mut found = found
        .allow_programs(asked.allow_programs)
        .allow_invalid(running.allow_invalid);
    let ego = asked.ego.as_ref().map(|ego| ego.bind(py));
    if let Some(ego) = ego.filter(|ego| is_python(Some(ego))) {
        let (name, factory) = factory(ego)?;
        found = found.with_ego(&name, factory);
    } else if let Some(ego) = ego.filter(|ego| !ego.is_none()) {
        found = match ego.cast::<PyString>() {
            Ok(name) => found.against(Some(name.to_cow()?.as_ref()), &[]),
            Err(_) => found.against(None, &ego.extract::<Vec<String>>()?),
        }
        .map_err(failed)?;
    }
    let replayed = running.watched(py, |_| {
        let replayed = match found.is_recorded_ego() {
            true => found.replay_recorded()?,
            false => found.replay()?,
        };
        found.check_faults(&replayed)?;
        Ok(replayed)
    })?;
    Ok(replayed.into_iter().map(RawReplayed).collect())
}

/// What came of replaying one; `brakecheck.Replayed` is built on it.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawReplayed(Replayed);

#[pymethods]
impl RawReplayed {
    /// What there is to say of it.
    fn about<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let Replayed {
            path,
            scenario,
            episode,
            identical,
            ..
        } = &self.0;
        let start = scenario.axes().into_iter().zip(&episode.start.0);
        let start = start.map(|(axis, value)| (axis.name, json!(value)));
        let differs = self.0.first_difference.as_ref();
        objects(
            py,
            &json!({
                "path": path, "world": scenario.name(), "identical": identical,
                "still_fails": self.0.still_fails(), "verdict": episode.verdict.word(),
                "robustness": episode.robustness, "contact": episode.contact,
                "fault": episode.fault, "noise": episode.noise, "actions": episode.actions,
                "start": start.collect::<serde_json::Map<_, _>>(),
                "first_difference": differs.map(|differs| differs.to_string()),
                "about": self.0.about.as_ref().map(|about| about.to_string()),
            }),
        )
    }

    /// Its samples, by signal.
    fn trace<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        columns(py, &self.0.episode.trace)
    }

    /// Writes it as a recording for the rerun viewer; samples in it.
    fn view(&self, py: Python<'_>, output: PathBuf) -> PyResult<usize> {
        let caption = self.0.path.display().to_string();
        let (scenario, episode) = (&self.0.scenario, &self.0.episode);
        let recorded = py.detach(|| view::record(scenario, episode, &caption, &output));
        let recorded = recorded.map_err(|error| {
            let help = Some(error.help().to_owned());
            failed(Failure::fault(error.to_string(), help))
        })?;
        Ok(recorded.samples)
    }
}

/// Writes kept counterexamples as OpenSCENARIO and OpenDRIVE; the files.
#[pyfunction]
pub(crate) fn export_kept(
    py: Python<'_>,
    path: PathBuf,
    directory: PathBuf,
) -> PyResult<Vec<PathBuf>> {
    let exported = py.detach(|| {
        let kept = Regressions::find(&path, None)?;
        export(&kept, &directory)
    });
    let exported = exported.map_err(failed)?;
    match exported.refused.is_empty() {
        true => Ok(exported.files),
        false => {
            let why: Vec<String> = exported.refused.iter().map(ToString::to_string).collect();
            Err(raised("InputError", why.join("\n")))
        }
    }
}
