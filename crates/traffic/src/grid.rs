//! From raw rows to tracks on one time grid.

use std::ops::RangeInclusive;

use brakecheck_stl::sampling::EvenSampling;

use crate::agreement::{Agreement, FAST_MPS};
use crate::error::ReadError;
use crate::parts::{TrackPart, parts};
use crate::problem::{FilePlace, FileProblem};
use crate::raw::{RawReference, RawRow, RawTrack, RawTracks, RawVector, wrapped};
use crate::recording::{ReadCounts, RoadUserTrack, TrafficRecording};
use crate::sizes;

/// Share of a period by which an instant may be off the grid.
const ON_GRID: f64 = 0.05;

/// Greatest number of samples of the time grid, five days at 20 Hz.
const MOST_SAMPLES: f64 = 1.0e7;

/// Least and greatest sampling period in seconds.
const PERIODS_S: [f64; 2] = [5.0e-4, 5.0];

/// Greatest number of samples per row: more are mostly made up.
const SAMPLES_PER_ROW: usize = 10;

/// Speed below which the direction of motion is no heading, in m/s.
const STANDING_MPS: f64 = 0.5;

/// Puts all rows on the time grid of the file.
pub(crate) fn recording(raw: RawTracks, file: &str) -> Result<TrafficRecording, ReadError> {
    let RawTracks {
        mut tracks,
        mut counts,
        origin_m,
        reading,
        rate_hz,
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
    // Before the tracks are split, so that each road user counts once.
    counts.assumed_sizes = tracks.iter().filter(|it| !it.has_size()).count();
    let empty = || ReadError::Empty {
        file: file.to_owned(),
    };
    let whole = |problem| ReadError::Content {
        file: file.to_owned(),
        place: FilePlace::Whole,
        problem,
    };
    let grid = TimeGrid::of(&tracks).ok_or_else(empty)?;
    // Before any allocation by samples: one row of another epoch would ask for
    // gigabytes.
    check_span(&tracks, &grid).map_err(whole)?;
    let mut all = Vec::with_capacity(tracks.len());
    let mut agreement = Agreement::default();
    let rows: usize = tracks.iter().map(|it| it.rows.len()).sum();
    // The constant lets short recordings have holes.
    let mut budget = SAMPLES_PER_ROW * rows + 10_000;
    for raw in &mut tracks {
        for row in &mut raw.rows {
            // Sample 0 is the earliest row of the file, not the first one that
            // was read.
            row.time_s -= grid.first_s;
        }
        for part in parts(raw, grid.dt_s, &mut counts) {
            let Some(span) = grid.span(&part.rows) else {
                counts.too_short += 1;
                continue;
            };
            // Before they are made: a step between two rows may take a thousand samples.
            budget = budget
                .checked_sub(span.end() - span.start())
                .ok_or_else(|| whole(FileProblem::Uneven { dt_s: grid.dt_s }))?;
            let samples = grid.samples(&part.rows, span, &mut counts);
            // Noise alone does not make a whole track this fast, so it is a
            // ghost of the tracker.
            if mean_speed_mps(&samples.rows, grid.dt_s) > FAST_MPS {
                counts.too_fast += 1;
                continue;
            }
            // Only kept tracks vote on whether speeds and headings agree with
            // the positions.
            agreement.add(&samples.rows, grid.dt_s);
            all.push(track(raw, &part, samples, grid.dt_s, &mut counts));
        }
    }
    // If every track is too fast, the unit is wrong and not the tracker.
    if all.is_empty() && counts.too_fast > 0 {
        return Err(whole(FileProblem::Fast {
            speed_mps: FAST_MPS,
        }));
    }
    if all.is_empty() {
        return Err(empty());
    }
    let problem = sizes::problem(&all).or_else(|| agreement.problem(rate_hz));
    if let Some(problem) = problem {
        return Err(whole(problem));
    }
    counts.narrow = sizes::narrow(&all);
    (counts.speeds_off, counts.headings_off) = (agreement.speeds_off, agreement.headings_off);
    Ok(TrafficRecording {
        name: file.to_owned(),
        dt_s: grid.dt_s,
        origin_m,
        tracks: all,
        counts,
        reading,
    })
}

/// Returns a problem if the time grid would be implausible or have too many samples.
fn check_span(tracks: &[RawTrack], grid: &TimeGrid) -> Result<(), FileProblem> {
    let dt_s = grid.dt_s;
    let lasts = tracks.iter().filter_map(|it| it.rows.last());
    // Rows are sorted with NaN last, and a NaN is no span.
    let span = |row: &RawRow| row.time_s - grid.first_s;
    let fits = |span_s: &f64| (0.0..=MOST_SAMPLES * dt_s).contains(span_s);
    if let Some(span_s) = lasts.map(span).find(|span_s| !fits(span_s)) {
        return Err(FileProblem::Span { span_s, dt_s });
    }
    if !(PERIODS_S[0]..=PERIODS_S[1]).contains(&dt_s) {
        return Err(FileProblem::Period { dt_s });
    }
    Ok(())
}

/// Time grid of a recording.
struct TimeGrid {
    first_s: f64,
    dt_s: f64,
    /// Share of a period by which an instant may be off the grid.
    on_grid: f64,
}

/// Returns the step to which all instants are rounded, 0 for none from a microsecond on.
fn resolution_s(instants: &[f64]) -> f64 {
    // Decimal steps only, since recorders print a fixed number of digits.
    let is_step = |step_s: &f64| {
        let off = |it: &f64| (it / step_s - (it / step_s).round()).abs();
        instants.iter().all(|it| off(it) < 1e-3)
    };
    // The coarsest first, because every finer one fits the same instants.
    let steps_s = [1e-2, 1e-3, 1e-4, 1e-5];
    steps_s.into_iter().find(is_step).unwrap_or(0.0)
}

/// Rows on the grid.
struct GridSamples {
    first: usize,
    rows: Vec<RawRow>,
}

impl TimeGrid {
    /// Fits a grid to the instants of all rows, which are sorted per track.
    fn of(tracks: &[RawTrack]) -> Option<TimeGrid> {
        let firsts = tracks.iter().filter_map(|it| it.rows.first());
        let first_s = firsts.map(|row| row.time_s).fold(f64::INFINITY, f64::min);
        // The median ignores holes and doubled rows, which would shift a mean.
        let median_s = median_step(tracks)?;
        let irregular = TimeGrid {
            first_s,
            // Steps below half a microsecond are no sampling rate.
            dt_s: (median_s * 1e6).round() / 1e6,
            on_grid: ON_GRID,
        };
        let mut instants: Vec<f64> = tracks
            .iter()
            .flat_map(|it| it.rows.iter().map(|row| row.time_s))
            .collect();
        instants.sort_by(f64::total_cmp);
        // One instant of several road users may differ in its last digits.
        instants.dedup_by(|a, b| *a - *b <= 1e-4 * median_s);
        let even =
            // A fitted period far from the median step is a multiple or a
            // fraction of the true one.
            EvenSampling::fit(&instants).filter(|it| (it.dt_s / median_s - 1.0).abs() < 0.25);
        let grid = even.map_or(irregular, |it| TimeGrid {
            first_s,
            dt_s: it.dt_s,
            // The first instant may be rounded the other way than the farthest one.
            on_grid: if it.off_s <= 0.55 * resolution_s(&instants) {
                ON_GRID.max(2.1 * it.off_s / it.dt_s)
            } else {
                ON_GRID
            },
        });
        (grid.dt_s > 0.0).then_some(grid)
    }

    /// Returns the first and last sample of unbroken rows, `None` for fewer than two.
    fn span(&self, rows: &[RawRow]) -> Option<RangeInclusive<usize>> {
        let (first, last) = (rows.first()?, rows.last()?);
        // Inwards on both sides, so that no sample is extrapolated.
        let from = (first.time_s / self.dt_s - self.on_grid).ceil().max(0.0) as usize;
        let to = (last.time_s / self.dt_s + self.on_grid).floor() as usize;
        (from < to).then_some(from..=to)
    }

    /// Interpolates unbroken rows onto the grid.
    fn samples(
        &self,
        rows: &[RawRow],
        span: RangeInclusive<usize>,
        counts: &mut ReadCounts,
    ) -> GridSamples {
        let (dt_s, on_grid) = (self.dt_s, self.on_grid);
        let first = *span.start();
        let off = |row: &&RawRow| {
            let at = row.time_s / dt_s;
            on_grid < (at - at.round()).abs()
        };
        counts.off_grid += rows.iter().filter(off).count();
        let mut next = 0;
        let mut samples: Vec<RawRow> = Vec::with_capacity(span.end() + 1 - first);
        for k in span {
            let time_s = k as f64 * dt_s;
            // `next` only grows, so a track is sampled in linear time.
            while next + 1 < rows.len() && rows[next].time_s < time_s - on_grid * dt_s {
                next += 1;
            }
            samples.push(self.sample(rows, next, time_s, counts));
        }
        GridSamples {
            first,
            rows: samples,
        }
    }

    /// Returns the sample at `time_s`, from the row there or its neighbours.
    fn sample(&self, rows: &[RawRow], next: usize, time_s: f64, counts: &mut ReadCounts) -> RawRow {
        let (after, dt_s) = (rows[next], self.dt_s);
        if (after.time_s - time_s).abs() <= self.on_grid * dt_s || next == 0 {
            return after;
        }
        let before = rows[next - 1];
        let share = (time_s - before.time_s) / (after.time_s - before.time_s);
        // Halfway to two periods, so that jitter is no hole and one missing
        // row is.
        let is_hole = 1.5 * dt_s < after.time_s - before.time_s;
        counts.holes_filled += usize::from(is_hole);
        let mix = |a: f64, b: f64| a + share * (b - a);
        let mix_vector = |a: RawVector, b: RawVector| match (a, b) {
            (RawVector::Along(a), RawVector::Along(b)) => RawVector::Along(mix(a, b)),
            (RawVector::Components(ax, ay), RawVector::Components(bx, by)) => {
                RawVector::Components(mix(ax, bx), mix(ay, by))
            }
            // A file has one notation for all rows, so this is a row without a
            // value.
            _ => RawVector::Unknown,
        };
        let angles = before.heading_rad.zip(after.heading_rad);
        RawRow {
            time_s,
            x_m: mix(before.x_m, after.x_m),
            y_m: mix(before.y_m, after.y_m),
            // The short way round, since −179° and 179° are 2° apart.
            heading_rad: angles.map(|(a, b)| a + share * wrapped(b - a)),
            velocity: mix_vector(before.velocity, after.velocity),
            acceleration: mix_vector(before.acceleration, after.acceleration),
            marked: is_hole || before.marked || after.marked,
            size_m: before.size_m,
            class: before.class,
        }
    }
}

/// Returns the length of the way over its duration.
fn mean_speed_mps(samples: &[RawRow], dt_s: f64) -> f64 {
    let step = |pair: &[RawRow]| libm::hypot(pair[1].x_m - pair[0].x_m, pair[1].y_m - pair[0].y_m);
    let way_m: f64 = samples.windows(2).map(step).sum();
    way_m / ((samples.len() - 1) as f64 * dt_s)
}

/// Returns the median step of all road users.
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
    Some(*steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Returns the track of a part with its samples.
fn track(
    raw: &RawTrack,
    part: &TrackPart,
    samples: GridSamples,
    dt_s: f64,
    counts: &mut ReadCounts,
) -> RoadUserTrack {
    // Of the part and not of the identity, which another vehicle may have
    // taken over.
    let class = raw.class(&part.rows);
    let ([length_m, width_m], varies) = raw.size_m(&part.rows, class);
    counts.varying_sizes += usize::from(varies);
    let id = match part.vehicle {
        0 => raw.id(),
        // Another vehicle than the first one with this identity.
        again => format!("{}#{}", raw.id(), again + 1),
    };
    let mut track = RoadUserTrack {
        id,
        class,
        length_m,
        width_m,
        first_sample: samples.first,
        ..RoadUserTrack::default()
    };
    fill(&mut track, &samples.rows, dt_s, raw.reference);
    track
}

/// Fills the columns of a track, with derived quantities where none were recorded.
fn fill(track: &mut RoadUserTrack, samples: &[RawRow], dt_s: f64, reference: RawReference) {
    // Even with recorded headings, single rows may lack them.
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
    // One row without a value makes the whole column derived, since a mix of
    // sources has steps.
    track.speed_mps = speeds.unwrap_or_else(|| speeds_of(track, dt_s));
    track.accel_mps2 = accels.unwrap_or_else(|| derivative(&track.speed_mps, dt_s));
}

/// Returns the direction of motion at every sample, held while standing.
fn courses(samples: &[RawRow], dt_s: f64) -> Vec<f64> {
    // A chord of half a second averages the noise of positions.
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
                // Recorded velocities come from the tracker's filter and are
                // smoother than differences.
                RawVector::Components(vx, vy) => (vx, vy),
                _ => (x / ((b - a) as f64 * dt_s), y / ((b - a) as f64 * dt_s)),
            };
            // `libm` gives the same bits on all machines.
            (libm::hypot(x, y) >= STANDING_MPS).then(|| libm::atan2(y, x))
        })
        .collect();
    // A vehicle that stands at the beginning has the course with which it
    // starts.
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
    let velocities = vx.into_iter().zip(vy).zip(&track.heading_rad);
    velocities
        .map(|((x, y), heading_rad)| {
            let (sin, cos) = libm::sincos(*heading_rad);
            // The part along the heading, which is negative in reverse.
            x * cos + y * sin
        })
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
