//! Signal Temporal Logic over arrays that Python owns.

use std::sync::{Arc, Mutex, PoisonError};

use brakecheck::stl::{
    Formula, Interval, Monitor, Names, OnlineMonitor, Samples, Scratch, Settings, StlError,
    TraceEnd, Until,
};
use brakecheck::trace::{Schema, Signal};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::convert::objects;
use crate::error::{raised, wrong};

/// Column with its name, its kind (true if Boolean) and its samples.
type Column<'py> = (String, bool, PyReadonlyArray1<'py, f64>);

/// Formula of `brakecheck.stl.Formula`.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawFormula {
    text: String,
    formula: Formula,
    names: Names,
    settings: Settings,
}

/// Draws a mistake as in a terminal.
fn refused(text: &str, error: &StlError) -> PyErr {
    // An error inside a named formula has its place in that text and not in this one.
    let place = error.formula().map_or(text, |_| "");
    let drawn = if place.is_empty() && !text.is_empty() {
        error.to_string()
    } else {
        error.render(text)
    };
    raised("FormulaError", drawn)
}

fn parsed(text: &str) -> PyResult<Formula> {
    text.parse().map_err(|error| refused(text, &error))
}

#[pymethods]
impl RawFormula {
    #[new]
    fn new(
        text: String,
        constants: Vec<(String, f64)>,
        formulas: Vec<(String, String)>,
        until: &str,
        end: &str,
        rho_max: Option<f64>,
    ) -> PyResult<RawFormula> {
        let formula = parsed(&text)?;
        let formulas = formulas
            .into_iter()
            .map(|(name, text)| Ok((name, parsed(&text)?)));
        // A NaN would make every comparison with the constant undefined.
        if let Some((name, value)) = constants.iter().find(|(_, value)| !value.is_finite()) {
            let what = format!("the constant `{name}` is {value}");
            return Err(wrong(what, "constants are finite numbers"));
        }
        let settings = Settings {
            until: match until {
                "half-open" => Until::HalfOpen,
                "closed" => Until::Closed,
                other => return Err(unknown("until", other, "half-open, closed")),
            },
            end: match end {
                "truncate" => TraceEnd::Truncate,
                "hold" => TraceEnd::Hold,
                "strict" => TraceEnd::Strict,
                other => return Err(unknown("end", other, "truncate, hold, strict")),
            },
            rho_max,
            ..Settings::default()
        };
        Ok(RawFormula {
            text,
            formula,
            names: Names {
                constants: constants.into_iter().collect(),
                formulas: formulas.collect::<PyResult<_>>()?,
            },
            settings,
        })
    }

    fn __str__(&self) -> String {
        self.formula.to_string()
    }

    /// Returns the robustness at the first sample.
    fn robustness(&self, py: Python<'_>, columns: Vec<Column<'_>>, dt_s: f64) -> PyResult<f64> {
        self.over(&columns, dt_s, |monitor, samples| {
            py.detach(|| monitor.robustness_of(samples, &mut Scratch::new()))
        })
    }

    /// Returns true if the formula holds at the first sample, ties included.
    fn satisfied(&self, py: Python<'_>, columns: Vec<Column<'_>>, dt_s: f64) -> PyResult<bool> {
        self.over(&columns, dt_s, |monitor, samples| {
            py.detach(|| monitor.satisfied_of(samples, &mut Scratch::new()))
        })
    }

    /// Returns the robustness at every sample.
    fn robustness_all<'py>(
        &self,
        py: Python<'py>,
        columns: Vec<Column<'_>>,
        dt_s: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let all = self.over(&columns, dt_s, |monitor, samples| {
            py.detach(|| {
                let mut all = Vec::new();
                monitor.robustness_of_all(samples, &mut all);
                all
            })
        })?;
        Ok(all.into_pyarray(py))
    }

    /// Returns the deciding leaf: the fields of an explanation, and its text.
    fn explain<'py>(
        &self,
        py: Python<'py>,
        columns: Vec<Column<'_>>,
        dt_s: f64,
    ) -> PyResult<(Bound<'py, PyAny>, f64, String)> {
        let found = self.over(&columns, dt_s, |monitor, samples| {
            py.detach(|| monitor.explain_of(samples))
        })?;
        Ok((objects(py, &found)?, found.robustness, found.to_string()))
    }

    /// Returns a monitor that takes rows in turn.
    fn monitor(
        &self,
        signals: Vec<(String, bool)>,
        dt_s: f64,
        samples: Option<usize>,
    ) -> PyResult<RawMonitor> {
        let schema = schema(signals.into_iter(), dt_s)?;
        let monitor = self.bind(&schema)?;
        let online = match samples {
            // With a known end, windows are cut there and bounds close earlier.
            Some(samples) => monitor.online_for(samples),
            None => monitor.online(),
        };
        Ok(RawMonitor(Mutex::new(online)))
    }
}

impl RawFormula {
    fn bind(&self, schema: &Schema) -> PyResult<Monitor> {
        let bound = self.formula.bind_with(schema, &self.names, &self.settings);
        bound.map_err(|error| refused(&self.text, &error))
    }

    /// Borrows the columns of the formula in place.
    fn over<T>(
        &self,
        columns: &[Column<'_>],
        dt_s: f64,
        look: impl FnOnce(&Monitor, &Samples<'_>) -> T,
    ) -> PyResult<T> {
        let named = |(name, boolean, _): &Column<'_>| (name.clone(), *boolean);
        let whole = schema(columns.iter().map(named), dt_s)?;
        // What the formula does not read may be of any length, and hold a NaN.
        let mentioned: Vec<&Column<'_>> = self
            .bind(&whole)?
            .signals()
            .into_iter()
            .map(|at| &columns[at])
            .collect();
        // A formula that reads nothing still needs to know how many samples.
        let read = if mentioned.is_empty() {
            columns.iter().collect()
        } else {
            mentioned
        };
        let schema = Arc::new(schema(read.iter().map(|column| named(column)), dt_s)?);
        let monitor = self.bind(&schema)?;
        let slices = read.iter().map(|(_, _, values)| Ok(values.as_slice()?));
        let samples = Samples::new(schema, slices.collect::<PyResult<_>>()?).map_err(|error| {
            wrong(
                error.to_string(),
                "a run has one finite number per signal and sample",
            )
        })?;
        Ok(look(&monitor, &samples))
    }
}

fn unknown(what: &str, given: &str, known: &str) -> PyErr {
    wrong(
        format!("`{what}={given:?}` is not known"),
        format!("known: {known}"),
    )
}

fn schema(signals: impl Iterator<Item = (String, bool)>, dt_s: f64) -> PyResult<Schema> {
    let signals = signals.map(|(name, boolean)| {
        if boolean {
            Signal::boolean(name, "from Python")
        } else {
            // Columns of arrays have no unit that a formula could be checked against.
            Signal::real(name, "", "from Python")
        }
    });
    Schema::new(dt_s, signals).map_err(|error| {
        let help = "name every signal once, and give `dt` in seconds, above 0";
        wrong(error.to_string(), help)
    })
}

/// Monitor of `brakecheck.stl.Monitor`, which takes rows in turn.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawMonitor(Mutex<OnlineMonitor>);

#[pymethods]
impl RawMonitor {
    /// Takes the next sample, and returns the interval of possible values.
    fn push(&self, row: Vec<f64>) -> PyResult<(f64, f64)> {
        let pushed = self.lock().push(&row);
        let Interval { lo, hi } = pushed.map_err(|error| {
            let help = "the monitor is as it was before: push a whole row of finite numbers";
            wrong(error.to_string(), help)
        })?;
        Ok((lo, hi))
    }

    /// Takes several samples, one per row, and returns what is still possible after each.
    ///
    /// A wrong row refuses all of them.
    fn push_many<'py>(
        &self,
        py: Python<'py>,
        rows: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (count, signals) = (rows.shape()[0], rows.shape()[1]);
        let values = rows.as_slice()?;
        let mut monitor = self.lock();
        // Rows go into a copy, so that a wrong one leaves the monitor unchanged.
        let mut pushed = monitor.clone();
        let mut ends = Vec::with_capacity(2 * count);
        // By index, because a formula that reads nothing has rows without a value.
        for at in 0..count {
            let row = &values[at * signals..(at + 1) * signals];
            let Interval { lo, hi } = pushed.push(row).map_err(|error| {
                let help = "the monitor is as it was before: push whole rows of finite numbers";
                wrong(error.to_string(), help)
            })?;
            ends.extend([lo, hi]);
        }
        *monitor = pushed;
        ends.into_pyarray(py).reshape([count, 2])
    }

    /// Ends the run, and returns its robustness.
    fn finish(&self) -> f64 {
        self.lock().finish()
    }

    /// Forgets all samples.
    fn reset(&self) {
        self.lock().reset();
    }

    fn __len__(&self) -> usize {
        self.lock().len()
    }
}

impl RawMonitor {
    fn lock(&self) -> std::sync::MutexGuard<'_, OnlineMonitor> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
