//! From raw rows to tracks on one time grid.

use std::f64::consts::PI;

use crate::error::ReadError;
use crate::problem::{FilePlace, FileProblem};
use crate::recording::{Class, HOLE_S, ReadCounts, RoadUserTrack, TrafficRecording};

/// Share of a period by which an instant may be off the grid.
const ON_GRID: f64 = 0.05;

/// Greatest number of samples of a recording, a month at 20 Hz.
const MOST_SAMPLES: f64 = 5.0e7;

/// Speed below which the direction of motion is no heading, in m/s.
const STANDING_MPS: f64 = 0.5;

/// Recorded vector of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum RawVector {
    Unknown,
    Along(f64),
    Components(f64, f64),
}

/// Row of a road user, in seconds and metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawRow {
    pub(crate) time_s: f64,
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) heading_rad: Option<f64>,
    pub(crate) velocity: RawVector,
    pub(crate) acceleration: RawVector,
    pub(crate) marked: bool,
}

/// Point of a road user whose positions are recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum RawReference {
    #[default]
    Centre,
    Front,
    /// The box centre lies this far ahead and to the left of it.
    CentreAt {
        ahead_m: f64,
        left_m: f64,
    },
}

impl RawReference {
    /// Returns how far the centre is ahead and to the left.
    fn centre_m(self, length_m: f64) -> (f64, f64) {
        match self {
            RawReference::Centre => (0.0, 0.0),
            RawReference::Front => (-0.5 * length_m, 0.0),
            RawReference::CentreAt { ahead_m, left_m } => (ahead_m, left_m),
        }
    }
}

/// Rows of a road user, in any order.
#[derive(Clone, Debug, Default)]
pub(crate) struct RawTrack {
    pub(crate) id: Vec<u8>,
    pub(crate) reference: RawReference,
    pub(crate) rows: Vec<RawRow>,
    /// Sum per class.
    pub(crate) shares: [f64; Class::ALL.len()],
    pub(crate) length_sum_m: f64,
    pub(crate) width_sum_m: f64,
    /// Number of rows in the sums. Without any the size is that of the class.
    pub(crate) seen: f64,
}

impl RawTrack {
    /// Returns the length and width.
    fn size_m(&self) -> [f64; 2] {
        if self.seen == 0.0 {
            return self.class().usual_size_m();
        }
        [self.length_sum_m, self.width_sum_m].map(|sum_m| sum_m / self.seen)
    }

    fn class(&self) -> Class {
        let by_share = |a: &&Class, b: &&Class| {
            let share = |class: Class| self.shares[class as usize];
            share(**a).total_cmp(&share(**b))
        };
        let best = Class::ALL.iter().max_by(by_share);
        best.copied().unwrap_or_default()
    }

    fn id(&self) -> String {
        String::from_utf8_lossy(&self.id).into_owned()
    }
}

/// All rows of a file.
pub(crate) struct RawTracks {
    pub(crate) tracks: Vec<RawTrack>,
    pub(crate) counts: ReadCounts,
    pub(crate) origin_m: [f64; 2],
}

/// Puts all rows on the time grid of the file.
pub(crate) fn recording(raw: RawTracks, file: &str) -> Result<TrafficRecording, ReadError> {
    let RawTracks {
        mut tracks,
        mut counts,
        origin_m,
    } = raw;
    for track in &mut tracks {
        track.rows.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        // Two rows at one instant contradict each other, and nothing shows which is right.
        let repeated = track
            .rows
            .windows(2)
            .find(|it| it[0].time_s == it[1].time_s);
        if let Some(rows) = repeated {
            return Err(ReadError::Repeated {
                file: file.to_owned(),
                id: track.id(),
                time_s: rows[0].time_s,
            });
        }
    }
    counts.assumed_sizes = tracks.iter().filter(|it| it.seen == 0.0).count();
    let empty = || ReadError::Empty {
        file: file.to_owned(),
    };
    let dt_s = median_step(&tracks).ok_or_else(empty)?;
    let firsts = tracks.iter().filter_map(|it| it.rows.first());
    let first_s = firsts.map(|row| row.time_s).fold(f64::INFINITY, f64::min);
    check_span(&tracks, first_s, dt_s, file)?;
    let mut all = Vec::with_capacity(tracks.len());
    for raw in &mut tracks {
        for row in &mut raw.rows {
            row.time_s -= first_s;
        }
        let rows = std::mem::take(&mut raw.rows);
        for part in parts(&rows, dt_s, &mut counts) {
            match track(raw, part, dt_s, &mut counts) {
                Some(track) => all.push(track),
                None => counts.too_short += 1,
            }
        }
    }
    if all.is_empty() {
        return Err(empty());
    }
    Ok(TrafficRecording {
        name: file.to_owned(),
        dt_s,
        origin_m,
        tracks: all,
        counts,
    })
}

/// Returns an error if the time grid would have more than [`MOST_SAMPLES`].
fn check_span(tracks: &[RawTrack], first_s: f64, dt_s: f64, file: &str) -> Result<(), ReadError> {
    let lasts = tracks.iter().filter_map(|it| it.rows.last());
    // Rows are sorted with NaN last, and a NaN is no span.
    let span = |row: &RawRow| row.time_s - first_s;
    let fits = |span_s: &f64| (0.0..=MOST_SAMPLES * dt_s).contains(span_s);
    match lasts.map(span).find(|span_s| !fits(span_s)) {
        Some(span_s) => Err(ReadError::Content {
            file: file.to_owned(),
            place: FilePlace::Whole,
            problem: FileProblem::Span { span_s, dt_s },
        }),
        None => Ok(()),
    }
}

/// Returns the median step of all road users, rounded to microseconds.
fn median_step(tracks: &[RawTrack]) -> Option<f64> {
    let step = |rows: &[RawRow]| rows[1].time_s - rows[0].time_s;
    let mut steps: Vec<f64> = tracks
        .iter()
        .flat_map(|it| it.rows.windows(2).map(step))
        .collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    let (_, median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    let rounded = (*median * 1e6).round() / 1e6;
    // Steps below half a microsecond are no sampling rate.
    (0.0 < rounded).then_some(rounded)
}

/// Splits rows at long holes.
fn parts<'a>(rows: &'a [RawRow], dt_s: f64, counts: &mut ReadCounts) -> Vec<&'a [RawRow]> {
    let is_near = |a: &RawRow, b: &RawRow| b.time_s - a.time_s <= HOLE_S.max(1.5 * dt_s);
    let parts: Vec<&[RawRow]> = rows.chunk_by(is_near).collect();
    counts.holes_split += parts.len().saturating_sub(1);
    parts
}

/// Interpolates unbroken rows onto the grid.
fn track(
    raw: &RawTrack,
    rows: &[RawRow],
    dt_s: f64,
    counts: &mut ReadCounts,
) -> Option<RoadUserTrack> {
    let (first, last) = (rows.first()?, rows.last()?);
    let from = (first.time_s / dt_s - ON_GRID).ceil().max(0.0) as usize;
    let to = (last.time_s / dt_s + ON_GRID).floor() as usize;
    if to < from + 1 {
        return None;
    }

    let [length_m, width_m] = raw.size_m();
    let mut track = RoadUserTrack {
        id: raw.id(),
        class: raw.class(),
        length_m,
        width_m,
        first_sample: from,
        ..RoadUserTrack::default()
    };
    let off = |row: &&RawRow| {
        let at = row.time_s / dt_s;
        ON_GRID < (at - at.round()).abs()
    };
    counts.off_grid += rows.iter().filter(off).count();
    let mut next = 0;
    let mut samples: Vec<RawRow> = Vec::with_capacity(to + 1 - from);
    for k in from..=to {
        let time_s = k as f64 * dt_s;
        while next + 1 < rows.len() && rows[next].time_s < time_s - ON_GRID * dt_s {
            next += 1;
        }
        samples.push(sample(rows, next, time_s, dt_s, counts));
    }
    fill(&mut track, &samples, dt_s, raw.reference);
    Some(track)
}

/// Returns the sample at `time_s`, from the row there or its neighbours.
fn sample(rows: &[RawRow], next: usize, time_s: f64, dt_s: f64, counts: &mut ReadCounts) -> RawRow {
    let after = rows[next];
    if (after.time_s - time_s).abs() <= ON_GRID * dt_s || next == 0 {
        return after;
    }
    let before = rows[next - 1];
    let share = (time_s - before.time_s) / (after.time_s - before.time_s);
    let is_hole = 1.5 * dt_s < after.time_s - before.time_s;
    counts.holes_filled += usize::from(is_hole);
    let mix = |a: f64, b: f64| a + share * (b - a);
    let mix_vector = |a: RawVector, b: RawVector| match (a, b) {
        (RawVector::Along(a), RawVector::Along(b)) => RawVector::Along(mix(a, b)),
        (RawVector::Components(ax, ay), RawVector::Components(bx, by)) => {
            RawVector::Components(mix(ax, bx), mix(ay, by))
        }
        _ => RawVector::Unknown,
    };
    let angle = |(a, b): (f64, f64)| a + share * wrapped(b - a);
    RawRow {
        time_s,
        x_m: mix(before.x_m, after.x_m),
        y_m: mix(before.y_m, after.y_m),
        heading_rad: before.heading_rad.zip(after.heading_rad).map(angle),
        velocity: mix_vector(before.velocity, after.velocity),
        acceleration: mix_vector(before.acceleration, after.acceleration),
        marked: is_hole || before.marked || after.marked,
    }
}

/// Returns an angle in (−π, π].
pub(crate) fn wrapped(angle_rad: f64) -> f64 {
    let turn = 2.0 * PI;
    let rest = angle_rad.rem_euclid(turn);
    if PI < rest { rest - turn } else { rest }
}

/// Fills the columns of a track, with derived quantities where none were recorded.
fn fill(track: &mut RoadUserTrack, samples: &[RawRow], dt_s: f64, reference: RawReference) {
    let course = courses(samples, dt_s);
    let (ahead_m, left_m) = reference.centre_m(track.length_m);
    for (row, course_rad) in samples.iter().zip(course) {
        let heading_rad = row.heading_rad.unwrap_or(course_rad);
        let (sin, cos) = libm::sincos(heading_rad);
        track.x_m.push(row.x_m + ahead_m * cos - left_m * sin);
        track.y_m.push(row.y_m + ahead_m * sin + left_m * cos);
        track.heading_rad.push(wrapped(heading_rad));
        track.filled.push(row.marked);
    }
    let along = |vector: RawVector, heading_rad: f64| match vector {
        RawVector::Unknown => None,
        RawVector::Along(value) => Some(value),
        RawVector::Components(x, y) => {
            let (sin, cos) = libm::sincos(heading_rad);
            Some(x * cos + y * sin)
        }
    };
    let headings = track.heading_rad.iter();
    let recorded = samples.iter().zip(headings.clone());
    let speeds: Option<Vec<f64>> = recorded
        .clone()
        .map(|(it, h)| along(it.velocity, *h))
        .collect();
    let accels: Option<Vec<f64>> = recorded.map(|(it, h)| along(it.acceleration, *h)).collect();
    track.speed_mps = speeds.unwrap_or_else(|| speeds_of(track, dt_s));
    track.accel_mps2 = accels.unwrap_or_else(|| derivative(&track.speed_mps, dt_s));
}

/// Returns the direction of motion at every sample, held while standing.
fn courses(samples: &[RawRow], dt_s: f64) -> Vec<f64> {
    let reach = ((0.25 / dt_s).round() as usize).max(1);
    let last = samples.len() - 1;
    let mut known: Vec<Option<f64>> = (0..samples.len())
        .map(|i| {
            let (a, b) = (i.saturating_sub(reach), (i + reach).min(last));
            let (x, y) = (
                samples[b].x_m - samples[a].x_m,
                samples[b].y_m - samples[a].y_m,
            );
            let (x, y) = match samples[i].velocity {
                RawVector::Components(vx, vy) => (vx, vy),
                _ => (x / ((b - a) as f64 * dt_s), y / ((b - a) as f64 * dt_s)),
            };
            (STANDING_MPS <= libm::hypot(x, y)).then(|| libm::atan2(y, x))
        })
        .collect();
    let first = known.iter().flatten().next().copied().unwrap_or(0.0);
    let mut held = first;
    for course in &mut known {
        held = course.unwrap_or(held);
        *course = Some(held);
    }
    known.into_iter().map(|it| it.unwrap_or(first)).collect()
}

/// Returns the speeds along the heading by differences of positions.
fn speeds_of(track: &RoadUserTrack, dt_s: f64) -> Vec<f64> {
    let (vx, vy) = (derivative(&track.x_m, dt_s), derivative(&track.y_m, dt_s));
    let along = |((x, y), heading): ((f64, f64), &f64)| {
        let (sin, cos) = libm::sincos(*heading);
        x * cos + y * sin
    };
    vx.into_iter()
        .zip(vy)
        .zip(&track.heading_rad)
        .map(along)
        .collect()
}

/// Returns central differences, one-sided at the ends.
fn derivative(values: &[f64], dt_s: f64) -> Vec<f64> {
    let last = values.len() - 1;
    (0..values.len())
        .map(|i| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
            (values[b] - values[a]) / ((b - a) as f64 * dt_s)
        })
        .collect()
}
