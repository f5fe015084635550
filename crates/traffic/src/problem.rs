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
    /// A trajectory has no times, and its entity no speed.
    #[error("the trajectory of `{0}` has no `Timing`, and the entity no speed in `Init`")]
    NoTiming(String),
    /// No step has a road user.
    #[error("no vehicle and no person in a timestep of fcd-export")]
    NoVehicles,
    /// No obstacle of a scenario has states.
    #[error("no dynamic obstacle with a trajectory")]
    NoObstacles,
    /// No lanelet has local coordinates.
    #[error("no lanelet whose nodes have `local_x` and `local_y`")]
    NoLanelets,
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
    /// A chunk unpacks to far more than it is.
    #[error("a chunk of {packed} bytes unpacks to {size} bytes")]
    Unpacks {
        /// Bytes of the chunk in the file.
        packed: u64,
        /// Bytes that it announces.
        size: u64,
    },
    /// A trace has far more objects than a file of its size.
    #[error("{objects} moving objects in the first {bytes} bytes of the file")]
    Swollen {
        /// Number of objects in all messages up to here.
        objects: usize,
        /// Bytes of the file up to here.
        bytes: u64,
    },
    /// A trajectory is that of too many entities.
    #[error("a trajectory of more than {0} entities")]
    ManyEntities(usize),
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
    /// A file is not MCAP from some record on.
    #[error("invalid MCAP: {0}")]
    Mcap(String),
    /// A record is shorter than its fields.
    #[error("an MCAP record of type 0x{0:02x} is too short for its fields")]
    Record(u8),
    /// The checksum of a chunk does not fit.
    #[error("the checksum of the chunk does not fit its contents")]
    Checksum,
    /// The compression of a chunk is unknown.
    #[error("chunks compressed with `{0}` are not read")]
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
    /// The sampling period is implausible.
    #[error("the instants are {dt_s} s apart")]
    Period {
        /// Period in seconds.
        dt_s: f64,
    },
    /// Most samples of the time grid would be made up.
    #[error("the instants are too uneven for steps of {dt_s} s")]
    Uneven {
        /// Period in seconds.
        dt_s: f64,
    },
    /// Road users are faster than any.
    #[error("by their positions, road users drive with {speed_mps:.0} m/s or more")]
    Fast {
        /// Median speed in m/s.
        speed_mps: f64,
    },
    /// Most road users are wider than long.
    #[error("road users are {width_m:.2} m wide and {length_m:.2} m long")]
    Wide {
        /// Length of the first of them in metres.
        length_m: f64,
        /// Its width in metres.
        width_m: f64,
    },
    /// Recorded speeds contradict the positions.
    #[error(
        "the recorded speeds are {ratio:.3} times those of the positions{}",
        suggestion(.fits.as_deref())
    )]
    SpeedsDiffer {
        /// Median of recorded speed over speed of the positions.
        ratio: f64,
        /// Unit or rate that explains it.
        fits: Option<String>,
    },
    /// Recorded headings contradict the motion.
    #[error(
        "{:.0} % of the headings are not the direction of motion{}",
        100.0 * .share,
        suggestion(*.fits)
    )]
    HeadingsDiffer {
        /// Share of the headings.
        share: f64,
        /// Unit that explains it.
        fits: Option<&'static str>,
    },
    /// Recorded velocities lead elsewhere than the positions.
    #[error("the recorded velocities do not lead along the positions{}", suggestion(*.fits))]
    VelocitiesDiffer {
        /// Reading that explains it.
        fits: Option<&'static str>,
    },
    /// Most road users are wider than any vehicle.
    #[error("most vehicles are {width_m:.2} m wide and {length_m:.2} m long, which fits feet")]
    Large {
        /// Median length in metres.
        length_m: f64,
        /// Median width in metres.
        width_m: f64,
    },
    /// A position is nowhere on Earth.
    #[error("`{name}` of `{owner}` is {value:e} m from the origin")]
    Far {
        /// Name of the element or object.
        owner: String,
        /// Name of the field or array.
        name: String,
        /// Coordinate in metres.
        value: f64,
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
            FileProblem::NoVehicles => "write it with `sumo --fcd-output FILE.xml`",
            FileProblem::NoObstacles => {
                "name a CommonRoad scenario of recorded traffic, whose `dynamicObstacle`s have \
                 trajectories"
            }
            FileProblem::NoLanelets => {
                "save the Lanelet2 map with local coordinates, or name an OpenDRIVE file"
            }
            FileProblem::NoTiming(_) => {
                "write a TimeReference with Timing, or a SpeedAction in Init"
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
            FileProblem::Unpacks { .. } | FileProblem::Swollen { .. } => {
                "run `mcap decompress`: what is plain is read, whatever it is"
            }
            FileProblem::ManyEntities(_) => "give each group of entities a trajectory of its own",
            FileProblem::Protobuf(_) | FileProblem::NoGroundTruth(_) => {
                "record osi3.GroundTruth, or osi3.SensorView with global_ground_truth"
            }
            FileProblem::MissingField { .. } => "let the simulator fill the field",
            FileProblem::NotMcap => "name an MCAP file, or rename it to .osi or .csv",
            FileProblem::Mcap(_)
            | FileProblem::Record(_)
            | FileProblem::Checksum
            | FileProblem::Decompress(_) => "copy the file again, or run `mcap recover`",
            FileProblem::Compression(_) => "run `mcap compress --compression lz4`",
            FileProblem::Span { .. } => {
                "map the time in its unit, and remove rows of another day or clock"
            }
            FileProblem::Period { .. } => {
                "map the time in its unit: Seconds, Milliseconds, Microseconds, Nanoseconds or \
                 Frames"
            }
            FileProblem::Uneven { .. } => {
                "resample the recording, or remove the rows that are sampled more finely"
            }
            FileProblem::Fast { .. } => {
                "map times and positions in their units, or resample at the rate of the positions"
            }
            FileProblem::Wide { .. } => {
                "map the length to `length` and the width to `width`, or the size as \
                 Fixed(length_m: 4.5, width_m: 1.8)"
            }
            FileProblem::SpeedsDiffer { .. } => {
                "write a column map with the right rate_hz, unit of time or `speed_unit`, or with \
                 `velocity: Derived`"
            }
            FileProblem::HeadingsDiffer { .. } => {
                "write a column map with the right unit of `heading` (Degrees, Radians, \
                 CompassDegrees, CompassRadians), with `y_axis: Right` for a y to the right, or \
                 with `heading: None`"
            }
            FileProblem::VelocitiesDiffer { .. } => {
                "write a column map with the components along x and y, or with `velocity: Derived`"
            }
            FileProblem::Large { .. } => {
                "name a column map with `length_unit: Feet`, or write the unit into the header: \
                 `x [ft]`, `speed [ft/s]`; sizes alone are given as \
                 Fixed(length_m: 4.5, width_m: 1.8)"
            }
            FileProblem::Far { .. } => "remove the row, or map the position in its unit",
            FileProblem::ArrayLength { .. } => "give each array a value per row",
        }
        .to_owned()
    }
}

/// Returns the explanation as the end of a message.
fn suggestion(fits: Option<&str>) -> String {
    fits.map_or(String::new(), |fits| format!(", which fits {fits}"))
}
