//! Reading of OSI traces.

use std::collections::HashMap;
use std::io::{BufReader, Read};

use prost::Message;

use crate::error::ReadError;
use crate::grid;
use crate::osi_message::{
    GLOBAL_GROUND_TRUTH, MOVING_OBJECTS, NestedFields, OsiBase, OsiInstant, OsiMovingObject,
    OsiTimestamp, OsiVector,
};
use crate::problem::{FilePlace, FileProblem};
use crate::raw::{FARTHEST_M, RawRow, RawTrack, RawTracks, RawVector};
use crate::recording::{Class, ReadCounts, TrafficRecording};

/// Greatest length of a message in bytes.
const MOST_BYTES: u64 = 1 << 28;
/// Objects of all messages that a trace may have without any bytes, and those per byte of
/// the file. Parked vehicles in a compressed trace need least: about a byte for four.
const OBJECTS: u64 = 200_000;
const OBJECTS_PER_BYTE: u64 = 4;
/// Objects of known road users that take the memory of a new one.
const NEW_ROAD_USER: u64 = 32;

/// Reads a trace of the Open Simulation Interface: `.osi`. Errors call it by `name`.
///
/// Each message has its length before it, in four bytes, lowest first. It is
/// `osi3.GroundTruth`, or `osi3.SensorView` with `global_ground_truth`, which the first
/// message with moving objects determines. Classes are the types of the objects. Without
/// a velocity or an acceleration it is derived from the positions. Instants and holes are
/// treated as in [`read_csv`](crate::read_csv).
///
/// # Errors
/// The file ends inside a message, or a message is invalid.
pub fn read_osi(trace: impl Read, name: &str) -> Result<TrafficRecording, ReadError> {
    // A trace is one long run of small reads, four bytes and a message each.
    let mut reader = BufReader::with_capacity(1 << 18, trace);
    let mut tracks = OsiTracks::new(name);
    let mut message = Vec::new();
    let (mut number, mut offset) = (1, 0);
    loop {
        let place = FilePlace::Message { number, offset };
        read_bytes(&mut reader, 4, &mut message, name)?;
        // The end between two messages is the regular end of a trace.
        if message.is_empty() {
            return tracks.finish();
        }
        let Ok(length) = <[u8; 4]>::try_from(&message[..]) else {
            return Err(tracks.cut(place, message.len() as u64, 4));
        };
        let length = u64::from(u32::from_le_bytes(length));
        // A damaged length would make the next read wait for gigabytes.
        if length > MOST_BYTES {
            return Err(tracks.error(place, FileProblem::TooLong(length)));
        }
        read_bytes(&mut reader, length, &mut message, name)?;
        if (message.len() as u64) < length {
            return Err(tracks.cut(place, message.len() as u64, length));
        }
        // Before the message is parsed, because it pays for its own objects.
        tracks.bytes += 4 + length;
        tracks.push(&message, place)?;
        number += 1;
        offset += 4 + length;
    }
}

/// Reads `want` bytes, or as many as there are.
pub(crate) fn read_bytes(
    reader: &mut impl Read,
    want: u64,
    into: &mut Vec<u8>,
    file: &str,
) -> Result<(), ReadError> {
    into.clear();
    // The buffer grows with the bytes that arrive, and not by the announced
    // length.
    let read = reader.by_ref().take(want).read_to_end(into);
    read.map(|_| ()).map_err(|source| ReadError::File {
        file: file.to_owned(),
        source,
    })
}

/// Type of the messages of a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OsiKind {
    GroundTruth,
    SensorView,
}

/// First row, from which time and place are measured.
struct OsiOrigin {
    seconds: i64,
    nanos: i64,
    position_m: [f64; 2],
}

/// Tracks from messages.
pub(crate) struct OsiTracks<'a> {
    file: &'a str,
    /// Type of the messages, once it is known.
    pub(crate) kind: Option<OsiKind>,
    pub(crate) counts: ReadCounts,
    /// Bytes of the file up to here, by which the memory is bounded.
    pub(crate) bytes: u64,
    by_id: HashMap<u64, usize>,
    tracks: Vec<RawTrack>,
    origin: Option<OsiOrigin>,
}

impl<'a> OsiTracks<'a> {
    pub(crate) fn new(file: &'a str) -> OsiTracks<'a> {
        OsiTracks {
            file,
            kind: None,
            counts: ReadCounts::default(),
            bytes: 0,
            by_id: HashMap::new(),
            tracks: Vec::new(),
            origin: None,
        }
    }

    pub(crate) fn error(&self, place: FilePlace, problem: FileProblem) -> ReadError {
        ReadError::Content {
            file: self.file.to_owned(),
            place,
            problem,
        }
    }

    pub(crate) fn cut(&self, place: FilePlace, got: u64, want: u64) -> ReadError {
        self.error(place, FileProblem::Cut { got, want })
    }

    /// Adds the moving objects of a message.
    pub(crate) fn push(&mut self, message: &[u8], place: FilePlace) -> Result<(), ReadError> {
        self.push_objects(message)
            .map_err(|problem| self.error(place, problem))
    }

    fn push_objects(&mut self, message: &[u8]) -> Result<(), FileProblem> {
        let kind = match self.kind {
            Some(kind) => kind,
            None => match OsiKind::guess(message)? {
                Some(kind) => *self.kind.insert(kind),
                // Simulators write messages without objects before the first
                // vehicle appears.
                None => return Ok(()),
            },
        };
        let ground_truth = kind.ground_truth(message)?;
        let mut instant = None;
        for object in NestedFields::of(ground_truth, MOVING_OBJECTS) {
            let object = decoded::<OsiMovingObject>(object.map_err(FileProblem::Protobuf)?)?;
            let missing = |owner: &str, field: &'static str| FileProblem::MissingField {
                owner: owner.to_owned(),
                field,
            };
            // Only with an object, so that an empty message needs no
            // timestamp.
            if instant.is_none() {
                // A view states its instant, too, for a ground truth without one.
                let own = decoded::<OsiInstant>(ground_truth)?.timestamp;
                instant = own.or(decoded::<OsiInstant>(message)?.timestamp);
            }
            let Some(instant) = &instant else {
                return Err(missing("the message", "timestamp"));
            };
            // A number 0 is left out by writers of proto3, as is that of esmini's first car.
            let Some(id) = object.id.as_ref().map(|it| it.value.unwrap_or(0)) else {
                return Err(missing("a moving object", "id"));
            };
            self.add(id, &object, instant)?;
        }
        Ok(())
    }

    /// Refuses more road users and rows than a file of this size has.
    fn check_memory(&self) -> Result<(), FileProblem> {
        // In MCAP, bytes of a packed chunk count as packed, so unpacking
        // cannot multiply the memory.
        let most = OBJECTS + OBJECTS_PER_BYTE * self.bytes;
        let road_users = NEW_ROAD_USER * self.tracks.len() as u64;
        if road_users + self.counts.rows as u64 <= most {
            return Ok(());
        }
        Err(FileProblem::Swollen {
            objects: self.counts.rows,
            bytes: self.bytes,
        })
    }

    fn add(
        &mut self,
        id: u64,
        object: &OsiMovingObject,
        instant: &OsiTimestamp,
    ) -> Result<(), FileProblem> {
        let owner = || format!("moving object {id}");
        let missing = |field: &'static str| FileProblem::MissingField {
            owner: owner(),
            field,
        };
        let base = object.base.as_ref().ok_or_else(|| missing("base"))?;
        let position = base
            .position
            .as_ref()
            .ok_or_else(|| missing("base.position"))?;
        // Checked before it may become the origin, which every later row is
        // relative to.
        let position_m = components(position, &owner, "base.position")?;
        let origin = self.origin.get_or_insert(OsiOrigin {
            seconds: instant.seconds.unwrap_or(0),
            nanos: i64::from(instant.nanos.unwrap_or(0)),
            position_m,
        });
        // Seconds since 1970 leave no digits for nanoseconds in an f64, so times are relative.
        let seconds = instant.seconds.unwrap_or(0).saturating_sub(origin.seconds);
        let nanos = i64::from(instant.nanos.unwrap_or(0)) - origin.nanos;
        let yaw = base.orientation.as_ref().and_then(|it| it.yaw);
        let class = class_of(object);
        let size_m = size(base, &owner)?;
        let row = RawRow {
            time_s: seconds as f64 + nanos as f64 * 1e-9,
            x_m: position_m[0] - origin.position_m[0],
            y_m: position_m[1] - origin.position_m[1],
            heading_rad: yaw
                .map(|it| finite(it, &owner, "base.orientation.yaw"))
                .transpose()?,
            velocity: vector(base.velocity.as_ref(), &owner, "base.velocity")?,
            acceleration: vector(base.acceleration.as_ref(), &owner, "base.acceleration")?,
            marked: false,
            size_m: size_m.unwrap_or_default(),
            // A class may change from row to row, so the track gets its most frequent one.
            class: None,
        };
        self.counts.rows += 1;
        // The summary shows how many classes are assumptions.
        self.counts.unknown_class += usize::from(class.is_none());
        // Before the push, so that the limit holds at every moment.
        self.check_memory()?;
        let tracks = &mut self.tracks;
        let at = *self.by_id.entry(id).or_insert_with(|| {
            tracks.push(RawTrack {
                id: id.to_string().into_bytes(),
                ..RawTrack::default()
            });
            tracks.len() - 1
        });
        let track = &mut tracks[at];
        track.shares[class.unwrap_or(Class::Other) as usize] += 1.0;
        track.rows.push(row);
        Ok(())
    }

    pub(crate) fn finish(self) -> Result<TrafficRecording, ReadError> {
        if self.tracks.is_empty() {
            let found = "the messages are empty or of other types".to_owned();
            return Err(self.error(FilePlace::Whole, FileProblem::NoGroundTruth(found)));
        }
        let raw = RawTracks {
            tracks: self.tracks,
            counts: self.counts,
            origin_m: self.origin.map_or([0.0; 2], |origin| origin.position_m),
            reading: "timestamps of the messages; box centre in m".to_owned(),
            rate_hz: None,
        };
        grid::recording(raw, self.file)
    }
}

impl OsiKind {
    /// Returns the type of the first message with moving objects, `None` without any.
    ///
    /// Field 5 is the moving objects of a ground truth, and field 7 is the ground truth of
    /// a sensor view. In the other type these numbers have contents that do not decode.
    fn guess(message: &[u8]) -> Result<Option<OsiKind>, FileProblem> {
        let objects = |kind: OsiKind| -> Result<usize, FileProblem> {
            let ground_truth = kind.ground_truth(message)?;
            decoded::<OsiInstant>(ground_truth)?;
            NestedFields::of(ground_truth, MOVING_OBJECTS).try_fold(0, |count, object| {
                decoded::<OsiMovingObject>(object.map_err(FileProblem::Protobuf)?)?;
                Ok(count + 1)
            })
        };
        // Ground truth first: a sensor view does not decode as one, since its
        // field 5 has another content.
        let direct = objects(OsiKind::GroundTruth);
        if direct.as_ref().is_ok_and(|count| *count > 0) {
            return Ok(Some(OsiKind::GroundTruth));
        }
        let view = objects(OsiKind::SensorView);
        if view.as_ref().is_ok_and(|count| *count > 0) {
            return Ok(Some(OsiKind::SensorView));
        }
        // If one type decodes, the message only lacks objects. If none does,
        // the first error is returned.
        direct.or(view).map(|_| None)
    }

    /// Returns the ground truth in a message, which is empty if there is none.
    fn ground_truth(self, message: &[u8]) -> Result<&[u8], FileProblem> {
        if self == OsiKind::GroundTruth {
            return Ok(message);
        }
        let mut found = NestedFields::of(message, GLOBAL_GROUND_TRUTH);
        // As protobuf has it, the last of several counts.
        let found = found.try_fold(&[][..], |_, it| it);
        found.map_err(FileProblem::Protobuf)
    }
}

fn decoded<M: Message + Default>(bytes: &[u8]) -> Result<M, FileProblem> {
    M::decode(bytes).map_err(|error| FileProblem::Protobuf(error.to_string()))
}

fn finite(value: f64, owner: &dyn Fn() -> String, name: &str) -> Result<f64, FileProblem> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(FileProblem::NotFinite {
        owner: owner(),
        name: name.to_owned(),
        text: value.to_string(),
    })
}

/// Returns x and y, of which a missing one is 0 as protobuf has it.
fn components(
    vector: &OsiVector,
    owner: &dyn Fn() -> String,
    name: &str,
) -> Result<[f64; 2], FileProblem> {
    let near = |value: Option<f64>| {
        let value = finite(value.unwrap_or(0.0), owner, name)?;
        if value.abs() <= FARTHEST_M {
            return Ok(value);
        }
        Err(FileProblem::Far {
            owner: owner(),
            name: name.to_owned(),
            value,
        })
    };
    Ok([near(vector.x)?, near(vector.y)?])
}

fn vector(
    vector: Option<&OsiVector>,
    owner: &dyn Fn() -> String,
    name: &str,
) -> Result<RawVector, FileProblem> {
    let Some(vector) = vector else {
        return Ok(RawVector::Unknown);
    };
    let [x, y] = components(vector, owner, name)?;
    Ok(RawVector::Components(x, y))
}

/// Returns the length and width, `None` if they are not filled.
fn size(base: &OsiBase, owner: &dyn Fn() -> String) -> Result<Option<[f64; 2]>, FileProblem> {
    let Some(dimension) = &base.dimension else {
        return Ok(None);
    };
    let size_m = [dimension.length, dimension.width].map(|it| it.unwrap_or(0.0));
    // Writers of proto3 leave zeros out, so an empty dimension is not filled.
    if size_m == [0.0, 0.0] {
        return Ok(None);
    }
    for (value, name) in size_m
        .into_iter()
        .zip(["base.dimension.length", "base.dimension.width"])
    {
        finite(value, owner, name)?;
        if value <= 0.0 {
            return Err(FileProblem::NotPositive {
                owner: owner(),
                name: name.to_owned(),
                value,
            });
        }
    }
    Ok(Some(size_m))
}

/// Returns the class of an object, `None` if its type is unknown.
///
/// A vehicle of no stated type is a car.
fn class_of(object: &OsiMovingObject) -> Option<Class> {
    let vehicle = object.vehicle.as_ref().and_then(|it| it.kind);
    Some(match object.kind? {
        2 => match vehicle.unwrap_or(0) {
            0 | 2..=5 => Class::Car,
            6 => Class::Van,
            7 | 12 | 16 => Class::Truck,
            8 | 9 => Class::Trailer,
            10 => Class::Motorcycle,
            11 | 17 | 18 => Class::Bicycle,
            15 => Class::Pedestrian,
            1 | 13 | 14 | 19..=22 => Class::Other,
            _ => return None,
        },
        3 => Class::Pedestrian,
        1 | 4 => Class::Other,
        _ => return None,
    })
}
