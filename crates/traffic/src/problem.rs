//! Places and problems in recordings other than CSV.

use std::fmt;

/// Place of a problem in a file or in arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilePlace {
    /// Line, from 1.
    Line(u64),
    /// Message of a trace.
    Message {
        /// Number of the message, from 1.
        number: u64,
        /// Byte offset of the message, of its length or of its chunk.
        offset: u64,
    },
    /// Byte offset.
    Byte(u64),
    /// Index of an array, from 0.
    Index(usize),
    /// All of it.
    Whole,
}

impl fmt::Display for FilePlace {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FilePlace::Line(line) => write!(out, ", line {line}"),
            FilePlace::Message { number, offset } => {
                write!(out, ", message {number} at byte {offset}")
            }
            FilePlace::Byte(offset) => write!(out, ", byte {offset}"),
            FilePlace::Index(index) => write!(out, ", index {index}"),
            FilePlace::Whole => Ok(()),
        }
    }
}

/// Problem in a recording, with the values that it is about.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FileProblem {
    /// The text is not XML.
    #[error("invalid XML: {0}")]
    Xml(String),
    /// An element is not closed.
    #[error("the file ends inside `{0}`")]
    Unclosed(String),
    /// An element has no attribute of this name.
    #[error("`{element}` has no `{attribute}`")]
    MissingAttribute {
        /// Name of the element.
        element: String,
        /// Name of the attribute.
        attribute: String,
    },
    /// A value is not a finite number.
    #[error("`{name}` of `{owner}` is not a finite number: `{text}`")]
    NotFinite {
        /// Name of the element or object.
        owner: String,
        /// Name of the attribute, field or array.
        name: String,
        /// Text of the value.
        text: String,
    },
    /// A size is not positive.
    #[error("`{name}` of `{owner}` is not positive: {value}")]
    NotPositive {
        /// Name of the element or object.
        owner: String,
        /// Name of the attribute, field or array.
        name: String,
        /// Size in metres.
        value: f64,
    },
    /// A trajectory has a shape without instants.
    #[error("a trajectory of the shape `{0}`")]
    Shape(String),
    /// A vertex has no coordinates.
    #[error("a vertex without `WorldPosition`")]
    NoWorldPosition,
    /// Times of a trajectory count from an unknown instant.
    #[error("the times of a trajectory are relative to an event without an instant")]
    RelativeTime,
    /// No entity has a trajectory.
    #[error("no entity follows a polyline")]
    NoTrajectory,
    /// The file ends inside a message or record.
    #[error("the file ends early: {got} of {want} bytes are left")]
    Cut {
        /// Number of bytes that are left.
        got: u64,
        /// Number of bytes that are announced.
        want: u64,
    },
    /// A length is implausible.
    #[error("a length of {0} bytes")]
    TooLong(u64),
    /// A message is not protobuf of its type.
    #[error("invalid protobuf: {0}")]
    Protobuf(String),
    /// A field that the reading needs is missing.
    #[error("{owner} has no `{field}`")]
    MissingField {
        /// Object of the field.
        owner: String,
        /// Name of the field.
        field: &'static str,
    },
    /// No message has ground truth.
    #[error("no moving object in osi3.GroundTruth or osi3.SensorView ({0})")]
    NoGroundTruth(String),
    /// The file does not begin as MCAP does.
    #[error("the file does not begin as MCAP does")]
    NotMcap,
    /// A record is shorter than its fields.
    #[error("an MCAP record of type 0x{0:02x} is too short for its fields")]
    Record(u8),
    /// The checksum of a chunk does not fit.
    #[error("the checksum of the chunk does not fit its contents")]
    Checksum,
    /// This build cannot decompress a chunk.
    #[error("this build does not read chunks compressed with `{0}`")]
    Compression(String),
    /// A chunk cannot be decompressed.
    #[error("the chunk cannot be decompressed: {0}")]
    Decompress(String),
    /// The instants are too far apart for one time grid.
    #[error("the instants span {span_s} s in steps of {dt_s} s")]
    Span {
        /// Seconds from the first instant to the last.
        span_s: f64,
        /// Median step in seconds.
        dt_s: f64,
    },
    /// Two arrays have different lengths.
    #[error("`{name}` has {got} values, the times have {want}")]
    ArrayLength {
        /// Name of the array.
        name: &'static str,
        /// Number of its values.
        got: usize,
        /// Number of times.
        want: usize,
    },
}

impl FileProblem {
    /// Returns the fix in the imperative.
    pub fn help(&self) -> String {
        match self {
            FileProblem::Xml(_) | FileProblem::Unclosed(_) => {
                "export the scenario again: the file is damaged or was not copied whole"
            }
            FileProblem::MissingAttribute { .. } => "add the attribute",
            FileProblem::NotFinite { .. } => {
                "write a number; a hole in a track is better than a guess"
            }
            FileProblem::NotPositive { .. } => {
                "write the size in metres, or leave it out: a size by the class is then assumed"
            }
            FileProblem::Shape(_) | FileProblem::NoWorldPosition => {
                "export the trajectory as a Polyline whose vertices have a time and a \
                 WorldPosition with x and y"
            }
            FileProblem::RelativeTime => {
                "write domainAbsoluteRelative=\"absolute\", or start the event by a \
                 SimulationTimeCondition"
            }
            FileProblem::NoTrajectory => {
                "record the motion as FollowTrajectoryAction; for scenarios to be simulated use \
                 `brakecheck new --from`"
            }
            FileProblem::Cut { .. } => {
                "copy the file again, or keep what is whole: `head -c OFFSET` for .osi, \
                 `mcap recover` for .mcap"
            }
            FileProblem::TooLong(_) => {
                "name an OSI trace: every message has its length in four bytes before it, \
                 lowest first"
            }
            FileProblem::Protobuf(_) | FileProblem::NoGroundTruth(_) => {
                "record osi3.GroundTruth, or osi3.SensorView with global_ground_truth"
            }
            FileProblem::MissingField { .. } => "let the simulator fill the field",
            FileProblem::NotMcap => "name an MCAP file, or rename it to .osi or .csv",
            FileProblem::Record(_) | FileProblem::Checksum | FileProblem::Decompress(_) => {
                "copy the file again, or run `mcap recover`"
            }
            FileProblem::Compression(_) => {
                "build with `--features zstd`, or run `mcap compress --compression lz4`"
            }
            FileProblem::Span { .. } => {
                "map the time in its unit, and remove rows of another day or clock"
            }
            FileProblem::ArrayLength { .. } => "give each array a value per row",
        }
        .to_owned()
    }
}
