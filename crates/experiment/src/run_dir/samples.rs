//! Traces from CSV: a header of signal names, then one line per sample.
//!
//! The time column is known by its name, such as `time [s]`, `timestamp` or `sim_time`.
//! Its times are numbers or ISO 8601 dates, which count from the first sample.
//! It must be even within the rounding of its stamps, and determines the sampling
//! period. Columns of `true` and `false` are Boolean signals. All other values must be
//! finite numbers. Otherwise the error states the line.

use std::fmt;
use std::sync::Arc;

use brakecheck_stl::sampling::{EvenSampling, MOST_OFF, TimeName, rate_of, time_name, time_rank};
use brakecheck_stl::table::{Decimals, DelimitedTable, TableError, is_value, parse_iso};

use crate::trace::{Schema, SchemaError, Signal, Trace};

/// Deviation from even sampling that counts as none, as a share of the period.
const UNEVEN: f64 = 1e-3;

/// Digits behind the point from which stamps count as not rounded.
const FULL_DIGITS: usize = 7;

/// CSV text that is not a trace.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SamplesError {
    /// The text has no line.
    #[error("the file is empty: the first line must name the signals")]
    Empty,
    /// The text has a header and no sample.
    #[error("there is no sample below the header")]
    NoSample,
    /// A name is missing in the header.
    #[error("line 1: column {column} has no name")]
    NoName {
        /// Number of the column, from 1.
        column: usize,
    },
    /// The header is no valid schema.
    #[error("line 1: {0}")]
    Header(#[from] SchemaError),
    /// The columns are separated by blanks.
    #[error("line 1: the columns are separated by blanks, and `,`, `;` or tabs are expected")]
    Blanks,
    /// A time is no number and no date, or no date like the first one.
    #[error("line {line}, column `{column}`: `{value}` is no time")]
    NotATime {
        /// Number of the line, from 1.
        line: usize,
        /// Name of the column.
        column: String,
        /// Value in the file.
        value: String,
    },
    /// A line has more or fewer values than the header.
    #[error("line {line}: {got} values for {want} columns")]
    Ragged {
        /// Number of the line, from 1.
        line: usize,
        /// Values in the line.
        got: usize,
        /// Columns in the header.
        want: usize,
    },
    /// A value is not a finite number.
    #[error("line {line}, column `{column}`: `{value}` is no finite number")]
    NotANumber {
        /// Number of the line, from 1.
        line: usize,
        /// Name of the column.
        column: String,
        /// Value in the file.
        value: String,
    },
    /// The time does not advance evenly.
    #[error("line {line}: time {found} s where {expected} s was expected: sampling is uneven")]
    Uneven {
        /// Number of the line, from 1.
        line: usize,
        /// Time in the line.
        found: f64,
        /// Time under even sampling.
        expected: f64,
    },
    /// The time does not advance.
    #[error("line {line}: time {found} s is not later than {before} s in the sample before")]
    NotLater {
        /// Number of the line, from 1.
        line: usize,
        /// Time in the line.
        found: f64,
        /// Time of the previous sample.
        before: f64,
    },
    /// No column is a time.
    #[error("line 1: none of the columns `{columns}` is known as the time")]
    NoTime {
        /// Names in the header.
        columns: String,
    },
    /// The column that is named as the time is not there.
    #[error("line 1: there is no column `{column}` among `{columns}`")]
    NoSuchTime {
        /// Name that was given.
        column: String,
        /// Names in the header.
        columns: String,
    },
    /// Two columns are times with different periods.
    #[error("line 1: `{first}` and `{second}` are both times, with different periods")]
    TwoTimes {
        /// Name of the first one.
        first: String,
        /// Name of the other one.
        second: String,
    },
    /// The first line has values in place of names.
    #[error("line {line}: values where the names of the signals are expected")]
    NoHeader {
        /// Number of the line, from 1.
        line: usize,
    },
    /// The time column has an unknown unit.
    #[error("line 1: the times of `{column}` are in `{unit}`, which is no known unit")]
    TimeUnit {
        /// Name of the column in the header.
        column: String,
        /// Unit in the header.
        unit: String,
    },
    /// `--dt` contradicts the time column.
    #[error("the time column advances by {column_s} s, not by the given {given_s} s")]
    Period {
        /// Given period.
        given_s: f64,
        /// Period of the column.
        column_s: f64,
    },
    /// Times in seconds are those of another unit.
    #[error("the times of `{column}` are {time_s:e} s, which fits {unit}")]
    Epoch {
        /// Name of the time column.
        column: String,
        /// Greatest time in seconds.
        time_s: f64,
        /// Unit that fits.
        unit: &'static str,
    },
    /// The text is not CSV.
    #[error("{0}")]
    Csv(String),
}

impl SamplesError {
    /// Returns advice for the user.
    pub fn help(&self) -> &'static str {
        match self {
            SamplesError::NoTime { .. } | SamplesError::NoSuchTime { .. } => {
                "name the column with `--time NAME`, or state the period with `--dt SECONDS`"
            }
            SamplesError::TwoTimes { .. } => "name one of them with `--time NAME`",
            SamplesError::NoHeader { .. } => {
                "write the names above the values, such as `time,headway`"
            }
            SamplesError::Blanks => "separate names and values with `,`",
            SamplesError::NotATime { .. } => {
                "write all times as numbers or all as 2026-11-29T10:00:00.05Z, or name another \
                 column with `--time`"
            }
            SamplesError::Uneven { .. } => "resample the trace at a fixed period",
            SamplesError::NotLater { .. } => "sort the samples by time, each once",
            SamplesError::TimeUnit { .. } => {
                "use s, ms, us or ns, or convert the column to seconds"
            }
            SamplesError::Epoch { .. } => "write the unit into the header, such as `time_ms`",
            SamplesError::Period { .. } => {
                "leave out `--dt`, or name another time column with `--time`"
            }
            SamplesError::Ragged { .. } => "give every line as many values as the header has names",
            SamplesError::NotANumber { value, .. } if value.contains(',') => {
                "write all decimals with a point, or all with a comma between other separators"
            }
            SamplesError::NotANumber { .. } => "write a number such as 1.5, or true / false",
            _ => "a trace looks like `time,headway` and then `0.0,12.5`, one line per sample",
        }
    }
}

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
        let samples = self.trace.len();
        match &self.time {
            Some(name) => write!(f, "time `{name}`: {samples} samples")?,
            None => write!(f, "no time column: {samples} samples")?,
        }
        write!(f, " at {:.6} s ({})", dt_s, rate_of(dt_s))?;
        if let Some(since) = &self.since {
            write!(f, ", dates since {since}")?;
        }
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
    if is_values(names.iter().map(String::as_str)) {
        return Err(SamplesError::NoHeader { line: 1 });
    }
    Ok(())
}

/// Column of times.
struct TimeIndex {
    column: usize,
    unit_s: f64,
}

/// Returns the columns that are times by their names, the most usual name first.
fn time_columns(
    names: &mut [String],
    options: &TraceOptions<'_>,
) -> Result<Vec<TimeIndex>, SamplesError> {
    let columns = || names.join("`, `");
    if let Some(given) = options.time {
        let named = |it: &String| it == given || bare(it) == given;
        let column = names.iter().position(named);
        let column = column.ok_or_else(|| SamplesError::NoSuchTime {
            column: given.to_owned(),
            columns: columns(),
        })?;
        // A name that is no usual one is in seconds, unless it ends with its unit.
        let unit_s = known_time(&names[column])?.map_or(1.0, |it| it.unit_s);
        return Ok(vec![TimeIndex { column, unit_s }]);
    }
    let mut found = Vec::new();
    let mut shortened = Vec::new();
    for (column, name) in names.iter().enumerate() {
        if let Some(time) = known_time(name)? {
            found.push((
                time_rank(&time.name),
                TimeIndex {
                    column,
                    unit_s: time.unit_s,
                },
            ));
            shortened.push((column, time.name));
        }
    }
    if found.is_empty() && options.dt_s.is_none() {
        return Err(SamplesError::NoTime { columns: columns() });
    }
    for (column, name) in shortened {
        names[column] = name;
    }
    found.sort_by_key(|(rank, _)| *rank);
    Ok(found.into_iter().map(|(_, time)| time).collect())
}

fn bare(name: &str) -> &str {
    name.split(['[', '(']).next().unwrap_or(name).trim_end()
}

fn known_time(name: &str) -> Result<Option<TimeName>, SamplesError> {
    time_name(name).map_err(|unit| SamplesError::TimeUnit {
        column: name.to_owned(),
        unit: unit.0,
    })
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
        let times = time_columns(&mut names, options)?;
        Ok(SampleTable {
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
        Some((whole_s - first_s) as f64 + (rest_s - first_rest_s))
    }

    fn read(self, dt_s: Option<f64>) -> Result<ReadTrace, SamplesError> {
        if self.rows.is_empty() {
            return Err(SamplesError::NoSample);
        }
        let time = self.time(dt_s)?;
        let signals = self.names.iter().zip(&self.boolean).enumerate();
        // A time column keeps its values, so the trace has it as a signal too.
        let column = self.times.first().map(|it| (it.column, it.unit_s));
        let signals = signals.map(|(i, (name, boolean))| match (boolean, column) {
            (true, _) => Signal::boolean(name, "read from CSV"),
            (_, Some((at, 1.0))) if at == i => Signal::real(name, "s", "time"),
            _ => Signal::real(name, "", "read from CSV"),
        });
        let schema = Schema::new(dt_s.or(time.map(|it| it.dt_s)).unwrap_or(1.0), signals)?;
        let mut trace = Trace::new(Arc::new(schema));
        for row in &self.rows {
            // Invariant: every value was checked when it was read.
            trace
                .push(row)
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
        if self.rows.len() < 2 {
            return Ok(None);
        }
        let mut first: Option<TimeFit> = None;
        for (time, digits) in self.times.iter().zip(&self.digits) {
            let fit = match self.fit(time, *digits) {
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

    /// Fits the period of a time column, which must be even.
    fn fit(&self, time: &TimeIndex, digits: usize) -> Result<TimeFit, SamplesError> {
        let times_s: Vec<f64> = self
            .rows
            .iter()
            .map(|row| row[time.column] * time.unit_s)
            .collect();
        if let Some(error) = self.other_epoch(time, &times_s) {
            return Err(error);
        }
        let uneven = |times_s: &[f64]| self.odd_step(times_s);
        let Some(fit) = EvenSampling::fit(&times_s) else {
            return Err(uneven(&times_s));
        };
        let most_s = UNEVEN * fit.dt_s + rounding_s(&times_s, digits, time.unit_s);
        let is_even = fit.off_s <= most_s.min(MOST_OFF * fit.dt_s);
        if fit.periods as usize != times_s.len() - 1 || !is_even {
            return Err(uneven(&times_s));
        }
        Ok(TimeFit {
            dt_s: fit.dt_s,
            off_s: fit.off_s,
        })
    }

    /// Returns an error for times after the year 5000, which are those of a finer unit.
    fn other_epoch(&self, time: &TimeIndex, times_s: &[f64]) -> Option<SamplesError> {
        let time_s = times_s.iter().fold(0.0_f64, |most, it| most.max(*it));
        let units = [(1e17, "ns"), (1e14, "µs"), (1e11, "ms")];
        let (_, unit) = units.into_iter().find(|(from_s, _)| time_s > *from_s)?;
        Some(SamplesError::Epoch {
            column: self.names[time.column].clone(),
            time_s,
            unit,
        })
    }

    /// First time that does not follow from the previous time.
    ///
    /// The mean period is no reference: one long step changes it, and even
    /// samples would be reported. The median step is not affected.
    fn odd_step(&self, times_s: &[f64]) -> SamplesError {
        let steps = || times_s.windows(2).map(|two| two[1] - two[0]);
        let mut sorted: Vec<f64> = steps().collect();
        sorted.sort_by(f64::total_cmp);
        let usual_s = sorted[(sorted.len() - 1) / 2];
        let off = |step_s: f64| (step_s - usual_s).abs();
        let not_later = times_s.windows(2).position(|two| two[1] <= two[0]);
        // Rounding makes steps differ a little, so the first clear difference is named.
        let clear_s = off(steps().fold(
            usual_s,
            |worst, it| {
                if off(it) > off(worst) { it } else { worst }
            },
        ));
        let odd = steps().position(|it| off(it) >= 0.5 * clear_s && off(it) > UNEVEN * usual_s);
        let at = not_later.or(odd).unwrap_or(0);
        let (before, found, line) = (times_s[at], times_s[at + 1], self.lines[at + 1]);
        if found <= before {
            return SamplesError::NotLater {
                line,
                found,
                before,
            };
        }
        SamplesError::Uneven {
            line,
            found,
            expected: tidy(before + usual_s),
        }
    }
}

/// Period of a time column, and how far its stamps are off.
#[derive(Clone, Copy)]
struct TimeFit {
    dt_s: f64,
    off_s: f64,
}

/// Returns the distance from an instant that the notation of its stamp causes.
fn rounding_s(times_s: &[f64], digits: usize, unit_s: f64) -> f64 {
    let most_s = times_s.iter().fold(0.0_f64, |most, it| most.max(it.abs()));
    let written_s = if digits < FULL_DIGITS {
        0.51 * unit_s / f64::from(10_u32.pow(digits as u32))
    } else {
        0.0
    };
    // Single precision has 24 bits, and prints nine digits of them.
    let is_single = |it: &f64| {
        let single = *it as f32;
        f64::from(single) == *it || format!("{single}").parse() == Ok(*it)
    };
    let single_s = if times_s.iter().all(is_single) {
        most_s * f64::from(f32::EPSILON)
    } else {
        0.0
    };
    written_s.max(single_s) + 4.0 * f64::EPSILON * most_s
}

/// Returns the digits behind the point of a written number.
fn digits_of(text: &str) -> usize {
    if text.contains(['e', 'E']) {
        return FULL_DIGITS;
    }
    let behind = text.split_once(['.', ',']).map_or("", |(_, part)| part);
    behind.bytes().take_while(u8::is_ascii_digit).count()
}

/// Rounds to nine decimals, which removes the digits of binary fractions.
fn tidy(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_files_are_read() {
        let trace =
            trace_of_csv("time,x,on\n0,1,true\n0.1,2,false\n0.2,3,true\n", None).expect("a trace");
        assert_eq!(trace.dt_s(), 0.1);
        assert_eq!(trace.signal("x"), Some([1.0, 2.0, 3.0].as_slice()));
        assert_eq!(trace.signal("on"), Some([1.0, 0.0, 1.0].as_slice()));
        for header in ["time [s]", "Time (s)", "t[s]"] {
            let text = format!("{header},x\n0,1\n0.5,2\n");
            let trace = trace_of_csv(&text, None).expect(header);
            assert_eq!(trace.dt_s(), 0.5, "{header}");
            assert!(!trace.schema().signals()[0].name.contains(['[', '(', ' ']));
        }
        let trace = trace_of_csv("x, y\n1, 2\n", Some(0.5)).expect("a trace");
        assert_eq!((trace.len(), trace.dt_s()), (1, 0.5));
    }

    #[test]
    fn bad_files_name_the_line() {
        let cases = [
            ("", "empty"),
            ("t,y\n", "no sample"),
            ("x,,z\n1,2,3\n", "column 2"),
            ("t,x,x\n1,2,3\n", "declared twice"),
            ("t,y\n1,2\n3\n", "line 3: 1 values for 2 columns"),
            ("t\n1\nNaN\n", "line 3, column `t`: `NaN` is no time"),
            ("t,x\n1,inf\n", "`inf` is no finite number"),
            (
                "time x\n0 1\n",
                "none of the columns `time x` is known as the time",
            ),
            (
                "timestamp,x\n1700000000000,1\n1700000000100,1\n",
                "the times of `timestamp` are 1.7000000001e12 s, which fits ms",
            ),
            (
                "time;x\n0;1,5\n1;2.5\n",
                "line 3, column `x`: `2.5` is no finite number",
            ),
            (
                "time,x\n2026-11-29T10:00:00Z,1\n0.1,2\n",
                "line 3, column `time`: `0.1` is no time",
            ),
            (
                "time,x\n0,1\n2026-11-29T10:00:00Z,2\n",
                "line 3, column `time`: `2026-11-29T10:00:00Z` is no time",
            ),
            (
                "time,x\n10:00:00,1\n10:00:01,2\n",
                "line 2, column `time`: `10:00:00` is no time",
            ),
            ("t\n1\nabc\n", "`abc`"),
            ("t,x\n0,1\n1,1\n3,1\n", "line 4: time 3 s where 2 s was"),
            (
                "t,x\n0,1\n2,1\n3,1\n4,1\n",
                "line 3: time 2 s where 1 s was",
            ),
            (
                "t,x\n0,1\n.1,1\n.2,1\n.4,1\n",
                "line 5: time 0.4 s where 0.3 s was",
            ),
            ("t,x\n0,1\n0,1\n", "line 3: time 0 s is not later than 0 s"),
            (
                "t,x\n0,1\n1,1\n.5,1\n2,1\n",
                "line 4: time 0.5 s is not later",
            ),
            ("time [h],x\n0,1\n10,1\n", "in `h`"),
            (
                "x,y\n1,2\n",
                "none of the columns `x`, `y` is known as the time",
            ),
            ("0,1\n1,2\n", "line 1: values where the names"),
            (
                "time,stamp\n0,0\n1,2\n2,4\n",
                "`time` and `stamp` are both times",
            ),
            (
                "t,x\n0,1\n1,1\n2,1\n4,1\n5,1\n",
                "line 5: time 4 s where 3 s was",
            ),
        ];
        for (text, says) in cases {
            let error = trace_of_csv(text, None).expect_err(text).to_string();
            assert!(error.contains(says), "{text:?}: {error}");
        }
        let error = trace_of_csv("t,x\n0,1\n1,1\n", Some(0.5)).expect_err("contradiction");
        assert!(
            error.to_string().contains("not by the given 0.5 s"),
            "{error}"
        );
    }

    /// A trace of three seconds whose x is 9 at 0.8 s, with a stamp per instant.
    fn stamped(rate_hz: f64, stamp: impl Fn(f64) -> String) -> String {
        let rows = (0..=(3.0 * rate_hz) as usize).map(|i| {
            let time_s = i as f64 / rate_hz;
            let x = if (time_s - 0.8).abs() < 0.5 / rate_hz {
                9
            } else {
                0
            };
            format!("{x},{}\n", stamp(time_s))
        });
        format!("x,sim_time\n{}", rows.collect::<String>())
    }

    #[test]
    fn rounded_stamps_have_their_rate() {
        for rate_hz in [10.0, 15.0, 24.0, 30.0, 60.0, 90.0, 100.0] {
            let stamps: [&dyn Fn(f64) -> String; 8] = [
                &|t| format!("2026-11-29T10:00:{t:06.3}Z"),
                &|t| format!("2026-12-31 23:59:{:09.6}+01:00", 56.0 + t),
                &|t| format!("{t}"),
                &|t| format!("{t:.3}"),
                &|t| format!("{}", t as f32),
                &|t| format!("{}", f64::from(t as f32)),
                &|t| format!("{}", 1.7e9 + t),
                &|t| format!("{:.3}", 1.7e9 + t),
            ];
            for stamp in stamps {
                let text = stamped(rate_hz, stamp);
                let read = read_trace(&text, &TraceOptions::default())
                    .unwrap_or_else(|error| panic!("{rate_hz} Hz: {error}\n{text}"));
                assert_eq!(read.trace.dt_s(), 1.0 / rate_hz);
                assert_eq!(read.time.as_deref(), Some("sim_time"));
            }
        }
    }

    #[test]
    fn the_time_is_known_wherever_it_stands() {
        for text in [
            "# time,x\n0.0,1\n0.1,2\n0.2,3\n",
            "# made by numpy\n# time, x\n0.0,1\n0.1,2\n0.2,3\n",
            "x,TimeStamp\n1,0.0\n2,0.1\n3,0.2\n",
            "x,time_ms\n1,0\n2,100\n3,200\n",
            ",time,x\n0,0.0,1\n1,0.1,2\n2,0.2,3\n",
            "time;x\n0;1,0\n0,1;2,0\n0,2;3,0\n",
            "t\tx\n0\t1\n0.1\t2\n0.2\t3\n",
            "x,timestamp_ms\n1,2026-11-29 23:59:59.9\n2,2026-11-30 00:00:00.0\n3,2026-11-30 00:00:00.1\n",
            "epoch,x\n1700000000.0,1\n1700000000.1,2\n1700000000.2,3\n",
        ] {
            let trace = trace_of_csv(text, None).unwrap_or_else(|it| panic!("{text}: {it}"));
            assert_eq!((trace.dt_s(), trace.len()), (0.1, 3), "{text}");
            assert_eq!(
                trace.signal("x"),
                Some([1.0, 2.0, 3.0].as_slice()),
                "{text}"
            );
        }
        let named = TraceOptions {
            time: Some("k"),
            ..TraceOptions::default()
        };
        let read = read_trace("x,k\n1,0\n2,0.5\n", &named).expect("a trace");
        assert_eq!(read.trace.dt_s(), 0.5);
        let error = read_trace("x,t\n1,0\n2,0.5\n", &named).expect_err("no column k");
        assert!(
            error.to_string().contains("no column `k` among `x`, `t`"),
            "{error}"
        );
    }
}
