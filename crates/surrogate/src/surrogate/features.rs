//! Inputs of the surrogate's networks: everything an ego may react to, as numbers.
//!
//! A row combines features of the percept with the answers of similar stock controllers.

use std::sync::Arc;

use super::fitted_model::{FittedModel, MODELS, StockModel};
use crate::ego::{Briefing, Own, Percept, Phase, Seen, SeenLight};

/// Ages of the remembered frames, s.
///
/// An ego with a delay or a filter reacts to these.
const PAST_S: [f64; 3] = [0.25, 0.5, 0.95];
/// Distance beyond which no ego reacts, m.
const FAR_M: f64 = 150.0;
/// Smallest distance used as a divisor, m.
const NEAR_M: f64 = 0.5;
/// Common full braking, m/s².
const BRAKE_MPS2: f64 = 6.0;

/// Smallest deceleration that counts as braking instead of coasting, m/s².
const BRAKES_MPS2: f64 = 1.0;
/// Longest counted duration, s.
const LONG_S: f64 = 4.0;
/// Time within which an approaching vehicle counts as coming, s.
const SOON_S: f64 = 2.0;

const OWN: usize = 8 + 2 * PAST_S.len();
const PER_OTHER: usize = 22 + 3 * PAST_S.len();
const PER_LIGHT: usize = 5;

/// Converts percepts to numbers, one row per sample.
#[derive(Clone, Debug, Default)]
pub(super) struct Features {
    /// Ring of past frames, the oldest overwritten.
    ///
    /// A frame holds the ego's acceleration and stopping distance. For each other vehicle
    /// it adds gap, closing speed and stopping distance.
    frames: Vec<f32>,
    /// Length of a frame.
    width: usize,
    /// Age of each of [`PAST_S`] in samples.
    delays: [usize; PAST_S.len()],
    samples: usize,
    start_mps: f64,
    /// Hardest braking of the ego so far, and duration of the current braking.
    hardest_mps2: f64,
    braking_s: f64,
    /// Largest danger of each other vehicle so far.
    worst: Vec<Danger>,
    /// Time that each other vehicle has spent in the ego's way.
    ways: Vec<PathOccupancy>,
}

/// Time that a vehicle has spent in the ego's way.
///
/// Most egos react to no other vehicle, and some only after a delay.
#[derive(Clone, Copy, Debug, Default)]
struct PathOccupancy {
    /// Time ahead in the ego's path, s. 0: it is not there.
    in_s: f64,
    /// Time ahead in the path or about to enter it, s.
    coming_s: f64,
}

impl PathOccupancy {
    fn follow(&mut self, own: &Own, seen: &Seen, sample_s: f64) {
        let count = |since_s: f64, is: bool| if is { since_s + sample_s } else { 0.0 };
        let is_in = seen.is_ahead_of(own);
        let towards_mps = -seen.lateral_mps * seen.lateral_m.signum();
        // A vehicle is coming if it reaches the ego's way soon at its present lateral
        // speed.
        let is_coming = side_m(own, seen) < SOON_S * towards_mps.max(0.0);
        self.in_s = count(self.in_s, is_in);
        self.coming_s = count(self.coming_s, is_in || is_coming);
    }

    /// Returns two indicators and the two durations.
    fn state([in_s, coming_s]: [f64; 2]) -> [f64; 4] {
        let is = |since_s: f64| f64::from(u8::from(since_s > 0.0));
        [
            is(in_s),
            is(coming_s),
            in_s.min(LONG_S),
            coming_s.min(LONG_S),
        ]
    }
}

/// Largest danger of a vehicle so far.
///
/// An ego in an emergency braking may hold it until standstill. It then reacts to this
/// value and not to the present percept.
#[derive(Clone, Copy, Debug, Default)]
struct Danger {
    /// Largest deceleration needed to avoid a collision.
    brake_mps2: f64,
    /// Largest inverse time to collision.
    closing_per_s: f64,
    /// Time since that inverse time to collision, s.
    ago_s: f64,
}

impl Danger {
    fn grow(&mut self, brake_mps2: f64, closing_per_s: f64, sample_s: f64) {
        self.ago_s += sample_s;
        self.brake_mps2 = self.brake_mps2.max(brake_mps2);
        // A new maximum restarts its age. Equal ones keep it.
        if self.closing_per_s < closing_per_s {
            (self.closing_per_s, self.ago_s) = (closing_per_s, 0.0);
        }
    }
}

impl Features {
    /// Returns the length of a row with this number of vehicles and lights.
    pub(super) fn width(others: usize, lights: usize) -> usize {
        OWN + PER_OTHER * others + PER_LIGHT * lights
    }

    /// Begins an episode with its first percept.
    pub(super) fn begin(percept: &Percept) -> Features {
        // Two numbers of the ego and three of each other vehicle, as
        // `remember` writes them.
        let width = 2 + 3 * percept.others.len();
        let delays = PAST_S.map(|past_s| (past_s / percept.sample_s).round() as usize);
        // The present frame takes a place as well.
        let depth = delays.into_iter().max().unwrap_or(0) + 1;
        Features {
            frames: vec![0.0; depth * width],
            width,
            delays,
            samples: 0,
            start_mps: percept.own.speed_mps,
            hardest_mps2: 0.0,
            braking_s: 0.0,
            worst: vec![Danger::default(); percept.others.len()],
            ways: vec![PathOccupancy::default(); percept.others.len()],
        }
    }

    /// Writes the row of the next percept.
    pub(super) fn read(&mut self, percept: &Percept, row: &mut Vec<f32>) {
        // The present sample enters the history first, so durations include it.
        self.remember(percept);
        let own = &percept.own;
        row.clear();
        row.reserve(Features::width(percept.others.len(), percept.lights.len()));
        let state = [
            own.speed_mps,
            own.accel_mps2,
            self.start_mps,
            own.lateral_m,
            own.heading_rad,
            stopping_m(own.speed_mps),
            self.hardest_mps2,
            self.braking_s.min(LONG_S),
        ];
        row.extend(state.map(|value| value as f32));
        row.extend(self.delays.map(|ago| self.past(ago)[0]));
        row.extend(self.delays.map(|ago| self.past(ago)[1]));
        for (i, seen) in percept.others.iter().enumerate() {
            self.read_other(own, seen, i, row);
        }
        for light in &percept.lights {
            row.extend(of_light(light).map(|value| value as f32));
        }
    }

    fn read_other(&self, own: &Own, seen: &Seen, i: usize, row: &mut Vec<f32>) {
        let (gap_m, closing_mps) = approach(own, seen);
        let near_m = gap_m.abs().max(NEAR_M);
        let ahead = if gap_m >= 0.0 { 1.0 } else { -1.0 };
        let [brake_mps2, closing_per_s] = danger(gap_m, closing_mps);
        let (worst, way) = (&self.worst[i], &self.ways[i]);
        let [is_in, is_coming, in_s, coming_s] = PathOccupancy::state([way.in_s, way.coming_s]);
        // An inverse distance resolves near gaps, in which an ego acts, better than far
        // ones.
        let nearness = ahead * 10.0 / (near_m + 5.0);
        let state = [
            gap_m,
            nearness,
            closing_mps,
            // Deceleration needed to avoid a collision, and inverse time to collision.
            brake_mps2,
            closing_per_s,
            (near_m / own.speed_mps.max(1.0)).min(10.0),
            seen.speed_mps,
            seen.ax_mps2,
            seen.lateral_m.clamp(-20.0, 20.0),
            side_m(own, seen).clamp(-2.0, 5.0),
            seen.lateral_mps,
            stopping_m(seen.speed_mps),
            worst.brake_mps2,
            worst.closing_per_s,
            worst.ago_s.min(LONG_S),
            is_in,
            is_coming,
            in_s,
            coming_s,
            // These repeat values for vehicles in the way, because most egos ignore all other vehicles.
            is_in * nearness,
            is_in * brake_mps2,
            is_in * closing_per_s,
        ];
        row.extend(state.map(|value| value as f32));
        for ago in self.delays {
            // Invariant: a frame holds three numbers per vehicle.
            let mut then = [0.0; 3];
            then.copy_from_slice(&self.past(ago)[2 + 3 * i..][..3]);
            // The gap is given as a change, so its size does not depend on the distance.
            row.extend([then[0] - gap_m as f32, then[1], then[2]]);
        }
    }

    /// Returns the frame recorded `ago` samples before.
    ///
    /// Before the first sample nothing is assumed to have moved.
    fn past(&self, ago: usize) -> &[f32] {
        let depth = self.frames.len() / self.width;
        // Invariant: a frame is remembered before the first call.
        let newest = self.samples.saturating_sub(1);
        // Saturation repeats the first frame for times before the first sample.
        let slot = newest.saturating_sub(ago) % depth;
        &self.frames[slot * self.width..][..self.width]
    }

    fn remember(&mut self, percept: &Percept) {
        let depth = self.frames.len() / self.width;
        let slot = self.samples % depth;
        self.samples += 1;
        self.hardest_mps2 = self.hardest_mps2.max(-percept.own.accel_mps2);
        self.braking_s = if percept.own.accel_mps2 < -BRAKES_MPS2 {
            self.braking_s + percept.sample_s
        } else {
            0.0
        };
        let own = &percept.own;
        for (way, seen) in self.ways.iter_mut().zip(&percept.others) {
            way.follow(own, seen, percept.sample_s);
        }
        let dangers = self.worst.iter_mut().zip(&self.ways);
        for ((worst, way), seen) in dangers.zip(&percept.others) {
            // A vehicle outside the way endangers the ego only while it approaches the path.
            let (gap_m, closing_mps) = approach(own, seen);
            let [brake_mps2, closing_per_s] = if way.coming_s > 0.0 {
                danger(gap_m, closing_mps)
            } else {
                [0.0; 2]
            };
            worst.grow(brake_mps2, closing_per_s, percept.sample_s);
        }
        let frame = &mut self.frames[slot * self.width..][..self.width];
        frame[0] = percept.own.accel_mps2 as f32;
        frame[1] = stopping_m(percept.own.speed_mps) as f32;
        for (pair, seen) in frame[2..].chunks_exact_mut(3).zip(&percept.others) {
            let (gap_m, closing_mps) = approach(&percept.own, seen);
            pair.copy_from_slice(&[
                gap_m as f32,
                closing_mps as f32,
                stopping_m(seen.speed_mps) as f32,
            ]);
        }
    }
}

/// Returns the stopping distance at a common full braking.
///
/// Models of safe driving compare the gap with a sum of such distances, each with its own
/// deceleration. The network then has to learn the weights only.
fn stopping_m(speed_mps: f64) -> f64 {
    speed_mps * speed_mps / (2.0 * BRAKE_MPS2)
}

/// Returns the deceleration needed to avoid a collision and the inverse time to collision.
fn danger(gap_m: f64, closing_mps: f64) -> [f64; 2] {
    let near_m = gap_m.abs().max(NEAR_M);
    let brake_mps2 = closing_mps.max(0.0).powi(2) / (2.0 * near_m);
    let closing_per_s = closing_mps / near_m;
    // Bounded, so a near miss does not dominate the scale of the inputs.
    [brake_mps2.min(15.0), closing_per_s.clamp(-5.0, 5.0)]
}

/// Returns the gap between bumpers, negative behind, and the rate at which it shrinks.
fn approach(own: &Own, seen: &Seen) -> (f64, f64) {
    let gap_m = if seen.headway_m >= 0.0 {
        seen.headway_m - seen.length_m
    } else {
        seen.headway_m + own.length_m
    };
    // Egos ignore what is farther, and its distance would dominate the scale.
    (gap_m.clamp(-FAR_M, FAR_M), own.speed_mps - seen.speed_mps)
}

/// Returns the gap between the sides, negative where they overlap.
fn side_m(own: &Own, seen: &Seen) -> f64 {
    seen.lateral_m.abs() - 0.5 * (seen.width_m + own.width_m)
}

fn of_light(light: &SeenLight) -> [f64; PER_LIGHT] {
    let shows = |phase: Phase| f64::from(u8::from(light.phase == phase));
    [
        light.line_m.clamp(-20.0, FAR_M),
        shows(Phase::Green),
        shows(Phase::Yellow),
        shows(Phase::Red),
        light.phase_s.min(10.0),
    ]
}

/// Converter from percepts to the rows of a surrogate.
#[derive(Clone, Default)]
pub(super) struct ModelInputs {
    features: Features,
    models: Vec<StockModel>,
    of: Arc<[FittedModel]>,
}

impl ModelInputs {
    /// Begins an episode with its first percept.
    pub(super) fn begin(
        &mut self,
        nearest: &Arc<[FittedModel]>,
        briefing: &Briefing,
        percept: &Percept,
    ) {
        self.features = Features::begin(percept);
        // Building controllers is slow, so the same surrogate reuses those of the last episode.
        if Arc::ptr_eq(&self.of, nearest) {
            self.models.iter_mut().for_each(StockModel::reset)
        } else {
            let models = nearest.iter().map(|fitted| fitted.model(briefing));
            self.models = models.collect();
            self.of = Arc::clone(nearest);
        }
    }

    /// Writes the row of the next percept.
    pub(super) fn read(&mut self, percept: &Percept, row: &mut Vec<f32>) {
        self.features.read(percept, row);
        let changes = self
            .models
            .iter_mut()
            .map(|model| model.change_mps2(percept));
        let row_of = changes.map(|change_mps2| change_mps2 as f32);
        // Missing controllers are padded with zeros, so every row has the same length.
        let rest = MODELS - self.of.len();
        row.extend(row_of.chain(std::iter::repeat_n(0.0, rest)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn percept(speed_mps: f64, headway_m: f64) -> Percept {
        Percept {
            sample_s: 0.05,
            own: Own {
                speed_mps,
                accel_mps2: speed_mps / 10.0,
                length_m: 4.0,
                width_m: 2.0,
                ..Own::default()
            },
            others: vec![Seen {
                headway_m,
                speed_mps: 10.0,
                length_m: 5.0,
                width_m: 2.0,
                ..Seen::default()
            }],
            ..Percept::default()
        }
    }

    #[test]
    fn a_row_holds_what_was_seen_and_what_it_takes_not_to_hit() {
        let seen = percept(14.0, 13.0);
        let mut row = Vec::new();
        Features::begin(&seen).read(&seen, &mut row);
        assert_eq!(row.len(), Features::width(1, 0));
        let other = &row[OWN..];
        // 13 m minus the length of 5 m, then 4² / (2 · 8) and 4 / 8.
        assert_eq!(
            [other[0], other[2], other[3], other[4]],
            [8.0, 4.0, 1.0, 0.5]
        );
        assert_eq!(other[9], -2.0, "their bodies overlap by their whole width");
    }

    #[test]
    fn frames_of_the_past_are_those_of_the_samples_before() {
        let mut row = Vec::new();
        let mut features = Features::begin(&percept(0.0, 50.0));
        for sample in 0..=40 {
            let speed_mps = f64::from(sample);
            features.read(&percept(speed_mps, 50.0 - speed_mps), &mut row);
        }
        // 5, 10 and 19 samples ago the speed was 35, 30 and 21 m/s.
        assert_eq!(row[8..11], [3.5, 3.0, 2.1]);
        let stopping = [35.0_f32, 30.0, 21.0].map(|mps| mps * mps / 12.0);
        assert_eq!(row[11..14], stopping);
        let past = &row[OWN + 22..];
        let other = 100.0 / 12.0;
        assert_eq!(
            past,
            [5.0, 25.0, other, 10.0, 20.0, other, 19.0, 11.0, other]
        );
    }

    #[test]
    fn before_the_first_sample_nothing_moved() {
        let (first, second) = (percept(10.0, 30.0), percept(11.0, 29.0));
        let mut row = Vec::new();
        let mut features = Features::begin(&first);
        features.read(&first, &mut row);
        features.read(&second, &mut row);
        assert_eq!(row[8..11], [1.0, 1.0, 1.0]);
    }

    #[test]
    fn who_is_in_the_way_or_about_to_come_there_is_told_and_for_how_long() {
        let mut row = Vec::new();
        let seen = |lateral_m: f64, lateral_mps: f64| {
            let mut percept = percept(14.0, 13.0);
            (percept.others[0].lateral_m, percept.others[0].lateral_mps) = (lateral_m, lateral_mps);
            percept
        };
        let mut features = Features::begin(&seen(3.5, 0.0));
        let mut occupancy = |percept: &Percept| {
            features.read(percept, &mut row);
            let other = &row[OWN..];
            (
                [other[12], other[13]],
                [15, 16, 17, 18, 19, 20, 21].map(|i| other[i]),
            )
        };
        let nobody = ([0.0; 2], [0.0; 7]);
        assert_eq!(
            occupancy(&seen(3.5, 0.0)),
            nobody,
            "beside, it endangers nobody"
        );
        assert_eq!(occupancy(&seen(3.5, 1.0)), nobody, "nor going away");
        assert_eq!(
            occupancy(&seen(3.5, -1.0)),
            ([1.0, 0.5], [0.0, 1.0, 0.0, 0.05, 0.0, 0.0, 0.0])
        );
        let nearness = 10.0 / 13.0;
        let in_the_way = [1.0, 1.0, 0.05, 0.1, nearness, 1.0, 0.5];
        assert_eq!(occupancy(&seen(1.9, -1.0)), ([1.0, 0.5], in_the_way));
        let gone = occupancy(&seen(3.5, 0.0));
        assert_eq!(
            gone,
            ([1.0, 0.5], [0.0; 7]),
            "a danger that is over is remembered"
        );
    }

    #[test]
    fn a_danger_that_is_over_is_remembered_and_so_is_how_long_it_brakes() {
        let mut calm = percept(10.0, 55.0);
        let mut row = Vec::new();
        let mut features = Features::begin(&calm);
        // Closing at 4 m/s with a gap of 8 m, then no vehicle nearby.
        features.read(&percept(14.0, 13.0), &mut row);
        calm.own.accel_mps2 = -2.0;
        for _ in 0..3 {
            features.read(&calm, &mut row);
        }
        let close = |value: f32, wanted: f32| assert!((value - wanted).abs() < 1e-6, "{row:?}");
        close(row[6], 2.0);
        close(row[7], 0.15);
        let other = &row[OWN..];
        assert_eq!([other[3], other[4]], [0.0, 0.0], "now it is safe");
        assert_eq!(
            [other[12], other[13]],
            [1.0, 0.5],
            "it took 4² / (2 · 8), 4 / 8"
        );
        close(other[14], 0.15);
    }
}
