//! Errors in a file of recorded traffic.

use brakecheck_stl::table::because_of_calendar;

use crate::problem::{FilePlace, FileProblem};

/// Error while reading a recording.
///
/// [`ReadError::help`] states the fix.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file cannot be read.
    #[error("cannot read `{file}`: {source}")]
    File {
        /// Name of the file.
        file: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// No shipped column map has all of its columns in the header.
    #[error("`{file}`: no shipped column map fits the header `{header}`")]
    UnknownFormat {
        /// Name of the file.
        file: String,
        /// Header of the file.
        header: String,
    },
    /// A column of the map is not in the header.
    #[error("`{file}`: missing column `{column}` in line 1")]
    MissingColumn {
        /// Name of the file.
        file: String,
        /// Column of the map.
        column: String,
        /// Most similar column of the header.
        nearest: Option<String>,
        /// Header of the file.
        header: String,
    },
    /// Two columns have a name of the map.
    #[error("`{file}`: two columns are called `{column}` in line 1")]
    TwoColumns {
        /// Name of the file.
        file: String,
        /// Column of the map.
        column: String,
    },
    /// A name in the header has a unit that is not read.
    #[error("`{file}`: the unit of `{column}` in line 1 is not read")]
    Unit {
        /// Name of the file.
        file: String,
        /// Name in the header.
        column: String,
    },
    /// A row has more or fewer fields than the header.
    #[error("`{file}`, line {line}: {got} fields, the header has {want}")]
    Fields {
        /// Name of the file.
        file: String,
        /// Line of the row, from 1.
        line: u64,
        /// Number of fields.
        got: u64,
        /// Number of fields of the header.
        want: u64,
    },
    /// A field is not a finite number.
    #[error("`{file}`, line {line}, column `{column}`: `{text}` is not a finite number")]
    Number {
        /// Name of the file.
        file: String,
        /// Line of the row, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// Text of the field.
        text: String,
    },
    /// A field is not an ISO 8601 instant.
    #[error(
        "`{file}`, line {line}, column `{column}`: `{text}` is not an ISO 8601 instant{}",
        because_of_calendar(text)
    )]
    Instant {
        /// Name of the file.
        file: String,
        /// Line of the row, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// Text of the field.
        text: String,
    },
    /// A number is no time of any recording.
    #[error("`{file}`, line {line}, column `{column}`: {value:e} is no time from -1e21 to 1e21")]
    Time {
        /// Name of the file.
        file: String,
        /// Line of the row, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// Time in the unit of the file.
        value: f64,
    },
    /// A position is nowhere on Earth.
    #[error("`{file}`, line {line}, column `{column}`: {value:e} is farther than 100,000 km")]
    Far {
        /// Name of the file.
        file: String,
        /// Line of the row, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// Coordinate in the unit of the file.
        value: f64,
    },
    /// A box is negative, longer than 1 km or wider than 20 m.
    #[error("`{file}`, line {line}, column `{column}`: {value} is not the size of a road user")]
    Size {
        /// Name of the file.
        file: String,
        /// Line of the row, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// Size in the unit of the file.
        value: f64,
    },
    /// A road user has two rows at one instant.
    #[error("`{file}`: road user `{id}` has two rows at {time_s:.3} s after the first row")]
    Repeated {
        /// Name of the file.
        file: String,
        /// Identity of the road user.
        id: String,
        /// Instant of both rows.
        time_s: f64,
    },
    /// Two files of a recording, or two places in one, state different values.
    #[error("`{file}`: {said}, but `{other}`: {other_said}")]
    Contradiction {
        /// Name of a file, with the line where it is known.
        file: String,
        /// Value there.
        said: String,
        /// Name of the other file or map.
        other: String,
        /// Value there.
        other_said: String,
    },
    /// A file other than CSV, or an array, is invalid.
    #[error("`{file}`{place}: {problem}")]
    Content {
        /// Name of the file.
        file: String,
        /// Place in the file.
        place: FilePlace,
        /// Problem at this place.
        problem: FileProblem,
    },
    /// A table has a header without rows.
    #[error("`{file}`: no row follows the header")]
    NoRows {
        /// Name of the file.
        file: String,
    },
    /// No road user has two rows.
    #[error("`{file}`: no road user has two rows")]
    Empty {
        /// Name of the file.
        file: String,
    },
}

impl ReadError {
    /// Returns the fix in the imperative.
    pub fn help(&self) -> String {
        match self {
            ReadError::File { .. } => "name a readable file".to_owned(),
            ReadError::UnknownFormat { .. } => {
                let known = crate::ColumnMap::shipped_names().join(", ");
                format!(
                    "write a column map, or name one of {known}; without one the columns time, \
                     id, x and y are needed, and `--time NAME` names the time"
                )
            }
            ReadError::MissingColumn {
                nearest, header, ..
            } => match nearest {
                Some(nearest) => format!("map `{nearest}`, or another of `{header}`"),
                None => format!("map a column of `{header}`"),
            },
            ReadError::TwoColumns { .. } => "rename one of them in line 1".to_owned(),
            ReadError::Unit { .. } => {
                "convert the column, and write m, ft, m/s, km/h, mph, ft/s, deg or rad; all \
                 lengths have the unit of x"
                    .to_owned()
            }
            ReadError::Fields { .. } => {
                "remove the row, or quote fields that contain commas".to_owned()
            }
            ReadError::Number { text, .. } if text.contains(',') => {
                "write all decimals with a point, or all with a comma between other separators"
                    .to_owned()
            }
            ReadError::Number { .. } => {
                "remove the row, or map another column; a hole is better than a guess".to_owned()
            }
            ReadError::Instant { .. } => {
                "write 2024-10-07T06:00:00.05Z, or map the time as Seconds, Milliseconds or Frames"
                    .to_owned()
            }
            ReadError::Time { .. } => "remove the row, or map another column".to_owned(),
            ReadError::Far { .. } => "remove the row, or map the position in its unit".to_owned(),
            ReadError::Size { .. } => {
                "remove the rows, or map the size as Fixed(length_m: 4.5, width_m: 1.8)".to_owned()
            }
            ReadError::Repeated { .. } => {
                "map a column that is unique per road user, or remove one of the rows".to_owned()
            }
            ReadError::Contradiction { .. } => {
                "copy all files of one recording again, or rename the one that is wrong".to_owned()
            }
            ReadError::Content { problem, .. } => problem.help(),
            ReadError::NoRows { .. } => "record at least two rows per road user".to_owned(),
            ReadError::Empty { .. } => {
                "map `id` to a column that is the same in all rows of a road user".to_owned()
            }
        }
    }
}
