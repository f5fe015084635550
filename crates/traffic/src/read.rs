//! Reading of long CSV files.

use std::collections::HashMap;
use std::io::Read;

use csv::ByteRecord;

use crate::column_map::{
    AngleUnit, ClassColumns, ColumnMap, Reference, SizeColumns, TimeColumn, VectorColumns, YAxis,
};
use crate::error::ReadError;
use crate::grid::{self, RawReference, RawRow, RawTrack, RawTracks, RawVector};
use crate::recording::{Class, ReadCounts, TrafficRecording};
use crate::timestamp::parse_iso;

/// Reads rows with a shipped column map, which the header determines.
///
/// Returns the name of the map, too.
///
/// # Errors
/// No shipped map fits, or a row is invalid.
pub fn read_csv_guessed(
    rows: impl Read,
    name: &str,
) -> Result<(TrafficRecording, &'static str), ReadError> {
    let mut reader = csv_of(rows);
    let header = header_of(&mut reader, name)?;
    let known = ColumnMap::guess(&header);
    let Some((known, map)) = known.and_then(|it| Some((it, ColumnMap::shipped(it)?))) else {
        return Err(ReadError::UnknownFormat {
            file: name.to_owned(),
            header: header.join(","),
        });
    };
    Ok((read_rows(reader, &header, name, &map)?, known))
}

/// Reads rows with a column map. Errors call them by `name`.
///
/// The rows may have any order. The result has one time grid, whose period is the
/// median step. A row on the grid is taken as it is. Otherwise the neighbours in time
/// are interpolated. Holes of up to [`HOLE_S`](crate::HOLE_S) are filled and marked,
/// and longer ones split a track. [`ReadCounts`] counts all of it.
///
/// # Errors
/// A column is missing, or a row is invalid.
pub fn read_csv(
    rows: impl Read,
    name: &str,
    map: &ColumnMap,
) -> Result<TrafficRecording, ReadError> {
    let mut reader = csv_of(rows);
    let header = header_of(&mut reader, name)?;
    read_rows(reader, &header, name, map)
}

fn csv_of<R: Read>(rows: R) -> csv::Reader<R> {
    csv::ReaderBuilder::new()
        .buffer_capacity(1 << 18)
        // The default also ends a record at `\r`, and then counts lines of files with
        // `\r\n` one too low. The `\r` is trimmed with the blanks.
        .terminator(csv::Terminator::Any(b'\n'))
        .trim(csv::Trim::All)
        .from_reader(rows)
}

fn header_of(reader: &mut csv::Reader<impl Read>, name: &str) -> Result<Vec<String>, ReadError> {
    let header = reader.byte_headers().map_err(|it| csv_error(it, name))?;
    let text = |field: &[u8]| String::from_utf8_lossy(field).trim().to_owned();
    let mut header: Vec<String> = header.iter().map(text).collect();
    if let Some(first) = header.first_mut() {
        // Spreadsheets write a byte order mark.
        *first = first.trim_start_matches('\u{feff}').to_owned();
    }
    Ok(header)
}

fn csv_error(error: csv::Error, name: &str) -> ReadError {
    let file = name.to_owned();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => ReadError::File { file, source },
        csv::ErrorKind::UnequalLengths {
            pos,
            expected_len,
            len,
        } => ReadError::Fields {
            file,
            line: pos.map_or(0, |it| it.line()),
            got: len,
            want: expected_len,
        },
        other => ReadError::File {
            file,
            source: std::io::Error::other(format!("{other:?}")),
        },
    }
}

fn read_rows(
    mut reader: csv::Reader<impl Read>,
    header: &[String],
    name: &str,
    map: &ColumnMap,
) -> Result<TrafficRecording, ReadError> {
    let mut parser = RowParser::new(header, name, map)?;
    let mut record = ByteRecord::new();
    while reader
        .read_byte_record(&mut record)
        .map_err(|it| csv_error(it, name))?
    {
        parser.push(&record)?;
    }
    grid::recording(parser.finish(), name)
}

/// Positions of the columns of a map in a header.
struct Positions {
    time: usize,
    id: usize,
    x: usize,
    y: usize,
    heading: Option<usize>,
    velocity: Vec<usize>,
    acceleration: Vec<usize>,
    size: Option<(usize, usize)>,
    shares: Vec<(usize, Class)>,
    code: Option<usize>,
    interpolated: Option<usize>,
}

impl Positions {
    fn new(header: &[String], file: &str, map: &ColumnMap) -> Result<Positions, ReadError> {
        let at = |column: &str| {
            let found = header.iter().position(|it| it == column);
            found.ok_or_else(|| missing(header, file, column))
        };
        let vector = |columns: &VectorColumns| match columns {
            VectorColumns::Derived => Ok(Vec::new()),
            VectorColumns::Components(x, y) => Ok(vec![at(x)?, at(y)?]),
            VectorColumns::Magnitude(along) => Ok(vec![at(along)?]),
        };
        let optional = |column: Option<&String>| column.map(|it| at(it)).transpose();
        Ok(Positions {
            time: at(map.time.column())?,
            id: at(&map.id)?,
            x: at(&map.x)?,
            y: at(&map.y)?,
            heading: optional(map.heading.as_ref().map(|it| &it.column))?,
            velocity: vector(&map.velocity)?,
            acceleration: vector(&map.acceleration)?,
            size: match &map.size {
                SizeColumns::Columns { length, width } => Some((at(length)?, at(width)?)),
                SizeColumns::Fixed { .. } => None,
            },
            shares: match &map.class {
                ClassColumns::Shares(shares) => {
                    let share = |(column, class): (&String, &Class)| Ok((at(column)?, *class));
                    shares.iter().map(share).collect::<Result<_, _>>()?
                }
                _ => Vec::new(),
            },
            code: match &map.class {
                ClassColumns::Codes { column, .. } => Some(at(column)?),
                _ => None,
            },
            interpolated: optional(map.interpolated.as_ref())?,
        })
    }
}

fn missing(header: &[String], file: &str, column: &str) -> ReadError {
    let likeness = |it: &&String| strsim::jaro_winkler(it, column);
    let nearest = header
        .iter()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    ReadError::MissingColumn {
        file: file.to_owned(),
        column: column.to_owned(),
        nearest: nearest.filter(|it| 0.7 < likeness(it)).cloned(),
        header: header.join(","),
    }
}

/// Converts rows into raw tracks in metres and seconds, in a frame with y to the left.
struct RowParser<'a> {
    header: &'a [String],
    file: &'a str,
    map: &'a ColumnMap,
    at: Positions,
    ids: HashMap<Vec<u8>, usize>,
    tracks: Vec<RawTrack>,
    counts: ReadCounts,
    last: usize,
    origin: Option<Origin>,
    last_time: (Vec<u8>, f64),
}

/// First row, from which time and place are measured.
struct Origin {
    whole_s: i64,
    rest_s: f64,
    position_m: [f64; 2],
}

impl<'a> RowParser<'a> {
    fn new(
        header: &'a [String],
        file: &'a str,
        map: &'a ColumnMap,
    ) -> Result<RowParser<'a>, ReadError> {
        Ok(RowParser {
            header,
            file,
            map,
            at: Positions::new(header, file, map)?,
            ids: HashMap::new(),
            tracks: Vec::new(),
            counts: ReadCounts::default(),
            last: 0,
            origin: None,
            last_time: (Vec::new(), 0.0),
        })
    }

    fn finish(self) -> RawTracks {
        RawTracks {
            tracks: self.tracks,
            counts: self.counts,
            origin_m: self.origin.map_or([0.0; 2], |origin| origin.position_m),
        }
    }

    fn push(&mut self, record: &ByteRecord) -> Result<(), ReadError> {
        self.counts.rows += 1;
        let unit = self.map.length_unit.metres();
        let flip = match self.map.y_axis {
            YAxis::Left => 1.0,
            YAxis::Right => -1.0,
        };
        let (mut x_m, mut y_m) = (
            self.number(record, self.at.x)? * unit,
            self.number(record, self.at.y)? * unit,
        );
        let (length_m, width_m) = self.size(record)?;
        if self.map.reference == Reference::Corner {
            // Boxes along the file's axes, so the heading does not matter.
            x_m += 0.5 * length_m;
            y_m += 0.5 * width_m;
        }
        let heading_rad = match (&self.map.heading, self.at.heading) {
            (Some(angle), Some(at)) => {
                let value = self.number(record, at)?;
                Some(match angle.unit {
                    AngleUnit::Degrees => flip * value.to_radians(),
                    AngleUnit::Radians => flip * value,
                })
            }
            _ => None,
        };
        let time_s = self.time(record, [x_m, flip * y_m])?;
        let origin = self.origin.as_ref().map_or([0.0; 2], |it| it.position_m);
        let marked = self
            .at
            .interpolated
            .is_some_and(|at| matches!(&record[at], b"True" | b"true" | b"TRUE" | b"1"));
        self.counts.marked += usize::from(marked);
        let row = RawRow {
            time_s,
            x_m: x_m - origin[0],
            y_m: flip * y_m - origin[1],
            heading_rad,
            velocity: self.vector(record, &self.at.velocity, unit, flip)?,
            acceleration: self.vector(record, &self.at.acceleration, unit, flip)?,
            marked,
        };
        let track = self.track_of(record);
        // Sums, so that the class is of the mean share and the size of the mean size.
        let shares = self.at.shares.clone();
        for (at, class) in shares {
            let share = self.number(record, at)?;
            self.tracks[track].shares[class as usize] += share;
        }
        self.tracks[track].length_sum_m += length_m;
        self.tracks[track].width_sum_m += width_m;
        self.tracks[track].seen += 1.0;
        self.count_class(record, track, length_m);
        self.tracks[track].rows.push(row);
        Ok(())
    }

    fn track_of(&mut self, record: &ByteRecord) -> usize {
        let id = &record[self.at.id];
        // Rows of one road user often follow each other.
        if self.tracks.get(self.last).is_some_and(|it| it.id == id) {
            return self.last;
        }
        self.last = match self.ids.get(id) {
            Some(track) => *track,
            None => {
                let track = self.tracks.len();
                self.ids.insert(id.to_vec(), track);
                self.tracks.push(RawTrack {
                    id: id.to_vec(),
                    reference: match self.map.reference {
                        Reference::Front => RawReference::Front,
                        Reference::Centre | Reference::Corner => RawReference::Centre,
                    },
                    ..RawTrack::default()
                });
                track
            }
        };
        self.last
    }

    fn count_class(&mut self, record: &ByteRecord, track: usize, length_m: f64) {
        let class = match (&self.map.class, self.at.code) {
            (ClassColumns::Codes { codes, .. }, Some(at)) => {
                let code = String::from_utf8_lossy(&record[at]);
                let class = codes.get(code.trim()).copied();
                self.counts.unknown_class += usize::from(class.is_none());
                class.unwrap_or(Class::Other)
            }
            (ClassColumns::ByLength { truck_from_m }, _) if *truck_from_m <= length_m => {
                Class::Truck
            }
            (ClassColumns::Fixed(class), _) => *class,
            (ClassColumns::Shares(_), _) => return,
            _ => Class::Car,
        };
        self.tracks[track].shares[class as usize] += 1.0;
    }

    fn size(&self, record: &ByteRecord) -> Result<(f64, f64), ReadError> {
        let (SizeColumns::Columns { .. }, Some((length, width))) = (&self.map.size, self.at.size)
        else {
            return Ok(match &self.map.size {
                SizeColumns::Fixed { length_m, width_m } => (*length_m, *width_m),
                SizeColumns::Columns { .. } => (0.0, 0.0),
            });
        };
        let positive = |at: usize| {
            let value = self.number(record, at)?;
            if 0.0 < value {
                return Ok(value * self.map.length_unit.metres());
            }
            Err(ReadError::Size {
                file: self.file.to_owned(),
                line: line_of(record),
                column: self.header[at].clone(),
                value,
            })
        };
        Ok((positive(length)?, positive(width)?))
    }

    fn vector(
        &self,
        record: &ByteRecord,
        at: &[usize],
        unit: f64,
        flip: f64,
    ) -> Result<RawVector, ReadError> {
        Ok(match at {
            [along] => RawVector::Along(self.number(record, *along)? * unit),
            [x, y] => RawVector::Components(
                self.number(record, *x)? * unit,
                self.number(record, *y)? * unit * flip,
            ),
            _ => RawVector::Unknown,
        })
    }

    /// Returns the seconds since the first row.
    fn time(&mut self, record: &ByteRecord, position_m: [f64; 2]) -> Result<f64, ReadError> {
        let field = &record[self.at.time];
        // All road users of a frame have the same instant.
        if self.origin.is_some() && self.last_time.0 == field {
            return Ok(self.last_time.1);
        }
        let (whole_s, rest_s) = match &self.map.time {
            TimeColumn::Seconds(_) => (0, self.number(record, self.at.time)?),
            TimeColumn::Milliseconds(_) => (0, self.number(record, self.at.time)? / 1000.0),
            TimeColumn::Frames { rate_hz, .. } => (0, self.number(record, self.at.time)? / rate_hz),
            TimeColumn::Iso(column) => {
                let text = String::from_utf8_lossy(field);
                parse_iso(text.trim()).ok_or_else(|| ReadError::Instant {
                    file: self.file.to_owned(),
                    line: line_of(record),
                    column: column.clone(),
                    text: shown(field),
                })?
            }
        };
        let origin = self.origin.get_or_insert(Origin {
            whole_s,
            rest_s,
            position_m,
        });
        let time_s = (whole_s - origin.whole_s) as f64 + (rest_s - origin.rest_s);
        self.last_time.0.clear();
        self.last_time.0.extend_from_slice(field);
        self.last_time.1 = time_s;
        Ok(time_s)
    }

    fn number(&self, record: &ByteRecord, at: usize) -> Result<f64, ReadError> {
        let field = &record[at];
        let text = std::str::from_utf8(field).ok();
        let value = text.and_then(|it| it.trim().parse::<f64>().ok());
        value
            .filter(|it| it.is_finite())
            .ok_or_else(|| ReadError::Number {
                file: self.file.to_owned(),
                line: line_of(record),
                column: self.header[at].clone(),
                text: shown(field),
            })
    }
}

fn line_of(record: &ByteRecord) -> u64 {
    record.position().map_or(0, csv::Position::line)
}

/// Returns the beginning of a field for a message.
pub(crate) fn shown(field: &[u8]) -> String {
    let text = String::from_utf8_lossy(field);
    if text.chars().count() <= 40 {
        return text.into_owned();
    }
    let start: String = text.chars().take(40).collect();
    format!("{start}…")
}
