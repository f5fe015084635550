//! Traces from CSV: a header of signal names, then one line per sample.
//!
//! A first column `time` or `t`, with or without its unit (`time [s]`), is the
//! time in seconds. It must be even and determines the sampling period. Columns
//! of `true` and `false` are Boolean signals. All other values must be finite
//! numbers. Otherwise the error states the line.

use std::sync::Arc;

use crate::trace::{Schema, SchemaError, Signal, Trace};

/// Largest deviation from even sampling, as a share of the period.
const UNEVEN: f64 = 1e-3;

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
    /// The columns are not separated by commas.
    #[error("line 1: the columns are separated by {by}, and commas are expected")]
    Separator {
        /// Separator in words.
        by: &'static str,
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
    /// The time column has another unit.
    #[error("line 1: the times of `{column}` are in `{unit}`, and seconds are expected")]
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
    /// The text is not CSV.
    #[error("{0}")]
    Csv(String),
}

impl SamplesError {
    /// Returns advice for the user.
    pub fn help(&self) -> &'static str {
        match self {
            SamplesError::Separator { .. } => {
                "separate names and values with `,`, and write decimals with a point"
            }
            SamplesError::Uneven { .. } => "resample the trace at a fixed period",
            SamplesError::NotLater { .. } => "sort the samples by time, each once",
            SamplesError::TimeUnit { .. } => "convert the column to seconds and call it `time`",
            SamplesError::Period { .. } => "leave out `--dt`, or the time column",
            SamplesError::Ragged { .. } => "give every line as many values as the header has names",
            SamplesError::NotANumber { .. } => "write a number such as 1.5, or true / false",
            _ => "a trace looks like `time,headway` and then `0.0,12.5`, one line per sample",
        }
    }
}

/// Reads a trace from CSV text.
///
/// The sampling period is `dt_s` if given, otherwise that of the time column,
/// otherwise 1 s. Lines count from 1, including the header.
///
/// # Errors
///
/// Returns an error with the line of the problem.
pub fn trace_of_csv(text: &str, dt_s: Option<f64>) -> Result<Trace, SamplesError> {
    // Spreadsheets write a byte order mark, which would be part of the first
    // name.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let csv_error = |error: csv::Error| SamplesError::Csv(error.to_string());
    let names: Vec<String> = reader
        .headers()
        .map_err(csv_error)?
        .iter()
        .map(str::to_owned)
        .collect();
    if names.is_empty() || names.iter().all(String::is_empty) {
        return Err(SamplesError::Empty);
    }
    if let Some(column) = names.iter().position(String::is_empty) {
        return Err(SamplesError::NoName { column: column + 1 });
    }
    // A single name with another separator in it is a mistake, not a column.
    if let [only] = &names[..] {
        let separators = [(';', "semicolons"), ('\t', "tabs")];
        let found = separators.iter().find(|(sign, _)| only.contains(*sign));
        if let Some((_, by)) = found {
            return Err(SamplesError::Separator { by });
        }
    }
    let mut table = SampleTable::new(names)?;
    for record in reader.records() {
        table.push(&record.map_err(csv_error)?)?;
    }
    table.trace(dt_s)
}

/// Numbers read so far, with the line of each sample.
struct SampleTable {
    names: Vec<String>,
    /// True if the first column is the time.
    timed: bool,
    boolean: Vec<bool>,
    rows: Vec<Vec<f64>>,
    lines: Vec<usize>,
}

impl SampleTable {
    fn new(mut names: Vec<String>) -> Result<SampleTable, SamplesError> {
        let time = time_name(&names[0])?;
        let timed = time.is_some();
        if let Some(time) = time {
            names[0] = time;
        }
        Ok(SampleTable {
            boolean: vec![true; names.len()],
            names,
            timed,
            rows: Vec::new(),
            lines: Vec::new(),
        })
    }

    fn push(&mut self, record: &csv::StringRecord) -> Result<(), SamplesError> {
        let line = record
            .position()
            .map_or(0, |position| position.line() as usize);
        if record.len() != self.names.len() {
            return Err(SamplesError::Ragged {
                line,
                got: record.len(),
                want: self.names.len(),
            });
        }
        let mut row = Vec::with_capacity(record.len());
        for (column, value) in record.iter().enumerate() {
            let word = match value.to_ascii_lowercase().as_str() {
                "true" => Some(1.0),
                "false" => Some(0.0),
                _ => None,
            };
            // A column is Boolean only if all its values are words.
            self.boolean[column] &= word.is_some();
            let number = word.or_else(|| value.parse().ok().filter(|n: &f64| n.is_finite()));
            row.push(number.ok_or_else(|| SamplesError::NotANumber {
                line,
                column: self.names[column].clone(),
                value: value.to_owned(),
            })?);
        }
        self.rows.push(row);
        self.lines.push(line);
        Ok(())
    }

    fn trace(self, dt_s: Option<f64>) -> Result<Trace, SamplesError> {
        if self.rows.is_empty() {
            return Err(SamplesError::NoSample);
        }
        let timed = self.timed;
        let column_s = if timed && 1 < self.rows.len() {
            Some(self.period()?)
        } else {
            None
        };
        if let (Some(given_s), Some(column_s)) = (dt_s, column_s)
            && UNEVEN * column_s < (given_s - column_s).abs()
        {
            return Err(SamplesError::Period { given_s, column_s });
        }
        let signals = self.names.iter().zip(&self.boolean).enumerate();
        // A time column keeps its values, so the trace has it as a signal too.
        let signals = signals.map(|(i, (name, boolean))| match (boolean, timed && i == 0) {
            (true, _) => Signal::boolean(name, "read from CSV"),
            (_, true) => Signal::real(name, "s", "time"),
            _ => Signal::real(name, "", "read from CSV"),
        });
        let schema = Schema::new(dt_s.or(column_s).unwrap_or(1.0), signals)?;
        let mut trace = Trace::new(Arc::new(schema));
        for row in &self.rows {
            // Invariant: every value was checked when it was read.
            trace
                .push(row)
                .map_err(|error| SamplesError::Csv(error.to_string()))?;
        }
        Ok(trace)
    }

    /// Returns the period of the time column, which must be even.
    fn period(&self) -> Result<f64, SamplesError> {
        let (start, last) = (self.rows[0][0], self.rows[self.rows.len() - 1][0]);
        let mean_s = (last - start) / (self.rows.len() - 1) as f64;
        // The period is a decimal fraction of the file, without the rounding of
        // differences.
        let period_s = tidy(mean_s);
        for (i, row) in self.rows.iter().enumerate() {
            let expected = start + i as f64 * mean_s;
            let uneven = UNEVEN * mean_s.abs() < (row[0] - expected).abs();
            if uneven || period_s <= 0.0 {
                return Err(self.odd_step().unwrap_or(SamplesError::Uneven {
                    line: self.lines[i],
                    found: row[0],
                    expected: tidy(expected),
                }));
            }
        }
        Ok(period_s)
    }

    /// First time that does not follow from the previous time.
    ///
    /// The mean period is no reference: one long step changes it, and even
    /// samples would be reported. The median step is not affected.
    fn odd_step(&self) -> Option<SamplesError> {
        let mut steps_s: Vec<f64> = self
            .rows
            .windows(2)
            .map(|two| two[1][0] - two[0][0])
            .collect();
        steps_s.sort_by(f64::total_cmp);
        let usual_s = steps_s[(steps_s.len() - 1) / 2];
        self.rows.windows(2).enumerate().find_map(|(i, two)| {
            let (before, found) = (two[0][0], two[1][0]);
            let line = self.lines[i + 1];
            if found <= before {
                return Some(SamplesError::NotLater {
                    line,
                    found,
                    before,
                });
            }
            let odd = UNEVEN * usual_s < (found - before - usual_s).abs();
            odd.then(|| SamplesError::Uneven {
                line,
                found,
                expected: tidy(before + usual_s),
            })
        })
    }
}

/// Rounds to nine decimals, which removes the digits of binary fractions.
fn tidy(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

/// Name of a time column without its unit. `None` for another column.
fn time_name(header: &str) -> Result<Option<String>, SamplesError> {
    let (name, unit) = match header.split_once(['[', '(']) {
        Some((name, unit)) => (
            name.trim_end(),
            Some(unit.trim_end_matches([']', ')']).trim()),
        ),
        None => (header, None),
    };
    if !["time", "t"].contains(&name.to_ascii_lowercase().as_str()) {
        return Ok(None);
    }
    match unit {
        None | Some("" | "s" | "sec" | "second" | "seconds") => Ok(Some(name.to_owned())),
        Some(unit) => Err(SamplesError::TimeUnit {
            column: header.to_owned(),
            unit: unit.to_owned(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_files_are_read() {
        let trace = trace_of_csv("time,x,on\n0,1,true\n0.1,2,false\n0.2,3,true\n", None);
        let trace = trace.expect("a trace");
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
            ("x,y\n", "no sample"),
            ("x,,z\n1,2,3\n", "column 2"),
            ("x,x\n1,2\n", "declared twice"),
            ("x,y\n1,2\n3\n", "line 3: 1 values for 2 columns"),
            ("x\n1\nNaN\n", "line 3, column `x`: `NaN`"),
            ("x\n1\ninf\n", "`inf` is no finite number"),
            (
                "time;x\n0;1\n",
                "line 1: the columns are separated by semicolons",
            ),
            (
                "time\tx\n0\t1\n",
                "line 1: the columns are separated by tabs",
            ),
            ("x\n1\nabc\n", "`abc`"),
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
            ("time [ms],x\n0,1\n10,1\n", "in `ms`"),
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
}
