//! Recordings from arrays.

use std::collections::HashMap;
use std::fmt::Display;
use std::hash::Hash;

use crate::error::ReadError;
use crate::grid;
use crate::problem::{FilePlace, FileProblem};
use crate::raw::{RawRow, RawTrack, RawTracks, RawVector};
use crate::recording::{Class, ReadCounts, TrafficRecording};

/// Arrays of a recording: a value per row, a row per road user and instant.
///
/// The rows may have any order. Fields that you leave out are derived from the positions
/// or assumed from the class.
///
/// ```
/// use brakecheck_traffic::{RecordingColumns, TrafficRecording};
///
/// let mut columns = RecordingColumns::new(&["a", "a"], &[0.0, 0.1], &[0.0, 2.0], &[0.0, 0.0]);
/// columns.size_m = Some((&[4.5, 4.5], &[1.8, 1.8]));
/// let recording = TrafficRecording::from_columns("arrays", &columns)?;
/// assert_eq!(recording.tracks[0].speed_mps, [20.0, 20.0]);
/// # Ok::<(), brakecheck_traffic::ReadError>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct RecordingColumns<'a, Id> {
    /// Identity of the road user: numbers or texts.
    pub ids: &'a [Id],
    /// Seconds since any instant. Keep them small, because an f64 has 16 digits.
    pub times_s: &'a [f64],
    /// Box centre along the first axis in metres.
    pub x_m: &'a [f64],
    /// Box centre along the second axis in metres, to the left of the first.
    pub y_m: &'a [f64],
    /// Heading, counter-clockwise from the first axis. By default that of the motion.
    pub heading_rad: Option<&'a [f64]>,
    /// Velocity along the heading, by default derived from the positions.
    pub speed_mps: Option<&'a [f64]>,
    /// Length and width of the box in metres, by default those of the class.
    pub size_m: Option<(&'a [f64], &'a [f64])>,
    /// Class of the road user, by default a car. The most frequent one of a track counts.
    pub classes: Option<&'a [Class]>,
}

impl<'a, Id> RecordingColumns<'a, Id> {
    /// Creates columns with identities, times and positions.
    pub fn new(
        ids: &'a [Id],
        times_s: &'a [f64],
        x_m: &'a [f64],
        y_m: &'a [f64],
    ) -> RecordingColumns<'a, Id> {
        RecordingColumns {
            ids,
            times_s,
            x_m,
            y_m,
            heading_rad: None,
            speed_mps: None,
            size_m: None,
            classes: None,
        }
    }

    /// Returns the numeric columns with their names.
    fn numbers(&self) -> impl Iterator<Item = (&'static str, &'a [f64])> {
        [
            ("times_s", Some(self.times_s)),
            ("x_m", Some(self.x_m)),
            ("y_m", Some(self.y_m)),
            ("heading_rad", self.heading_rad),
            ("speed_mps", self.speed_mps),
            ("length_m", self.size_m.map(|it| it.0)),
            ("width_m", self.size_m.map(|it| it.1)),
        ]
        .into_iter()
        .filter_map(|(name, values)| Some((name, values?)))
    }

    /// Returns the first problem and its place.
    fn problem(&self) -> Option<(FilePlace, FileProblem)> {
        let want = self.times_s.len();
        let lengths = self.numbers().map(|(name, values)| (name, values.len()));
        let others = [
            ("ids", Some(self.ids.len())),
            ("classes", self.classes.map(<[Class]>::len)),
        ]
        .into_iter()
        .filter_map(|(name, got)| Some((name, got?)));
        // Lengths first, because the indexes below rely on them.
        if let Some((name, got)) = lengths.chain(others).find(|(_, got)| *got != want) {
            return Some((
                FilePlace::Whole,
                FileProblem::ArrayLength { name, got, want },
            ));
        }
        for (name, values) in self.numbers() {
            if let Some(at) = values.iter().position(|it| !it.is_finite()) {
                let problem = FileProblem::NotFinite {
                    owner: "the arrays".to_owned(),
                    name: name.to_owned(),
                    text: values[at].to_string(),
                };
                return Some((FilePlace::Index(at), problem));
            }
        }
        // `None` here is the good case: there is no size to be wrong.
        let (lengths_m, widths_m) = self.size_m?;
        [("length_m", lengths_m), ("width_m", widths_m)]
            .into_iter()
            .find_map(|(name, values)| {
                let at = values.iter().position(|it| *it <= 0.0)?;
                let problem = FileProblem::NotPositive {
                    owner: "the arrays".to_owned(),
                    name: name.to_owned(),
                    value: values[at],
                };
                Some((FilePlace::Index(at), problem))
            })
    }
}

impl TrafficRecording {
    /// Creates a recording from arrays. Errors call it by `name`.
    ///
    /// Instants and holes are treated as in [`read_csv`](crate::read_csv).
    ///
    /// # Errors
    /// Two arrays have different lengths, a value is not finite, a size is not positive,
    /// or a road user has two rows at one instant.
    pub fn from_columns<Id: Display + Eq + Hash>(
        name: &str,
        columns: &RecordingColumns<'_, Id>,
    ) -> Result<TrafficRecording, ReadError> {
        if let Some((place, problem)) = columns.problem() {
            return Err(ReadError::Content {
                file: name.to_owned(),
                place,
                problem,
            });
        }
        let mut by_id: HashMap<&Id, usize> = HashMap::new();
        let mut tracks: Vec<RawTrack> = Vec::new();
        let first = |values: &[f64]| values.first().copied().unwrap_or(0.0);
        // Relative to the first row, which keeps the digits of epochs and map
        // coordinates.
        let (start_s, origin_m) = (
            first(columns.times_s),
            [first(columns.x_m), first(columns.y_m)],
        );
        for (i, id) in columns.ids.iter().enumerate() {
            let at = *by_id.entry(id).or_insert_with(|| {
                tracks.push(RawTrack {
                    id: id.to_string().into_bytes(),
                    ..RawTrack::default()
                });
                tracks.len() - 1
            });
            let track = &mut tracks[at];
            let class = columns.classes.map_or(Class::Car, |it| it[i]);
            let size_m = columns.size_m.map_or([0.0; 2], |(lengths_m, widths_m)| {
                [lengths_m[i], widths_m[i]]
            });
            let speed_mps = columns.speed_mps.map(|it| it[i]);
            track.rows.push(RawRow {
                time_s: columns.times_s[i] - start_s,
                x_m: columns.x_m[i] - origin_m[0],
                y_m: columns.y_m[i] - origin_m[1],
                heading_rad: columns.heading_rad.map(|it| it[i]),
                velocity: speed_mps.map_or(RawVector::Unknown, RawVector::Along),
                acceleration: RawVector::Unknown,
                marked: false,
                size_m,
                class: Some(class),
            });
        }
        let raw = RawTracks {
            tracks,
            counts: ReadCounts {
                rows: columns.ids.len(),
                ..ReadCounts::default()
            },
            origin_m,
            reading: "arrays in s, m, rad and m/s; box centre".to_owned(),
            rate_hz: None,
        };
        grid::recording(raw, name)
    }
}
