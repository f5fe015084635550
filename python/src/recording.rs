//! Recordings from arrays that Python owns.

use brakecheck::recorded_world;
use brakecheck_traffic::{
    Analysis, BoundRules, Class, ReadError, RecordedWorlds, RecordingColumns, SituationKind,
    SituationPlan, SituationRoad, SourceFile, TrafficRecording, TrafficRule, TrafficRuleFile,
    svg_overview,
};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::convert::objects;
use crate::error::{raised, wrong};

/// Numbers of a column.
type Numbers<'py> = PyReadonlyArray1<'py, f64>;
/// Texts of a column: the distinct texts, and for each row the position of its text.
type Texts<'py> = (Vec<String>, PyReadonlyArray1<'py, i64>);

/// Recording of `brakecheck.recordings.Recording`.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawRecording(Analysis);

/// Columns besides identities, times and places.
#[derive(FromPyObject)]
struct MoreColumns<'py> {
    #[pyo3(item)]
    heading_rad: Option<Numbers<'py>>,
    #[pyo3(item)]
    speed_mps: Option<Numbers<'py>>,
    #[pyo3(item)]
    size_m: Option<(Numbers<'py>, Numbers<'py>)>,
    #[pyo3(item)]
    classes: Option<Texts<'py>>,
}

fn refused(error: &ReadError) -> PyErr {
    wrong(error.to_string(), error.help())
}

/// Returns the text of every row.
fn rows<T: Copy>(texts: &[T], at: &PyReadonlyArray1<'_, i64>) -> PyResult<Vec<T>> {
    // Texts come once with positions, because millions of Python strings would be slow to
    // convert.
    let at = at.as_slice()?.iter();
    let text = |at: &i64| {
        usize::try_from(*at)
            .ok()
            .and_then(|at| texts.get(at))
            .copied()
    };
    let rows = at.map(text).collect::<Option<Vec<T>>>();
    rows.ok_or_else(|| wrong("a row has no text", "pass positions of texts"))
}

fn class(name: &str) -> PyResult<Class> {
    let known = || Class::ALL.map(Class::name).join(", ");
    let class = Class::ALL.into_iter().find(|it| it.name() == name);
    class.ok_or_else(|| {
        wrong(
            format!("unknown class `{name}`"),
            format!("known: {}", known()),
        )
    })
}

#[pymethods]
impl RawRecording {
    #[new]
    fn new(
        py: Python<'_>,
        name: &str,
        ids: Texts<'_>,
        times_s: Numbers<'_>,
        places_m: (Numbers<'_>, Numbers<'_>),
        more: MoreColumns<'_>,
    ) -> PyResult<RawRecording> {
        let names: Vec<&str> = ids.0.iter().map(String::as_str).collect();
        let ids = rows(&names, &ids.1)?;
        let classes = more
            .classes
            .map(|(names, at)| {
                let classes: Vec<Class> =
                    names.iter().map(|it| class(it)).collect::<PyResult<_>>()?;
                rows(&classes, &at)
            })
            .transpose()?;
        let (x_m, y_m) = (places_m.0.as_slice()?, places_m.1.as_slice()?);
        let mut columns = RecordingColumns::new(&ids, times_s.as_slice()?, x_m, y_m);
        columns.heading_rad = more
            .heading_rad
            .as_ref()
            .map(|it| it.as_slice())
            .transpose()?;
        columns.speed_mps = more
            .speed_mps
            .as_ref()
            .map(|it| it.as_slice())
            .transpose()?;
        columns.size_m = match &more.size_m {
            Some((length_m, width_m)) => Some((length_m.as_slice()?, width_m.as_slice()?)),
            None => None,
        };
        columns.classes = classes.as_deref();
        let analysis =
            py.detach(|| TrafficRecording::from_columns(name, &columns).map(Analysis::of));
        Ok(RawRecording(analysis.map_err(|error| refused(&error))?))
    }

    /// Returns the output of `log --json` for a recording.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        objects(py, &self.0.summary())
    }

    /// Returns the output of `stl --log --json`, for the text of a rule file or a formula.
    fn rules<'py>(
        &self,
        py: Python<'py>,
        text: &str,
        is_file: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let file = if is_file {
            let text = match text {
                // The shipped rules have a name and no file, as on the command line.
                "motorway" => TrafficRuleFile::motorway_text(),
                text => text,
            };
            TrafficRuleFile::parse(text).map_err(|error| wrong(error.to_string(), error.help()))?
        } else {
            TrafficRuleFile::of(vec![TrafficRule {
                name: text.to_owned(),
                stl: text.to_owned(),
            }])
        };
        let Analysis {
            recording,
            frame,
            leads,
            ..
        } = &self.0;
        let bound = BoundRules::bind(&file, recording)
            .map_err(|error| wrong(error.to_string(), error.help()))?;
        let results: Vec<_> = py
            .detach(|| bound.evaluate(recording, frame, leads))
            .map_err(|error| wrong(error.to_string(), error.help()))?
            .iter()
            .map(|it| it.summary())
            .collect();
        objects(py, &results)
    }

    /// Returns worlds as `new --from-log` writes them: names, texts and situations.
    fn worlds<'py>(
        &self,
        py: Python<'py>,
        named: (String, String),
        count: usize,
        others: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (name, kind) = (&*named.0, &*named.1);
        let kind = match kind {
            "following" => SituationKind::Following,
            "cut-in" => SituationKind::CutIn,
            "crossing" => SituationKind::Crossing,
            _ => {
                return Err(wrong(
                    format!("unknown kind `{kind}`"),
                    "known: following, cut-in, crossing",
                ));
            }
        };
        let analyses = std::slice::from_ref(&self.0);
        let found = py.detach(|| RecordedWorlds::with_others(name, kind, analyses, count, others));
        let worlds = found.worlds.iter().map(|world| {
            let text = recorded_world::world_of(world).text();
            let text = text.map_err(|error| raised("FaultError", error.to_string()))?;
            let situations: Vec<Value> = world.situations.iter().map(situation).collect();
            Ok(json!({ "name": world.name, "text": text, "situations": situations }))
        });
        objects(py, &worlds.collect::<PyResult<Vec<_>>>()?)
    }

    /// Returns the recording from above as SVG.
    fn picture(&self, py: Python<'_>) -> String {
        py.detach(|| svg_overview(&self.0))
    }
}

fn situation(plan: &SituationPlan) -> Value {
    let pet_s = match &plan.road {
        SituationRoad::Crossing(roads) => Some(roads.pet_s),
        _ => None,
    };
    json!({
        "time_s": plan.time_s, "replaced": plan.replaced, "planned": plan.planned,
        "worst_m": plan.speed.worst_m, "hardest_mps2": plan.speed.hardest_mps2(),
        "worst_lateral_m": plan.across.map(|it| it.worst_m), "pet_s": pet_s,
        "others": plan.others.iter().map(|it| &it.id).collect::<Vec<_>>(),
    })
}

/// Fits a model of natural driving, and returns its file's text and the model.
#[pyfunction]
pub(crate) fn fit_traffic<'py>(
    py: Python<'py>,
    name: &str,
    recordings: Vec<PyRef<'py, RawRecording>>,
) -> PyResult<(String, Bound<'py, PyAny>)> {
    // Cloned, because a borrowed object of Python needs the lock that the fit releases.
    let analyses: Vec<Analysis> = recordings.iter().map(|it| it.0.clone()).collect();
    let sources = analyses
        .iter()
        .map(|it| SourceFile {
            name: it.recording.name.clone(),
            // Arrays have no file whose hash could be compared.
            sha256: None,
        })
        .collect();
    let model = py
        .detach(|| brakecheck_traffic::fit_traffic(name, sources, &analyses))
        .map_err(|error| wrong(error.to_string(), error.help()))?;
    Ok((model.to_ron(), objects(py, &model)?))
}
