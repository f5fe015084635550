//! Traces from CSV: a header of signal names, then one line per sample.
//!
//! The time column is known by its name, such as `time [s]`, `timestamp` or `sim_time`.
//! Its times are numbers or ISO 8601 dates, which count from the first sample.
//! It must be even within the rounding of its stamps, and determines the sampling
//! period. Columns of `true` and `false` are Boolean signals. All other values must be
//! finite numbers. Otherwise the error states the line.

mod error;
#[cfg(test)]
mod tests;
mod time;

use std::fmt;
use std::sync::Arc;

use brakecheck_stl::sampling::rate_of;
use brakecheck_stl::table::{Decimals, DelimitedTable, TableError, is_value, parse_iso};

use super::counted;
pub use error::SamplesError;
use time::{StampColumn, TimeFit, TimeIndex, UNEVEN, digits_of, time_columns};

use crate::trace::{Schema, Signal, Trace};

/// Greatest period in seconds of which six decimals show too little.
const SHORT_S: f64 = 1e-4;

/// Options of the reading of a trace.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TraceOptions<'a> {
    /// Sampling period in seconds, by default that of the time column.
    pub dt_s: Option<f64>,
    /// Name of the time column, by default the column that has the name of a time.
    pub time: Option<&'a str>,
}

/// Trace with the origin of its period.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadTrace {
    /// The trace.
    pub trace: Trace,
    /// Name of the time column, `None` if the period was given instead.
    pub time: Option<String>,
    /// Largest distance of a stamp from even sampling in seconds.
    pub off_s: f64,
    /// First instant as the file writes it, `None` where times are numbers.
    pub since: Option<String>,
}

/// One line: time column, samples, period and signals.
impl fmt::Display for ReadTrace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dt_s = self.trace.dt_s();
        let samples = counted(self.trace.len(), "sample");
        match &self.time {
            Some(name) => write!(f, "time `{name}`: {samples}")?,
            None => write!(f, "no time column: {samples}")?,
        }
        if self.time.is_some() && self.trace.len() == 1 {
            write!(f, ", and the period is taken as {dt_s} s")?;
        } else if dt_s < SHORT_S {
            write!(f, " at {dt_s:.3e} s ({})", rate_of(dt_s))?;
        } else {
            write!(f, " at {dt_s:.6} s ({})", rate_of(dt_s))?;
        }
        if let Some(since) = &self.since {
            write!(f, ", dates since {since}")?;
        }
        // Below this share the stamps count as even, and no rounding is worth a word.
        if self.off_s > UNEVEN * dt_s {
            write!(f, ", stamps rounded by up to {:.6} s", self.off_s)?;
        }
        Ok(())
    }
}

/// Reads a trace from CSV text.
///
/// The sampling period is `dt_s` if given, otherwise that of the time column. Lines
/// count from 1, including the header.
///
/// # Errors
///
/// Returns an error with the line of the problem.
pub fn trace_of_csv(text: &str, dt_s: Option<f64>) -> Result<Trace, SamplesError> {
    let options = TraceOptions { dt_s, time: None };
    read_trace(text, &options).map(|read| read.trace)
}

/// Reads a trace from CSV text with options, and describes its time.
///
/// # Errors
///
/// Returns an error with the line of the problem.
pub fn read_trace(text: &str, options: &TraceOptions<'_>) -> Result<ReadTrace, SamplesError> {
    let mut table = DelimitedTable::open(text.as_bytes(), None).map_err(table_error)?;
    let names = table.names().to_vec();
    check_names(&names)?;
    let mut samples = SampleTable::new(names, options, table.decimals())?;
    let mut record = csv::ByteRecord::new();
    while table.read(&mut record).map_err(table_error)? {
        samples.push(&record)?;
    }
    samples.read(options.dt_s)
}

fn table_error(error: TableError) -> SamplesError {
    match error {
        TableError::Ragged { line, got, want } => SamplesError::Ragged {
            line: line as usize,
            got,
            want,
        },
        other => SamplesError::Csv(other.to_string()),
    }
}

/// Returns true if all fields are numbers, truth values or instants.
fn is_values<'a>(mut fields: impl Iterator<Item = &'a str>) -> bool {
    fields.all(is_value)
}

fn check_names(names: &[String]) -> Result<(), SamplesError> {
    if names.is_empty() || names.iter().all(String::is_empty) {
        return Err(SamplesError::Empty);
    }
    // The first column may be the index of a data frame, whose name is empty.
    if let Some(column) = names.iter().skip(1).position(String::is_empty) {
        return Err(SamplesError::NoName { column: column + 2 });
    }
    // Names may have blanks in them, and values have not.
    if let [only] = names
        && only.contains(' ')
        && is_values(only.split_whitespace())
    {
        return Err(SamplesError::Blanks);
    }
    // Such a line is the first sample, and it would be lost as a header.
    if is_values(names.iter().map(String::as_str)) {
        return Err(SamplesError::NoHeader { line: 1 });
    }
    Ok(())
}

/// Numbers read so far, with the line of each sample.
struct SampleTable {
    names: Vec<String>,
    times: Vec<TimeIndex>,
    /// Most digits behind the point in each time column.
    digits: Vec<usize>,
    /// First date in each time column, `None` where times are numbers.
    since: Vec<Option<FirstDate>>,
    decimals: Decimals,
    boolean: Vec<bool>,
    rows: Vec<Vec<f64>>,
    lines: Vec<usize>,
}

/// First date of a time column.
struct FirstDate {
    /// Seconds since 1970, as whole seconds and a rest.
    instant_s: (i64, f64),
    text: String,
}

impl SampleTable {
    fn new(
        mut names: Vec<String>,
        options: &TraceOptions<'_>,
        decimals: Decimals,
    ) -> Result<SampleTable, SamplesError> {
        let times = time_columns(&mut names, options.time, options.dt_s.is_none())?;
        Ok(SampleTable {
            // Boolean until a value is no word, so that one pass over the rows decides
            // it.
            boolean: vec![true; names.len()],
            names,
            digits: vec![0; times.len()],
            since: times.iter().map(|_| None).collect(),
            times,
            decimals,
            rows: Vec::new(),
            lines: Vec::new(),
        })
    }

    fn push(&mut self, record: &csv::ByteRecord) -> Result<(), SamplesError> {
        let line = record
            .position()
            .map_or(0, |position| position.line() as usize);
        let mut row = Vec::with_capacity(record.len());
        for (column, field) in record.iter().enumerate() {
            let time = self.times.iter().position(|it| it.column == column);
            let number = match time {
                Some(time) => self.instant(time, field),
                // The index of a data frame may be anything, and is no signal.
                None if self.names[column].is_empty() => Some(0.0),
                None => self.value(column, field),
            };
            row.push(number.ok_or_else(|| {
                let column = self.names[column].clone();
                let value = String::from_utf8_lossy(field).into_owned();
                match time {
                    Some(_) => SamplesError::NotATime {
                        line,
                        column,
                        value,
                    },
                    None => SamplesError::NotANumber {
                        line,
                        column,
                        value,
                    },
                }
            })?);
        }
        self.rows.push(row);
        self.lines.push(line);
        Ok(())
    }

    /// Returns a number or a truth value.
    fn value(&mut self, column: usize, field: &[u8]) -> Option<f64> {
        let word = match field.to_ascii_lowercase().as_slice() {
            b"true" => Some(1.0),
            b"false" => Some(0.0),
            _ => None,
        };
        // A column is Boolean only if all its values are words.
        self.boolean[column] &= word.is_some();
        word.or_else(|| self.decimals.number(field))
    }

    /// Returns a time as a number, that of a date since the first one.
    fn instant(&mut self, time: usize, field: &[u8]) -> Option<f64> {
        let index = &mut self.times[time];
        // Times never pass `value`, which clears this mark for other columns.
        self.boolean[index.column] = false;
        let text = std::str::from_utf8(field).ok()?;
        self.digits[time] = self.digits[time].max(digits_of(text));
        if self.since[time].is_none() {
            if let Some(number) = self.decimals.number(field) {
                return Some(number);
            }
            // After a number, a date has no first one to count from.
            let instant_s = parse_iso(text).filter(|_| self.rows.is_empty())?;
            index.unit_s = 1.0;
            self.since[time] = Some(FirstDate {
                instant_s,
                text: text.to_owned(),
            });
        }
        let (whole_s, rest_s) = parse_iso(text)?;
        let (first_s, first_rest_s) = self.since[time].as_ref()?.instant_s;
        // Integers are subtracted first, because seconds since 1970 cost an `f64` its
        // small digits.
        Some((whole_s - first_s) as f64 + (rest_s - first_rest_s))
    }

    fn read(self, dt_s: Option<f64>) -> Result<ReadTrace, SamplesError> {
        if self.rows.is_empty() {
            return Err(SamplesError::NoSample);
        }
        let time = self.time(dt_s)?;
        // Only the first name may be empty, that of an index.
        let index = usize::from(self.names[0].is_empty());
        let signals = self.names.iter().zip(&self.boolean).enumerate().skip(index);
        // A time column keeps its values, so the trace has it as a signal too.
        let column = self.times.first().map(|it| (it.column, it.unit_s));
        let signals = signals.map(|(i, (name, boolean))| match (boolean, column) {
            (true, _) => Signal::boolean(name, "read from CSV"),
            // Stamps of another unit keep their numbers, so their signal does not claim
            // seconds.
            (_, Some((at, 1.0))) if at == i => Signal::real(name, "s", "time"),
            _ => Signal::real(name, "", "read from CSV"),
        });
        // A single row has no period, and any would do.
        let schema = Schema::new(dt_s.or(time.map(|it| it.dt_s)).unwrap_or(1.0), signals)?;
        let mut trace = Trace::new(Arc::new(schema));
        for row in &self.rows {
            // Invariant: every value was checked when it was read.
            trace
                .push(&row[index..])
                .map_err(|error| SamplesError::Csv(error.to_string()))?;
        }
        Ok(ReadTrace {
            trace,
            time: column.map(|(at, _)| self.names[at].clone()),
            off_s: time.map_or(0.0, |it| it.off_s),
            since: self
                .since
                .first()
                .and_then(|it| Some(it.as_ref()?.text.clone())),
        })
    }

    /// Returns the sampling of the time columns, `None` without one or for one sample.
    fn time(&self, dt_s: Option<f64>) -> Result<Option<TimeFit>, SamplesError> {
        // One time has no period to fit.
        if self.rows.len() < 2 {
            return Ok(None);
        }
        let mut first: Option<TimeFit> = None;
        for (time, digits) in self.times.iter().zip(&self.digits) {
            let column = StampColumn {
                name: &self.names[time.column],
                times_s: self.times_s(time),
                unit_s: time.unit_s,
                digits: *digits,
                lines: &self.lines,
            };
            let fit = match column.fit() {
                Ok(fit) => fit,
                // Only the column with the most usual name must be the time.
                Err(_) if first.is_some() => continue,
                Err(error) => return Err(error),
            };
            match first {
                None => first = Some(fit),
                Some(before) if UNEVEN * before.dt_s < (fit.dt_s - before.dt_s).abs() => {
                    return Err(SamplesError::TwoTimes {
                        first: self.names[self.times[0].column].clone(),
                        second: self.names[time.column].clone(),
                    });
                }
                Some(_) => {}
            }
        }
        if let (Some(given_s), Some(fit)) = (dt_s, first)
            && UNEVEN * fit.dt_s < (given_s - fit.dt_s).abs()
        {
            return Err(SamplesError::Period {
                given_s,
                column_s: fit.dt_s,
            });
        }
        Ok(first)
    }

    fn times_s(&self, time: &TimeIndex) -> Vec<f64> {
        let rows = self.rows.iter();
        rows.map(|row| row[time.column] * time.unit_s).collect()
    }
}
