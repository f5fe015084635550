//! Reading of SUMO's floating car data, and of recordings in XML of either kind.

use std::io::{BufRead, BufReader, Read};

use indexmap::IndexMap;

use crate::column_map::AngleUnit;
use crate::commonroad::read_commonroad;
use crate::error::ReadError;
use crate::grid;
use crate::problem::{FilePlace, FileProblem};
use crate::raw::{FARTHEST_M, RawReference, RawRow, RawTrack, RawTracks, RawVector};
use crate::recording::{Class, ReadCounts, TrafficRecording};
use crate::xml_lines::{PlacedElement, RecordedElements, read_elements};
use crate::xosc_entity::class_of_words;

/// Bytes of a file in which its root element begins.
const HEAD: usize = 1 << 13;

/// Reads a recording in XML: CommonRoad if its root says so, floating car data otherwise.
///
/// Returns the name of the format, too.
///
/// # Errors
/// As [`read_commonroad`] and [`read_fcd`].
pub fn read_xml(
    text: impl Read,
    name: &str,
) -> Result<(TrafficRecording, &'static str), ReadError> {
    let mut text = BufReader::with_capacity(HEAD, text);
    let head = text.fill_buf().map_err(|source| ReadError::File {
        file: name.to_owned(),
        source,
    })?;
    // Only the head is looked at, because files may be far larger than the memory.
    if is_commonroad(head) {
        return Ok((read_commonroad(text, name)?, "commonroad"));
    }
    Ok((read_fcd(text, name)?, "fcd"))
}

/// Returns true if the first 8 KiB of an XML text begin a CommonRoad scenario.
pub fn is_commonroad(text: &[u8]) -> bool {
    let root = b"<commonRoad";
    let head = &text[..text.len().min(HEAD)];
    head.windows(root.len()).any(|it| it == root)
}

/// Reads `fcd-export` of SUMO in XML. Errors call it by `name`.
///
/// Positions are those of the front bumper in metres, angles degrees of a compass, and
/// speeds m/s. Files have no boxes: they are those of the class, which is that of the first
/// word in `type` that names one. Persons and containers are read, too.
///
/// # Errors
/// The text is not XML, has no road user, or a value is not a finite number.
pub fn read_fcd(text: impl Read, name: &str) -> Result<TrafficRecording, ReadError> {
    let mut file = Fcd::default();
    read_elements(text, name, &mut file)?;
    if file.tracks.is_empty() {
        return Err(ReadError::Content {
            file: name.to_owned(),
            place: FilePlace::Whole,
            problem: FileProblem::NoVehicles,
        });
    }
    let raw = RawTracks {
        tracks: file.tracks.into_values().collect(),
        counts: file.counts,
        origin_m: file.origin_m.unwrap_or_default(),
        reading: "timesteps in s; front bumper in m; angle in degrees of a compass; speed in m/s"
            .to_owned(),
        rate_hz: None,
    };
    grid::recording(raw, name)
}

#[derive(Default)]
struct Fcd {
    /// Instant of the open step.
    time_s: Option<f64>,
    tracks: IndexMap<String, RawTrack>,
    origin_m: Option<[f64; 2]>,
    counts: ReadCounts,
}

impl RecordedElements for Fcd {
    fn start(&mut self, element: &PlacedElement<'_>) -> Result<(), ReadError> {
        let class = match element.name() {
            "timestep" => {
                self.time_s = Some(element.number("time")?);
                return Ok(());
            }
            // The class of a vehicle is only known by its `type`.
            "vehicle" => None,
            "person" => Some(Class::Pedestrian),
            _ => return Ok(()),
        };
        // Without an instant the row would count at that of another file.
        let Some(time_s) = self.time_s else {
            return Err(element.error(FileProblem::MissingField {
                owner: element.name().to_owned(),
                field: "timestep",
            }));
        };
        let id = element.text("id")?;
        let place = |name: &str| {
            let value = element.number(name)?;
            if value.abs() <= FARTHEST_M {
                return Ok(value);
            }
            Err(element.error(FileProblem::Far {
                owner: id.clone(),
                name: name.to_owned(),
                value,
            }))
        };
        let (x_m, y_m) = (place("x")?, place("y")?);
        let origin_m = *self.origin_m.get_or_insert([x_m, y_m]);
        let angle = element.optional_number("angle")?;
        let speed_mps = element.optional_number("speed")?;
        let words = element.optional("type").unwrap_or_default();
        // The type first, because it says more than the element.
        let known = class_of_words(words).or(class);
        self.counts.rows += 1;
        self.counts.unknown_class += usize::from(known.is_none());
        let track = self.tracks.entry(id.clone()).or_insert_with(|| RawTrack {
            id: id.into_bytes(),
            reference: RawReference::Front,
            ..RawTrack::default()
        });
        track.rows.push(RawRow {
            time_s,
            x_m: x_m - origin_m[0],
            y_m: y_m - origin_m[1],
            heading_rad: angle.map(|it| AngleUnit::CompassDegrees.heading_rad(it, 1.0)),
            velocity: speed_mps.map_or(RawVector::Unknown, RawVector::Along),
            acceleration: RawVector::Unknown,
            marked: false,
            size_m: [0.0; 2],
            class: Some(known.unwrap_or_default()),
        });
        Ok(())
    }
}
