//! Tracks of all bodies in a picture, and the focus of its camera.

use std::ops::Range;

use nalgebra::Vector2;

use super::write::n;
use crate::ego::Phase;
use crate::experiment::{EpisodeFrames, ShownFrame};
use crate::scene::SceneGeometry;
use crate::sim::rotation_by;
use crate::testbench::FilmAfterContact;

/// Least time in seconds between two shown samples.
const APART_S: f64 = 0.05;
/// Distance in metres from the ego within which an agent moves the camera.
///
/// The agent that the ego encounters moves it at any distance.
const FAR_M: f64 = 25.0;
/// Half of the averaging window of the camera's motion, in seconds.
const STEADY_S: f64 = 0.5;
/// Half of the time in seconds over which speeds give an acceleration.
const ACCEL_S: f64 = 0.1;
/// Least turn of the road that turns the picture, in radians.
const STRAIGHT_RAD: f64 = 0.2;

/// Motion in a picture, sample by sample, in the order of the cast.
pub(super) struct FilmTracks {
    /// Times of the samples. The last time is the end.
    pub times_s: Vec<f64>,
    /// Number of samples before those after the contact.
    pub recorded: usize,
    /// Tracks of all agents.
    pub tracks: Vec<BodyTrack>,
    /// Phases of every light, per sample.
    pub phases: Vec<Vec<Phase>>,
    /// Focus of the camera, per sample.
    pub focus: Vec<Focus>,
    /// Direction of the world that points right in the picture.
    pub turn_rad: f64,
    /// Agent that the ego touches.
    ///
    /// Without a contact, the agent nearest to the ego at the verdict.
    pub opponent: Option<usize>,
}

/// Centre of one body over time.
pub(super) struct BodyTrack {
    pub x_m: Vec<f64>,
    pub y_m: Vec<f64>,
    /// Headings without jumps of a full turn.
    pub heading_rad: Vec<f64>,
    pub speed_mps: Vec<f64>,
    pub accel_mps2: Vec<f64>,
}

/// Rectangle in the picture's directions: right and up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Focus {
    pub centre_m: [f64; 2],
    pub size_m: [f64; 2],
}

impl FilmTracks {
    /// Returns the film of an episode.
    ///
    /// `after` has the collisions after the contact, in worlds that play them.
    pub(super) fn of(shown: &EpisodeFrames, after: Option<&FilmAfterContact>) -> FilmTracks {
        let stage = &shown.stage;
        // A world with long samples shows all of them.
        let every = ((APART_S / shown.sample_s).round() as usize).max(1);
        // The verdict and the end are always shown, even between regular samples.
        let special = [
            shown.judged.sample,
            shown.recorded.saturating_sub(1),
            shown.frames.len().saturating_sub(1),
        ];
        let is_kept =
            |it: &&ShownFrame| it.sample.is_multiple_of(every) || special.contains(&it.sample);
        let kept: Vec<&ShownFrame> = shown.frames.iter().filter(is_kept).collect();
        // Samples ascend, and those after the contact follow the recorded
        // ones.
        let recorded = kept.partition_point(|it| it.sample < shown.recorded);
        let times_s: Vec<f64> = kept.iter().map(|it| it.time_s).collect();
        let hit_s = |who: usize| after?.hit_s(&stage.agents[who].name);
        let track = |who| {
            let mut track = BodyTrack::of(who, &kept, &times_s, recorded);
            // A body that rolls freely does not brake.
            let accels = track.accel_mps2.iter_mut().zip(&times_s).skip(recorded);
            for (accel_mps2, time_s) in accels {
                if hit_s(who).is_some_and(|hit_s| hit_s <= *time_s) {
                    *accel_mps2 = 0.0;
                }
            }
            track
        };
        let tracks: Vec<BodyTrack> = (0..stage.agents.len()).map(track).collect();
        let lights = 0..stage.lights.len();
        let phases = lights.map(|light| kept.iter().map(|it| it.frame.phases[light]).collect());
        let mut film = FilmTracks {
            phases: phases.collect(),
            focus: Vec::new(),
            times_s,
            recorded,
            tracks,
            turn_rad: 0.0,
            opponent: None,
        };
        // Order matters: the focus depends on the turn and on the encountered
        // agent.
        film.turn_rad = film.turn(shown);
        film.opponent = film.opponent(shown);
        film.focus = if is_on_cells(stage) {
            film.whole_map(stage)
        } else {
            film.steady(film.looked_at(shown))
        };
        film
    }

    /// Index of the last sample at or before a time.
    pub(super) fn at(&self, time_s: f64) -> usize {
        // Rounding may make an equal time slightly larger.
        let after = self.times_s.partition_point(|t| *t <= time_s + 1e-9);
        after.saturating_sub(1)
    }

    /// End in seconds.
    pub(super) fn end_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or(0.0)
    }

    /// End of the recorded motion in seconds: without that after the contact.
    pub(super) fn recorded_end_s(&self) -> f64 {
        let last = self.times_s[..self.recorded].last();
        last.copied().unwrap_or(0.0)
    }

    /// Place of the world in the picture's directions.
    pub(super) fn turned(&self, x_m: f64, y_m: f64) -> [f64; 2] {
        (rotation_by(self.turn_rad).inverse() * Vector2::new(x_m, y_m)).into()
    }

    /// SVG `transform` of a body at a sample.
    pub(super) fn pose(&self, who: usize, i: usize) -> String {
        let track = &self.tracks[who];
        let turn_deg = track.heading_rad[i].to_degrees();
        let (x, y) = (n(track.x_m[i], 3), n(track.y_m[i], 3));
        format!("translate({x} {y}) rotate({})", n(turn_deg, 2))
    }

    /// Half of the extent of a body in the picture's directions.
    pub(super) fn half_room(&self, size_m: [f64; 3], who: usize, i: usize) -> [f64; 2] {
        let (sin, cos) = libm::sincos(self.tracks[who].heading_rad[i] - self.turn_rad);
        let (length_m, width_m) = (0.5 * size_m[0], 0.5 * size_m[1]);
        [
            length_m * cos.abs() + width_m * sin.abs(),
            length_m * sin.abs() + width_m * cos.abs(),
        ]
    }

    /// Direction of the picture: the heading of the ego at the verdict.
    ///
    /// A heading close to x does not turn the picture.
    fn turn(&self, shown: &EpisodeFrames) -> f64 {
        let headings = &self.tracks[shown.ego()].heading_rad;
        let heading_rad = headings.get(self.at(shown.judged.time_s)).copied();
        match heading_rad {
            // A small turn would only tilt the road, and pictures of one world
            // would differ.
            Some(heading_rad) if heading_rad.abs() >= STRAIGHT_RAD => heading_rad,
            _ => 0.0,
        }
    }

    /// Focus on all cells, at every sample.
    fn whole_map(&self, stage: &SceneGeometry) -> Vec<Focus> {
        let places = stage.lane_borders_m.iter().flatten();
        let side_m = places.map(|place| place[0]).fold(0.0, f64::max);
        let whole = Focus {
            centre_m: [0.5 * side_m; 2],
            size_m: [side_m; 2],
        };
        vec![whole; self.times_s.len()]
    }

    /// Distance of the centres of two agents at a sample, in metres.
    pub(super) fn apart_m(&self, one: usize, other: usize, i: usize) -> f64 {
        let (one, other) = (&self.tracks[one], &self.tracks[other]);
        libm::hypot(one.x_m[i] - other.x_m[i], one.y_m[i] - other.y_m[i])
    }

    fn opponent(&self, shown: &EpisodeFrames) -> Option<usize> {
        let ego = shown.ego();
        let i = self.at(shown.judged.time_s);
        let others = (0..self.tracks.len()).filter(|who| *who != ego);
        let nearest = others.min_by(|a, b| {
            let apart_m = |who: &usize| self.apart_m(ego, *who, i);
            apart_m(a).total_cmp(&apart_m(b))
        });
        // A contact has priority: the nearest centre may be that of another
        // body.
        touched_by_ego(shown).or(nearest)
    }

    /// Focus at each sample: the ego, the agent that it encounters, and near agents.
    fn looked_at(&self, shown: &EpisodeFrames) -> Vec<Focus> {
        let (stage, ego) = (&shown.stage, shown.ego());
        let near = |who: usize, i: usize| {
            who == ego || Some(who) == self.opponent || self.apart_m(ego, who, i) <= FAR_M
        };
        let at = |i: usize| {
            let everybody = 0..stage.agents.len();
            let rooms = everybody.filter(|who| near(*who, i)).map(|who| {
                let centre = self.turned(self.tracks[who].x_m[i], self.tracks[who].y_m[i]);
                let half = self.half_room(stage.agents[who].size_m, who, i);
                [0, 1].map(|axis| (centre[axis] - half[axis], centre[axis] + half[axis]))
            });
            let whole = rooms
                .reduce(|a, b| [0, 1].map(|n| (a[n].0.min(b[n].0), a[n].1.max(b[n].1))))
                .unwrap_or([(0.0, 0.0); 2]);
            Focus {
                centre_m: whole.map(|(lo, hi)| 0.5 * (lo + hi)),
                size_m: whole.map(|(lo, hi)| hi - lo),
            }
        };
        (0..self.times_s.len()).map(at).collect()
    }

    /// Means over one second, so that the camera does not jump when an agent appears.
    fn steady(&self, focus: Vec<Focus>) -> Vec<Focus> {
        let mean = |i: usize| {
            let near = |t: &f64| (t - self.times_s[i]).abs() <= STEADY_S;
            let from = self.times_s.iter().position(near).unwrap_or(i);
            let count = self.times_s[from..].iter().take_while(|t| near(t)).count();
            // The window is symmetric and shrinks at both ends, so the mean
            // lags on neither side.
            let reach = (i - from).min(from + count - 1 - i);
            let around = &focus[i - reach..=i + reach];
            let mean = |value: &dyn Fn(&Focus) -> f64| {
                around.iter().map(value).sum::<f64>() / around.len() as f64
            };
            Focus {
                centre_m: [0, 1].map(|axis| mean(&|f| f.centre_m[axis])),
                size_m: [0, 1].map(|axis| mean(&|f| f.size_m[axis])),
            }
        };
        (0..focus.len()).map(mean).collect()
    }
}

impl BodyTrack {
    fn of(who: usize, kept: &[&ShownFrame], times_s: &[f64], recorded: usize) -> BodyTrack {
        let places = kept.iter().map(|it| it.frame.placements[who]);
        let (x_m, y_m): (Vec<f64>, Vec<f64>) = places
            .clone()
            .map(|place| (place.centre_m[0], place.centre_m[1]))
            .unzip();
        let heading_rad = unwound(places.map(|place| place.heading_rad()));
        // A collision changes speeds at once, so no difference spans the contact.
        let of_places = |part: Range<usize>| -> Vec<f64> {
            let slope = |values: &[f64]| slopes(&times_s[part.clone()], &values[part.clone()]);
            let parts = slope(&x_m).into_iter().zip(slope(&y_m));
            parts.map(|(x, y)| libm::hypot(x, y)).collect()
        };
        // Without the signal, speeds follow from the places.
        let published: Option<Vec<f64>> = kept[..recorded]
            .iter()
            .map(|it| it.speeds_mps[who])
            .collect();
        let mut speed_mps = published.unwrap_or_else(|| of_places(0..recorded));
        let mut accel_mps2 = slopes(&times_s[..recorded], &speed_mps);
        let after_mps = of_places(recorded..times_s.len());
        accel_mps2.extend(slopes(&times_s[recorded..], &after_mps));
        speed_mps.extend(after_mps);
        // Accelerations are slopes of speeds, because not every film has a
        // trace.
        BodyTrack {
            accel_mps2,
            x_m,
            y_m,
            heading_rad,
            speed_mps,
        }
    }
}

/// Agent that the ego touches.
fn touched_by_ego(shown: &EpisodeFrames) -> Option<usize> {
    let (one, other) = &shown.contact.as_ref()?.between;
    let mut agents = shown.stage.agents.iter();
    let ego = &shown.stage.agents[shown.ego()].name;
    let touched = match (one == ego, other == ego) {
        (true, _) => other,
        (_, true) => one,
        _ => return None,
    };
    agents.position(|agent| agent.name == *touched)
}

/// Returns true for a world of cells.
pub(super) fn is_on_cells(stage: &SceneGeometry) -> bool {
    stage.agents.iter().any(|agent| agent.body == "cell")
}

/// Angles without jumps of a full turn.
fn unwound(angles_rad: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut unwound: Vec<f64> = Vec::new();
    for angle_rad in angles_rad {
        let before = unwound.last().copied().unwrap_or(angle_rad);
        // The remainder is the short way round, and the sum never jumps.
        unwound.push(before + libm::remainder(angle_rad - before, std::f64::consts::TAU));
    }
    unwound
}

/// Rates of change, from central differences over a short time.
fn slopes(times_s: &[f64], values: &[f64]) -> Vec<f64> {
    let slope = |i: usize| {
        // Times are sums of steps, so an equal distance may be slightly
        // larger.
        let near = |j: &usize| (times_s[*j] - times_s[i]).abs() <= ACCEL_S + 1e-9;
        let from = (0..i)
            .rev()
            .take_while(near)
            .last()
            .unwrap_or(i.saturating_sub(1));
        let to = (i + 1..values.len())
            .take_while(near)
            .last()
            .unwrap_or((i + 1).min(values.len() - 1));
        // A contact right after a sample leaves two equal times.
        if times_s[from] < times_s[to] {
            (values[to] - values[from]) / (times_s[to] - times_s[from])
        } else {
            0.0
        }
    };
    (0..values.len()).map(slope).collect()
}
