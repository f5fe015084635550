//! Recordings: tracks of road users on one time grid.

use serde::{Deserialize, Serialize};

use crate::median::median;

/// Kind of a road user.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub enum Class {
    /// Person on foot.
    Pedestrian,
    /// Bicycle.
    Bicycle,
    /// Motorcycle.
    Motorcycle,
    /// Passenger car.
    #[default]
    Car,
    /// Van.
    Van,
    /// Truck or bus.
    Truck,
    /// Trailer that the recording lists apart from the vehicle that pulls it.
    Trailer,
    /// Anything else.
    Other,
}

impl Class {
    /// Every class, in the order of the enum.
    pub const ALL: [Class; 8] = [
        Class::Pedestrian,
        Class::Bicycle,
        Class::Motorcycle,
        Class::Car,
        Class::Van,
        Class::Truck,
        Class::Trailer,
        Class::Other,
    ];

    /// Returns true for vehicles with an engine.
    pub fn is_motor_vehicle(self) -> bool {
        matches!(
            self,
            Class::Motorcycle | Class::Car | Class::Van | Class::Truck
        )
    }

    /// Returns true for everything that fills a lane: motor vehicles and trailers.
    ///
    /// A trailer is the vehicle ahead of others. It has no vehicle ahead, because it has no
    /// driver.
    pub fn is_in_lanes(self) -> bool {
        self.is_motor_vehicle() || self == Class::Trailer
    }

    /// Returns the length and width in metres that are assumed without a recorded size.
    pub fn usual_size_m(self) -> [f64; 2] {
        match self {
            Class::Pedestrian => [0.5, 0.6],
            Class::Bicycle => [1.8, 0.7],
            Class::Motorcycle => [2.2, 0.8],
            // An unknown road user is taken for the most frequent one.
            Class::Car | Class::Other => [4.5, 1.8],
            Class::Van => [5.5, 2.0],
            Class::Truck => [10.0, 2.5],
            Class::Trailer => [8.0, 2.5],
        }
    }

    /// Returns the name in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Class::Pedestrian => "pedestrian",
            Class::Bicycle => "bicycle",
            Class::Motorcycle => "motorcycle",
            Class::Car => "car",
            Class::Van => "van",
            Class::Truck => "truck",
            Class::Trailer => "trailer",
            Class::Other => "other",
        }
    }
}

/// Unbroken motion of a road user, a value per sample.
///
/// All columns have the same length. Sample `i` of the track is sample
/// `first_sample + i` of the recording.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct RoadUserTrack {
    /// Identity in the file. Two tracks share it if a hole separates them.
    pub id: String,
    /// Kind of the road user.
    pub class: Class,
    /// Length of the box in metres.
    pub length_m: f64,
    /// Width of the box in metres.
    pub width_m: f64,
    /// Sample of the recording at which the track begins.
    pub first_sample: usize,
    /// Box centre along the first axis, relative to the recording's origin.
    pub x_m: Vec<f64>,
    /// Box centre along the second axis, to the left of the first.
    pub y_m: Vec<f64>,
    /// Heading, counter-clockwise from the first axis.
    pub heading_rad: Vec<f64>,
    /// Recorded velocity along the heading. It need not agree with the positions.
    pub speed_mps: Vec<f64>,
    /// Acceleration along the heading.
    pub accel_mps2: Vec<f64>,
    /// True where the recorder or the reading made the sample up.
    pub filled: Vec<bool>,
}

impl RoadUserTrack {
    /// Returns the number of samples.
    pub fn len(&self) -> usize {
        self.x_m.len()
    }

    /// Returns true if there is no sample.
    pub fn is_empty(&self) -> bool {
        self.x_m.is_empty()
    }

    /// Returns the first sample of the recording after the track.
    pub fn end_sample(&self) -> usize {
        self.first_sample + self.len()
    }

    /// Returns the distance along the path in metres.
    pub fn distance_m(&self) -> f64 {
        let steps = self.x_m.windows(2).zip(self.y_m.windows(2));
        steps
            .map(|(x, y)| libm::hypot(x[1] - x[0], y[1] - y[0]))
            .sum()
    }
}

/// Corrections made while reading. Nothing is changed without being counted here.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ReadCounts {
    /// Rows in the file.
    pub rows: usize,
    /// Rows that the recorder marks as interpolated.
    pub marked: usize,
    /// Rows at an instant off the time grid, whose neighbours are interpolated.
    pub off_grid: usize,
    /// Samples interpolated over holes of at most [`HOLE_S`].
    pub holes_filled: usize,
    /// Longer holes, each of which ends a track.
    pub holes_split: usize,
    /// Tracks of fewer than two samples, left out.
    pub too_short: usize,
    /// Rows whose class is not known, or assumed.
    pub unknown_class: usize,
    /// Road users without a size in the file, which have that of their class.
    pub assumed_sizes: usize,
    /// Entities of a scenario without a trajectory, left out.
    pub without_motion: usize,
    /// Messages of further channels of a trace, left out.
    pub other_messages: usize,
    /// Rows without an identity, left out.
    #[serde(default)]
    pub without_id: usize,
    /// Rows that jump away for at most half a second, left out.
    #[serde(default)]
    pub displaced: usize,
    /// Tracks faster than any road user, left out.
    #[serde(default)]
    pub too_fast: usize,
    /// Steps that nothing on wheels takes, each of which ends a track.
    #[serde(default)]
    pub jumps: usize,
    /// Steps that jump to the side, as no vehicle does.
    #[serde(default)]
    pub sideways: usize,
    /// Identities that go to another vehicle, which gets a number: `7#2`.
    #[serde(default)]
    pub reused_ids: usize,
    /// Tracks whose length varies by more than a fifth. The mean is taken.
    #[serde(default)]
    pub varying_sizes: usize,
    /// Tracks whose recorded speed differs from that of the positions by a quarter.
    #[serde(default)]
    pub speeds_off: usize,
    /// Tracks that mostly head elsewhere than they move.
    #[serde(default)]
    pub headings_off: usize,
    /// Cars that are narrower than 1 m, counted if most are.
    #[serde(default)]
    pub narrow: usize,
}

/// Longest hole that is interpolated, in seconds.
pub const HOLE_S: f64 = 0.5;

/// Recorded traffic.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TrafficRecording {
    /// Name of the file.
    pub name: String,
    /// Sampling period in seconds, the median of the file's steps.
    pub dt_s: f64,
    /// Origin of all positions, in metres of the file's frame.
    pub origin_m: [f64; 2],
    /// Tracks in the order of their first row.
    pub tracks: Vec<RoadUserTrack>,
    /// Corrections made while reading.
    pub counts: ReadCounts,
    /// Columns, units and frame of the file in words.
    pub reading: String,
}

impl TrafficRecording {
    /// Returns the number of samples of the time grid.
    pub fn samples(&self) -> usize {
        let ends = self.tracks.iter().map(RoadUserTrack::end_sample);
        ends.max().unwrap_or(0)
    }

    /// Returns the duration in seconds.
    pub fn duration_s(&self) -> f64 {
        self.samples().saturating_sub(1) as f64 * self.dt_s
    }

    /// Returns the distance of all tracks in kilometres.
    pub fn distance_km(&self) -> f64 {
        self.tracks
            .iter()
            .map(RoadUserTrack::distance_m)
            .sum::<f64>()
            / 1000.0
    }

    /// Returns the median of the mean speeds of motor vehicles, `None` without any.
    pub fn median_speed_mps(&self) -> Option<f64> {
        let vehicles = self.tracks.iter().filter(|it| it.class.is_motor_vehicle());
        let mean = |it: &RoadUserTrack| it.speed_mps.iter().sum::<f64>() / it.len() as f64;
        median(vehicles.map(mean).collect::<Vec<f64>>())
    }

    /// Returns the number of road users, each counted once.
    pub fn road_users(&self) -> usize {
        let ids: std::collections::BTreeSet<&str> =
            self.tracks.iter().map(|track| &*track.id).collect();
        ids.len()
    }
}
