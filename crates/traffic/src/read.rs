//! Reading of long CSV files.

use std::collections::HashMap;
use std::io::{BufRead, Read};

use brakecheck_stl::table::{Decimals, DelimitedTable, calendar_range, parse_iso};
use csv::ByteRecord;

use crate::column_map::{ClassColumns, ColumnMap, Reference, SizeColumns, TimeColumn, YAxis};
use crate::csv_rows::{header_shown, line_of, open_table, shown, table_error};
use crate::error::ReadError;
use crate::grid;
use crate::named_map::unread_unit;
use crate::positions::Positions;
use crate::raw::{FARTHEST_M, RawReference, RawRow, RawTrack, RawTracks, RawVector};
use crate::recording::{Class, ReadCounts, TrafficRecording};
use crate::recording_meta::RecordingMeta;
use crate::xosc_entity::class_of_words;

/// Length of the longest road user, beyond that of any train, and width of the widest.
const MOST_SIZE_M: [f64; 2] = [1000.0, 20.0];

/// Largest number of a time in any unit. Nanoseconds since 1970 stay far below it.
const MOST_TIME: f64 = 1e21;

/// Name of maps of usual names.
const BY_NAME: &str = "by name";

/// Reads rows with the column map that the header determines.
///
/// It is a shipped map, or one of usual names ([`ColumnMap::by_names`]), which is called
/// `by name`. Returns the name of the map, too.
///
/// # Errors
/// No map fits, or a row is invalid.
pub fn read_csv_guessed(
    rows: impl Read,
    name: &str,
) -> Result<(TrafficRecording, &'static str), ReadError> {
    read_csv_timed(rows, name, None)
}

/// Reads rows like [`read_csv_guessed`], with another time column.
///
/// # Errors
/// No map fits, or a row is invalid.
pub fn read_csv_timed(
    rows: impl Read,
    name: &str,
    time: Option<&str>,
) -> Result<(TrafficRecording, &'static str), ReadError> {
    let columns = CsvColumns {
        time,
        ..CsvColumns::default()
    };
    columns.read(rows, name)
}

/// Columns of a CSV file, and what other files say of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct CsvColumns<'a> {
    /// Column map, by default the one that the header determines.
    pub map: Option<&'a ColumnMap>,
    /// Another time column than that of the header's map.
    pub time: Option<&'a str>,
    /// Files beside the tracks, such as `NN_tracksMeta.csv`.
    pub meta: Option<&'a RecordingMeta>,
}

impl CsvColumns<'_> {
    /// Reads rows as [`read_csv`] does. Errors call them by `name`.
    ///
    /// Returns the name of the map that the header determines, too.
    ///
    /// # Errors
    /// No map fits, a row is invalid, or the files contradict each other.
    pub fn read(
        &self,
        rows: impl Read,
        name: &str,
    ) -> Result<(TrafficRecording, &'static str), ReadError> {
        let delimiter = self.map.and_then(|map| map.delimiter);
        let table = open_table(rows, delimiter, name)?;
        // A map of the user is never second-guessed, even where a shipped map
        // fits the header too.
        let (map, known) = match self.map {
            Some(map) => (map.clone(), "as given"),
            None => self.guess(table.names(), name)?,
        };
        let none = RecordingMeta::default();
        let meta = self.meta.unwrap_or(&none);
        // Before the rows, because the rate of the meta file converts their
        // frame numbers.
        let timed = meta.timed(&map)?;
        let recording = read_rows(table, name, &timed, meta)?;
        // After the rows, because the period is fitted to all of their
        // instants.
        meta.check_period(&timed, recording.dt_s, name)?;
        Ok((recording, known))
    }

    /// Returns the map that a header determines, with its name.
    fn guess(&self, header: &[String], name: &str) -> Result<(ColumnMap, &'static str), ReadError> {
        let guessed = ColumnMap::guess(header);
        // Shipped maps have priority: they also know units and reference
        // points, which names alone do not show.
        let shipped = guessed.and_then(|it| Some((ColumnMap::shipped(it)?, it)));
        let named = || Some((ColumnMap::by_names(header, self.time)?, BY_NAME));
        let Some((mut map, known)) = shipped.or_else(named) else {
            return Err(ReadError::UnknownFormat {
                file: name.to_owned(),
                header: header_shown(header),
            });
        };
        // A shipped map states its units. A guess by name would take an unread
        // unit for metres, so it is refused.
        if known == BY_NAME
            && let Some(column) = unread_unit(&map)
        {
            return Err(ReadError::Unit {
                file: name.to_owned(),
                column: column.to_owned(),
            });
        }
        // The generic map has no class, and walkers of a file with one would be
        // taken for cars.
        if known == "generic" {
            map.read_class(header);
        }
        // A shipped map keeps its other columns. A guessed one has searched
        // with this column already.
        if let Some(column) = self.time {
            map.time = TimeColumn::named(column);
        }
        Ok((map, known))
    }
}

/// Reads rows with a column map. Errors call them by `name`.
///
/// The rows may have any order. The result has one time grid, whose period is fitted to
/// all instants. A row on the grid is taken as it is. Otherwise the neighbours in time
/// are interpolated. Holes of up to [`HOLE_S`](crate::HOLE_S) are filled and marked, and
/// longer ones split a track, as do jumps. [`ReadCounts`] counts all of it.
///
/// # Errors
/// A column is missing, a row is invalid, or speeds or headings contradict the positions.
pub fn read_csv(
    rows: impl Read,
    name: &str,
    map: &ColumnMap,
) -> Result<TrafficRecording, ReadError> {
    let columns = CsvColumns {
        map: Some(map),
        ..CsvColumns::default()
    };
    Ok(columns.read(rows, name)?.0)
}

fn read_rows(
    mut table: DelimitedTable<impl BufRead>,
    name: &str,
    map: &ColumnMap,
    meta: &RecordingMeta,
) -> Result<TrafficRecording, ReadError> {
    let header = table.names().to_vec();
    let mut parser = RowParser::new(&header, name, map, table.decimals())?;
    let mut record = ByteRecord::new();
    while table
        .read(&mut record)
        .map_err(|it| table_error(it, name))?
    {
        parser.push(&record)?;
    }
    if parser.tracks.is_empty() {
        return Err(ReadError::NoRows {
            file: name.to_owned(),
        });
    }
    let is_frames = matches!(map.time, TimeColumn::Frames { .. });
    // `finish` consumes the parser, and the meta file counts frames from the
    // first row of the file.
    let first_frame = parser.origin.as_ref().map(|origin| origin.rest);
    let mut raw = parser.finish();
    let frame = first_frame.filter(|_| is_frames);
    meta.complete(&mut raw.tracks, &mut raw.counts, map, frame, name)?;
    raw.reading += &meta.in_words(raw.tracks.len());
    grid::recording(raw, name)
}

/// Converts rows into raw tracks in metres and seconds, in a frame with y to the left.
struct RowParser<'a> {
    header: &'a [String],
    file: &'a str,
    map: &'a ColumnMap,
    decimals: Decimals,
    /// Whether times are dates.
    is_iso: bool,
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
    /// In the unit of the column, in which it is exact.
    rest: f64,
    position_m: [f64; 2],
}

impl<'a> RowParser<'a> {
    fn new(
        header: &'a [String],
        file: &'a str,
        map: &'a ColumnMap,
        decimals: Decimals,
    ) -> Result<RowParser<'a>, ReadError> {
        Ok(RowParser {
            header,
            file,
            map,
            decimals,
            is_iso: matches!(map.time, TimeColumn::Iso(_)),
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
            reading: match &self.map.time {
                // A column that is called a time in seconds may have dates.
                TimeColumn::Seconds(column) if self.is_iso => ColumnMap {
                    time: TimeColumn::Iso(column.clone()),
                    ..self.map.clone()
                }
                .in_words(),
                _ => self.map.in_words(),
            },
            rate_hz: match &self.map.time {
                TimeColumn::Frames { rate_hz, .. } => Some(*rate_hz),
                _ => None,
            },
        }
    }

    fn push(&mut self, record: &ByteRecord) -> Result<(), ReadError> {
        // SUMO writes a row for every instant, also for those without a vehicle.
        if record[self.at.id].is_empty() {
            self.counts.without_id += 1;
            return Ok(());
        }
        self.counts.rows += 1;
        // Units first: everything after this line is in metres.
        let unit = self.map.length_unit.metres();
        let flip = match self.map.y_axis {
            YAxis::Left => 1.0,
            YAxis::Right => -1.0,
        };
        let (mut x_m, mut y_m) = (
            self.place(record, self.at.x)? * unit,
            self.place(record, self.at.y)? * unit,
        );
        let size_m = self.size(record)?;
        if self.map.reference == Reference::Corner {
            // Boxes along the file's axes, so the heading does not matter.
            x_m += 0.5 * size_m[0];
            y_m += 0.5 * size_m[1];
        }
        let heading_rad = match (&self.map.heading, self.at.heading) {
            (Some(angle), Some(at)) => Some(angle.unit.heading_rad(self.number(record, at)?, flip)),
            _ => None,
        };
        // The first call sets the origin, so this precedes the reading of the
        // origin below.
        let time_s = self.time(record, [x_m, flip * y_m])?;
        let origin = self.origin.as_ref().map_or([0.0; 2], |it| it.position_m);
        // Python, JSON and spreadsheets spell true in different ways.
        let marked = self
            .at
            .interpolated
            .is_some_and(|at| matches!(&record[at], b"True" | b"true" | b"TRUE" | b"1"));
        self.counts.marked += usize::from(marked);
        let speed_unit = self.map.speed_unit.mps(self.map.length_unit);
        let row = RawRow {
            time_s,
            x_m: x_m - origin[0],
            y_m: flip * y_m - origin[1],
            heading_rad,
            velocity: self.vector(record, &self.at.velocity, speed_unit, flip)?,
            acceleration: self.vector(record, &self.at.acceleration, unit, flip)?,
            marked,
            size_m,
            class: self.class(record, size_m[0]),
        };
        let track = self.track_of(record);
        // Sums, so that the class is of the mean share.
        let shares = self.at.shares.clone();
        for (at, class) in shares {
            let share = self.number(record, at)?;
            self.tracks[track].shares[class as usize] += share;
        }
        self.tracks[track].rows.push(row);
        Ok(())
    }

    fn track_of(&mut self, record: &ByteRecord) -> usize {
        let id = &record[self.at.id];
        // Rows of one road user often follow each other.
        if self.tracks.get(self.last).is_some_and(|it| it.id == id) {
            return self.last;
        }
        // The position is kept in the order of first appearance, so that
        // output does not depend on the hash order.
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

    /// Returns the class of a row, `None` where shares decide.
    fn class(&mut self, record: &ByteRecord, length_m: f64) -> Option<Class> {
        let text = self.at.code.map(|at| String::from_utf8_lossy(&record[at]));
        let known = match (&self.map.class, text) {
            (ClassColumns::Codes { codes, .. }, Some(code)) => codes.get(code.trim()).copied(),
            (ClassColumns::Words(_), Some(words)) => class_of_words(&words),
            // Before the comparison with trucks: a size of 0 means that it is
            // not recorded.
            (ClassColumns::ByLength { without_size, .. }, _) if length_m == 0.0 => {
                Some(*without_size)
            }
            (ClassColumns::ByLength { truck_from_m, .. }, _) if *truck_from_m <= length_m => {
                Some(Class::Truck)
            }
            (ClassColumns::Fixed(class), _) => Some(*class),
            (ClassColumns::Shares(_), _) => return None,
            // Of the classes by length, shorter than a truck. The other maps
            // have returned above.
            _ => Some(Class::Car),
        };
        // Counted, so that the summary shows how many classes are assumptions.
        self.counts.unknown_class += usize::from(known.is_none());
        // A vehicle of an unknown word is evaluated, one of an unlisted code is another.
        let unknown = match &self.map.class {
            ClassColumns::Words(_) => Class::Car,
            _ => Class::Other,
        };
        Some(known.unwrap_or(unknown))
    }

    /// Returns the length and width in metres, 0 where they are not recorded.
    fn size(&self, record: &ByteRecord) -> Result<[f64; 2], ReadError> {
        if let SizeColumns::Fixed { length_m, width_m } = &self.map.size {
            return Ok([*length_m, *width_m]);
        }
        let Some((length, width)) = self.at.size else {
            return Ok([0.0; 2]);
        };
        let size = |at: usize, most_m: f64| {
            // An empty cell is a size that was not recorded, and no mistake.
            if record[at].is_empty() {
                return Ok(0.0);
            }
            let value = self.number(record, at)?;
            let size_m = value * self.map.length_unit.metres();
            // A negative size would turn the box inside out, and a huge one
            // touches everything.
            if (0.0..most_m).contains(&size_m) {
                return Ok(size_m);
            }
            Err(ReadError::Size {
                file: self.file.to_owned(),
                line: line_of(record),
                column: self.header[at].clone(),
                value,
            })
        };
        let size_m = [size(length, MOST_SIZE_M[0])?, size(width, MOST_SIZE_M[1])?];
        // A box without an extent in one direction is none.
        Ok(if size_m.contains(&0.0) {
            [0.0; 2]
        } else {
            size_m
        })
    }

    /// Returns a coordinate in the unit of the file.
    fn place(&self, record: &ByteRecord, at: usize) -> Result<f64, ReadError> {
        let value = self.number(record, at)?;
        // Checked per row, because the first row becomes the origin of all
        // others.
        if value.abs() * self.map.length_unit.metres() <= FARTHEST_M {
            return Ok(value);
        }
        Err(ReadError::Far {
            file: self.file.to_owned(),
            line: line_of(record),
            column: self.header[at].clone(),
            value,
        })
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
        // Only the first row decides, so that a file does not mix dates and
        // numbers.
        if self.origin.is_none() && matches!(self.map.time, TimeColumn::Seconds(_)) {
            // A date that does not exist is a wrong instant and not a wrong number.
            self.is_iso = iso_of(field).is_some() || is_no_date(field);
        }
        let (whole_s, rest) = if self.is_iso {
            iso_of(field).ok_or_else(|| ReadError::Instant {
                file: self.file.to_owned(),
                line: line_of(record),
                column: self.map.time.column().to_owned(),
                text: shown(field),
            })?
        } else {
            let value = self.number(record, self.at.time)?;
            if value.abs() > MOST_TIME {
                return Err(ReadError::Time {
                    file: self.file.to_owned(),
                    line: line_of(record),
                    column: self.map.time.column().to_owned(),
                    value,
                });
            }
            (0, value)
        };
        let origin = self.origin.get_or_insert(Origin {
            whole_s,
            rest,
            position_m,
        });
        // The difference first: an epoch in nanoseconds has all digits of an f64.
        let unit_s = match self.map.time.unit_s() {
            Some(unit_s) if !self.is_iso => unit_s,
            _ => 1.0,
        };
        let time_s = (whole_s - origin.whole_s) as f64 + (rest - origin.rest) * unit_s;
        // The buffer is reused, since this runs once per frame of files with
        // millions of rows.
        self.last_time.0.clear();
        self.last_time.0.extend_from_slice(field);
        self.last_time.1 = time_s;
        Ok(time_s)
    }

    fn number(&self, record: &ByteRecord, at: usize) -> Result<f64, ReadError> {
        let field = &record[at];
        self.decimals
            .number(field)
            .ok_or_else(|| ReadError::Number {
                file: self.file.to_owned(),
                line: line_of(record),
                column: self.header[at].clone(),
                text: shown(field),
            })
    }
}

/// Returns whether a field is a date with a month or a day that does not exist.
fn is_no_date(field: &[u8]) -> bool {
    std::str::from_utf8(field).is_ok_and(|text| calendar_range(text).is_some())
}

fn iso_of(field: &[u8]) -> Option<(i64, f64)> {
    parse_iso(std::str::from_utf8(field).ok()?.trim())
}
