//! Mistakes of a CSV text that is to be a trace, each with a fix.

use brakecheck_stl::table::because_of_calendar;

use crate::trace::SchemaError;

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
    #[error(
        "line {line}, column `{column}`: `{value}` is no time{}",
        because_of_calendar(value)
    )]
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
