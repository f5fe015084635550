//! Kept counterexamples: replays, pictures, files for other tools.

use std::path::PathBuf;
use std::sync::Arc;

use brakecheck::cli::Failure;
use brakecheck::crashes::{PictureFormat, Regressions, Replayed, ViewKind, export, picture_as};
use brakecheck::ego::ReferenceDriver;
use brakecheck::run_dir::write_output;
use brakecheck::view;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};
use serde_json::json;

use crate::bench::columns;
use crate::convert::objects;
use crate::ego::{factory, is_python};
use crate::error::{failed, raised, wrong};
use crate::watch::{Running, interruptible};

/// Kept files to replay, and the ego.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct ReplayOptions {
    path: PathBuf,
    episode: Option<String>,
    ego: Option<Py<PyAny>>,
    allow_programs: bool,
}

/// Plays kept counterexamples again.
#[pyfunction]
pub(crate) fn replay_kept(
    py: Python<'_>,
    options: ReplayOptions,
    running: Running,
) -> PyResult<Vec<RawReplayed>> {
    let mut found = Regressions::find(&options.path, options.episode.as_deref())
        .map_err(failed)?
        .allow_programs(options.allow_programs)
        .allow_invalid(running.allow_invalid);
    let ego = options.ego.as_ref().map(|ego| ego.bind(py));
    let mut requested_ego = None;
    if let Some(ego) = ego.filter(|ego| is_python(Some(ego))) {
        let (name, factory) = factory(ego)?;
        found = found.with_ego(&name, factory);
        requested_ego = Some(name);
    } else if let Some(ego) = ego.filter(|ego| !ego.is_none()) {
        let (name, command) = match ego.cast::<PyString>() {
            Ok(name) => (Some(name.to_cow()?.into_owned()), Vec::new()),
            Err(_) => (None, ego.extract::<Vec<String>>()?),
        };
        found = found.against(name.as_deref(), &command).map_err(failed)?;
        requested_ego = Some(name.map_or_else(|| command.join(" "), |name| stem(&name)));
    }
    // Names are read now, because the files move into the other thread below.
    let recorded = found
        .kept()
        .iter()
        .map(|kept| stem(&kept.counterexample.ego));
    let egos: Vec<String> = recorded
        .map(|recorded| requested_ego.clone().unwrap_or(recorded))
        .collect();
    let replayed = running
        .watched(py, move |_| {
            // Recorded commands repeat a foreign ego, so its program need not be
            // installed.
            let replayed = if found.is_recorded_ego() {
                found.replay_recorded()?
            } else {
                found.replay()?
            };
            found.check_faults(&replayed)?;
            Ok(replayed)
        })?
        .into_iter()
        .zip(egos);
    let raw = |(replayed, ego)| RawReplayed {
        replayed: Arc::new(replayed),
        ego,
    };
    Ok(replayed.map(raw).collect())
}

/// Replay of a counterexample, for `brakecheck.Replayed`.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawReplayed {
    replayed: Arc<Replayed>,
    /// Name of the ego under test.
    ego: String,
}

#[pymethods]
impl RawReplayed {
    /// Returns its info.
    fn about<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let Replayed {
            path,
            scenario,
            episode,
            identical,
            ..
        } = &*self.replayed;
        let start = scenario
            .axes()
            .into_iter()
            .zip(&episode.start.0)
            .map(|(axis, value)| (axis.name, json!(value)));
        let differs = self.replayed.first_difference.as_ref();
        objects(
            py,
            &json!({
                "path": path, "world": scenario.name(), "identical": identical,
                "still_fails": self.replayed.still_fails(), "outcome": self.replayed.outcome(),
                "no_answer": self.replayed.no_answer().map(|why| why.to_string()), "verdict": episode.verdict.word(),
                "robustness": episode.robustness, "contact": episode.contact,
                "fault": episode.fault, "noise": episode.noise, "actions": episode.actions,
                "start": start.collect::<serde_json::Map<_, _>>(),
                "first_difference": differs.map(|differs| differs.to_string()),
                "about": self.replayed.known().to_string(), "words": self.replayed.in_words(),
            }),
        )
    }

    /// Returns its samples, by signal.
    fn trace<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        columns(py, &self.replayed.episode.trace)
    }

    /// Writes it as a recording for the rerun viewer, or as a picture.
    fn view(&self, py: Python<'_>, output: PathBuf, beside: Option<&str>) -> PyResult<()> {
        let kind = ViewKind::of(&output).map_err(failed)?;
        let beside = beside.map(driver_of).transpose()?;
        if beside.is_some() && kind == ViewKind::Recording {
            return Err(wrong(
                "`beside` is for pictures",
                "name one to write, such as \"crash.svg\"",
            ));
        }
        self.admit()?;
        let (replayed, ego) = (self.replayed.clone(), self.ego.clone());
        let write = move |_: &_| -> Result<(), Failure> {
            if let ViewKind::Picture(format) = kind {
                let bytes = picture_as(format, &replayed, &ego, beside)?;
                return Ok(write_output(&output, &bytes)?);
            }
            let caption = replayed.path.display().to_string();
            let (scenario, episode) = (&replayed.scenario, &replayed.episode);
            match view::record(scenario, episode, &caption, &output) {
                Ok(_) => Ok(()),
                Err(error) => {
                    let help = Some(error.help().to_owned());
                    Err(Failure::fault(error.to_string(), help))
                }
            }
        };
        interruptible(py, write, |_| Ok(()))?.map_err(failed)
    }

    /// Returns the bytes of its picture: "svg" plays, "png" is a still.
    fn picture<'py>(&self, py: Python<'py>, format: &str) -> PyResult<Bound<'py, PyBytes>> {
        let format = match format {
            // Notebooks ask for these two only.
            "png" => PictureFormat::Png,
            _ => PictureFormat::Svg,
        };
        self.admit()?;
        let (replayed, ego) = (self.replayed.clone(), self.ego.clone());
        let draw = move |_: &_| -> Result<Vec<u8>, Failure> {
            Ok(picture_as(format, &replayed, &ego, None)?)
        };
        let bytes = interruptible(py, draw, |_| Ok(()))?.map_err(failed)?;
        Ok(PyBytes::new(py, &bytes))
    }
}

impl RawReplayed {
    /// Refuses an episode that did not run.
    fn admit(&self) -> PyResult<()> {
        let Some(fault) = self.replayed.fault() else {
            return Ok(());
        };
        let message = format!("there is nothing to see: {fault}");
        Err(failed(Failure::fault(message, None)))
    }
}

/// Name of an ego, without folder and extension where a file describes it.
fn stem(name: &str) -> String {
    let Some(file) = name.strip_suffix(".ron") else {
        return name.to_owned();
    };
    let last = file.rsplit(std::path::is_separator).next();
    last.unwrap_or(file).to_owned()
}

fn driver_of(name: &str) -> PyResult<ReferenceDriver> {
    name.parse().map_err(|_| {
        wrong(
            format!("`beside={name:?}` is not known"),
            "known: the drivers of `brakecheck view --help`",
        )
    })
}

/// Writes kept counterexamples as OpenSCENARIO and OpenDRIVE, and returns the files.
#[pyfunction]
pub(crate) fn export_kept(
    py: Python<'_>,
    path: PathBuf,
    directory: PathBuf,
) -> PyResult<Vec<PathBuf>> {
    let write = move |_: &_| -> Result<_, Failure> {
        let kept = Regressions::find(&path, None)?;
        Ok(export(&kept, &directory)?)
    };
    let exported = interruptible(py, write, |_| Ok(()))?.map_err(failed)?;
    // Files that were written stay, and the exception names only the others.
    if exported.refused.is_empty() {
        Ok(exported.files)
    } else {
        let why: Vec<String> = exported.refused.iter().map(ToString::to_string).collect();
        Err(raised("InputError", why.join("\n")))
    }
}
