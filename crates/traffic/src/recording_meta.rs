//! Files beside the tracks of highD, inD, rounD, exiD and uniD.
//!
//! `NN_recordingMeta.csv` has the frame rate and the place, and `NN_tracksMeta.csv` has the
//! class, the box and the frames of every track. Much of it is in `NN_tracks.csv` as well,
//! so the files are compared.

use std::collections::HashMap;
use std::io::Read;

use crate::column_map::{ColumnMap, SizeColumns, TimeColumn};
use crate::csv_rows::{CsvTable, line_of};
use crate::error::ReadError;
use crate::raw::RawTrack;
use crate::recording::{Class, ReadCounts};
use crate::xosc_entity::class_of_words;

/// Difference of two sizes that is no rounding: metres, and a share.
const SIZE_M: f64 = 0.1;
const SIZE_SHARE: f64 = 0.05;
/// Time by which frames may outlast the stated duration: seconds, and a share.
const LONGER_S: f64 = 1.0;
const LONGER_SHARE: f64 = 0.02;
/// Columns of a box in `NN_tracksMeta.csv`. In highD the height is the width.
const BOX: [&str; 3] = ["length", "width", "height"];

/// Contents of the files beside `NN_tracks.csv`, as far as they are there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingMeta {
    recording: Option<RecordingLine>,
    tracks: Option<TrackLines>,
}

/// The row of `NN_recordingMeta.csv`.
#[derive(Clone, Debug, PartialEq)]
struct RecordingLine {
    file: String,
    rate_hz: f64,
    location: Option<String>,
    duration_s: Option<f64>,
    tracks: Option<f64>,
}

/// Rows of `NN_tracksMeta.csv` by the identity of the track.
#[derive(Clone, Debug, PartialEq)]
struct TrackLines {
    file: String,
    by_id: HashMap<Vec<u8>, TrackLine>,
}

#[derive(Clone, Debug, PartialEq)]
struct TrackLine {
    line: u64,
    /// Word for the class.
    class: Option<String>,
    /// Columns of [`BOX`].
    box_m: [Option<f64>; 3],
    /// First frame, last frame, and number of frames.
    frames: [Option<f64>; 3],
}

impl RecordingMeta {
    /// Adds the contents of `NN_recordingMeta.csv`. Errors call it by `name`.
    ///
    /// # Errors
    /// It has no row or no positive `frameRate`, or a value is not a finite number.
    pub fn with_recording(self, rows: impl Read, name: &str) -> Result<RecordingMeta, ReadError> {
        let mut table = CsvTable::open(rows, name)?;
        let row = table.next()?.ok_or_else(|| ReadError::Empty {
            file: name.to_owned(),
        })?;
        let rate_hz = table.required(&row, "frameRate")?;
        if rate_hz <= 0.0 {
            return Err(table.wrong(&row, "frameRate"));
        }
        let recording = RecordingLine {
            file: name.to_owned(),
            rate_hz,
            location: table.text(&row, "locationId"),
            duration_s: table.number(&row, "duration")?,
            tracks: table.number(&row, "numTracks")?,
        };
        Ok(RecordingMeta {
            recording: Some(recording),
            ..self
        })
    }

    /// Adds the contents of `NN_tracksMeta.csv`. Errors call it by `name`.
    ///
    /// # Errors
    /// It has no column of identities, or a value is not a finite number, or a track has two
    /// rows, or first frame, last frame and number of frames of a track contradict each other.
    pub fn with_tracks(self, rows: impl Read, name: &str) -> Result<RecordingMeta, ReadError> {
        let mut table = CsvTable::open(rows, name)?;
        // inD and its successors call the column `trackId`, and highD calls it
        // `id`.
        let id_column = if table.column("trackId").is_some() {
            "trackId"
        } else {
            "id"
        };
        let mut by_id: HashMap<Vec<u8>, TrackLine> = HashMap::new();
        while let Some(row) = table.next()? {
            let id = table.field(&row, id_column)?.to_vec();
            let mut track = TrackLine {
                line: line_of(&row),
                class: table.text(&row, "class"),
                box_m: [None; 3],
                frames: [None; 3],
            };
            for (value, column) in track.box_m.iter_mut().zip(BOX) {
                *value = table.number(&row, column)?;
            }
            let columns = ["initialFrame", "finalFrame", "numFrames"];
            for (value, column) in track.frames.iter_mut().zip(columns) {
                *value = table.number(&row, column)?;
            }
            if let [Some(first), Some(last), Some(count)] = track.frames
                // Frame numbers are whole and far below 2^53, so the
                // comparison is exact.
                && last - first + 1.0 != count
            {
                return Err(ReadError::Contradiction {
                    file: format!("{name}:{}", track.line),
                    said: format!("`numFrames` is {count}"),
                    other: name.to_owned(),
                    other_said: format!("`initialFrame` is {first} and `finalFrame` is {last}"),
                });
            }
            // Of two rows, nothing shows which one has the class and the box.
            if let Some(other) = by_id.get(&id) {
                let shown = String::from_utf8_lossy(&id);
                return Err(ReadError::Contradiction {
                    file: format!("{name}:{}", track.line),
                    said: format!("`{id_column}` is {shown}"),
                    other: format!("{name}:{}", other.line),
                    other_said: format!("`{id_column}` is {shown}, too"),
                });
            }
            by_id.insert(id, track);
        }
        Ok(RecordingMeta {
            tracks: Some(TrackLines {
                file: name.to_owned(),
                by_id,
            }),
            ..self
        })
    }

    /// Returns the map with the stated frame rate.
    ///
    /// # Errors
    /// A map of one's own states another rate.
    pub(crate) fn timed(&self, map: &ColumnMap) -> Result<ColumnMap, ReadError> {
        let mut timed = map.clone();
        let (Some(meta), TimeColumn::Frames { rate_hz, .. }) = (&self.recording, &mut timed.time)
        else {
            return Ok(timed);
        };
        let shipped = ColumnMap::shipped_names().into_iter();
        // The rate of a shipped map is only a default, so the meta file may
        // replace it.
        let is_shipped = shipped.filter_map(ColumnMap::shipped).any(|it| it == *map);
        if !is_shipped && *rate_hz != meta.rate_hz {
            return Err(ReadError::Contradiction {
                file: meta.file.clone(),
                said: format!("`frameRate` is {}", meta.rate_hz),
                other: "the column map".to_owned(),
                other_said: format!("`rate_hz` is {rate_hz}"),
            });
        }
        *rate_hz = meta.rate_hz;
        Ok(timed)
    }

    /// Compares the files and gives the tracks their classes and boxes.
    ///
    /// `first_frame` is the frame of the instant 0 of the rows, `None` if the time is no
    /// frame number. Errors call the tracks' file by `name`.
    pub(crate) fn complete(
        &self,
        tracks: &mut [RawTrack],
        counts: &mut ReadCounts,
        map: &ColumnMap,
        first_frame: Option<f64>,
        name: &str,
    ) -> Result<(), ReadError> {
        let rate_hz = self.recording.as_ref().map(|it| it.rate_hz);
        let frames = first_frame.zip(rate_hz.or(match map.time {
            TimeColumn::Frames { rate_hz, .. } => Some(rate_hz),
            _ => None,
        }));
        // First, because a wrong file would give an error for every track.
        self.check_counts(tracks, name)?;
        let Some(lines) = &self.tracks else {
            return Ok(());
        };
        for track in tracks {
            let id = track.id();
            // The reverse is no error: a cut `NN_tracks.csv` lacks tracks that
            // the meta file lists.
            let Some(line) = lines.by_id.get(&track.id) else {
                return Err(ReadError::Contradiction {
                    file: name.to_owned(),
                    said: format!("track `{id}` has {} rows", track.rows.len()),
                    other: lines.file.clone(),
                    other_said: "there is no such track".to_owned(),
                });
            };
            let differ = |said: String, other_said: String| ReadError::Contradiction {
                file: name.to_owned(),
                said: format!("track `{id}` {said}"),
                other: format!("{}:{}", lines.file, line.line),
                other_said,
            };
            line.check_frames(track, frames, &differ)?;
            line.give_box(track, map, &differ)?;
            line.give_class(track, counts);
        }
        Ok(())
    }

    /// Compares the number of tracks, and the frames of all of them with the duration.
    fn check_counts(&self, tracks: &[RawTrack], name: &str) -> Result<(), ReadError> {
        let Some(recording) = &self.recording else {
            return Ok(());
        };
        let stated = recording.tracks.zip(self.tracks.as_ref());
        if let Some((count, lines)) = stated.filter(|it| it.0 != it.1.by_id.len() as f64) {
            return Err(ReadError::Contradiction {
                file: recording.file.clone(),
                said: format!("`numTracks` is {count}"),
                other: lines.file.clone(),
                other_said: format!("it has {} tracks", lines.by_id.len()),
            });
        }
        let instants = || {
            tracks
                .iter()
                .flat_map(|it| it.rows.iter().map(|it| it.time_s))
        };
        // Rows are not sorted yet, so the ends are searched.
        let first_s = instants().fold(f64::INFINITY, f64::min);
        let span_s = instants().fold(f64::NEG_INFINITY, f64::max) - first_s;
        let most_s = |duration_s: f64| LONGER_S + (1.0 + LONGER_SHARE) * duration_s;
        match recording.duration_s {
            Some(duration_s) if span_s > most_s(duration_s) => Err(ReadError::Contradiction {
                file: recording.file.clone(),
                said: format!(
                    "`frameRate` is {} and `duration` is {duration_s}",
                    recording.rate_hz
                ),
                other: name.to_owned(),
                other_said: format!("at this rate its frames last {span_s:.2} s"),
            }),
            _ => Ok(()),
        }
    }

    /// Compares the frame rate with the period of the time stamps.
    pub(crate) fn check_period(
        &self,
        map: &ColumnMap,
        dt_s: f64,
        name: &str,
    ) -> Result<(), ReadError> {
        let Some(recording) = &self.recording else {
            return Ok(());
        };
        let is_same = (dt_s * recording.rate_hz - 1.0).abs() < 0.02;
        // Of frame numbers the rate is that of the file itself. Others may be left out.
        if is_same || matches!(map.time, TimeColumn::Frames { .. }) {
            return Ok(());
        }
        Err(ReadError::Contradiction {
            file: recording.file.clone(),
            said: format!("`frameRate` is {}", recording.rate_hz),
            other: name.to_owned(),
            other_said: format!("its time stamps are {dt_s:.6} s apart"),
        })
    }

    /// Returns what was read of the files in words, for the end of a sentence.
    pub(crate) fn in_words(&self, tracks: usize) -> String {
        let mut text = String::new();
        if let Some(recording) = &self.recording {
            text += &format!("; `{}`: {} Hz", recording.file, recording.rate_hz);
            if let Some(location) = &recording.location {
                text += &format!(", location {location}");
            }
        }
        if let Some(lines) = &self.tracks {
            let more = lines.by_id.len().saturating_sub(tracks);
            text += &format!("; `{}`: classes and sizes of {tracks} tracks", lines.file);
            if more > 0 {
                text += &format!(", {more} more have no rows");
            }
        }
        text
    }
}

impl TrackLine {
    /// Compares the rows with the frames. Frames have the number of the first and the rate.
    fn check_frames(
        &self,
        track: &RawTrack,
        frames: Option<(f64, f64)>,
        differ: &dyn Fn(String, String) -> ReadError,
    ) -> Result<(), ReadError> {
        let rows = track.rows.len();
        if let Some(count) = self.frames[2].filter(|it| *it != rows as f64) {
            return Err(differ(
                format!("has {rows} rows"),
                format!("`numFrames` is {count}"),
            ));
        }
        let Some((first_frame, rate_hz)) = frames else {
            return Ok(());
        };
        let instants = || track.rows.iter().map(|it| it.time_s);
        let ends_s = [
            instants().fold(f64::INFINITY, f64::min),
            instants().fold(f64::NEG_INFINITY, f64::max),
        ];
        let names = [("begins", "initialFrame"), ("ends", "finalFrame")];
        for ((end_s, (verb, column)), stated) in ends_s.into_iter().zip(names).zip(self.frames) {
            // Rounded, because the way through seconds costs the last digits.
            let frame = (first_frame + end_s * rate_hz).round();
            if let Some(stated) = stated.filter(|it| *it != frame) {
                return Err(differ(
                    format!("{verb} with frame {frame}"),
                    format!("`{column}` is {stated}"),
                ));
            }
        }
        Ok(())
    }

    /// Compares the box with that of the rows, or gives it to rows without one.
    fn give_box(
        &self,
        track: &mut RawTrack,
        map: &ColumnMap,
        differ: &dyn Fn(String, String) -> ReadError,
    ) -> Result<(), ReadError> {
        // The columns have the names of those in the tracks' file.
        let names = match &map.size {
            SizeColumns::Columns { length, width } => [&**length, &**width],
            SizeColumns::ByClass | SizeColumns::Fixed { .. } => ["length", "width"],
        };
        let stated = names.map(|name| {
            let at = BOX.iter().position(|it| it.eq_ignore_ascii_case(name));
            Some(self.box_m[at?]? * map.length_unit.metres())
        });
        let [Some(length_m), Some(width_m)] = stated else {
            return Ok(());
        };
        for row in &track.rows {
            for ((own_m, stated_m), name) in row.size_m.iter().zip([length_m, width_m]).zip(names) {
                // 0 means that a size is not recorded, which contradicts
                // nothing.
                let is_known = *own_m > 0.0 && stated_m > 0.0;
                if is_known && (own_m - stated_m).abs() > SIZE_M + SIZE_SHARE * stated_m {
                    return Err(differ(
                        format!("has a `{name}` of {own_m} m"),
                        format!("`{name}` is {stated_m} m"),
                    ));
                }
            }
        }
        if length_m > 0.0 && width_m > 0.0 {
            track.size_m = Some([length_m, width_m]);
        }
        Ok(())
    }

    fn give_class(&self, track: &mut RawTrack, counts: &mut ReadCounts) {
        let Some(word) = &self.class else {
            return;
        };
        let known = class_of_words(word);
        if known.is_none() {
            counts.unknown_class += track.rows.len();
        }
        for row in &mut track.rows {
            // The meta file has priority over a class that the rows only
            // guess.
            row.class = Some(known.unwrap_or(Class::Other));
        }
    }
}
