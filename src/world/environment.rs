//! Road and sensors of a world file, whose numbers may be ranges.

use serde::Deserialize;

use super::check;
use super::file::{NumberOrRange, ScenarioFile};
use super::locate::ValuePath;
use super::problems::Problems;
use crate::scene::Clock;
use crate::scene::drive::{
    DriveSpec, EnvironmentQuantity, EnvironmentRange, Piece, Range, Road, Sensors,
};

/// The world's own road.
#[derive(Deserialize)]
#[serde(rename = "Road", deny_unknown_fields)]
pub(super) enum OwnRoad {
    Straight {
        lanes: usize,
        lane_width_m: f64,
        friction: NumberOrRange,
        #[serde(default)]
        speed_limit_mps: Option<f64>,
    },
    Curved {
        lanes: usize,
        lane_width_m: f64,
        friction: NumberOrRange,
        #[serde(default)]
        speed_limit_mps: Option<f64>,
        pieces: Vec<Piece>,
    },
    Polyline {
        lanes: usize,
        lane_width_m: f64,
        friction: NumberOrRange,
        #[serde(default)]
        speed_limit_mps: Option<f64>,
        points_m: Vec<(f64, f64)>,
        corner_radius_m: f64,
    },
}

/// Sensors of the ego.
#[derive(Deserialize)]
#[serde(rename = "Sensors", deny_unknown_fields, default)]
pub(super) struct SensorsFile {
    delay_s: NumberOrRange,
    position_sd_m: NumberOrRange,
    speed_sd_mps: NumberOrRange,
    line_of_sight: bool,
}

impl Default for SensorsFile {
    fn default() -> SensorsFile {
        let none = NumberOrRange::from(0.0);
        SensorsFile {
            delay_s: none,
            position_sd_m: none,
            speed_sd_mps: none,
            line_of_sight: false,
        }
    }
}

/// Point of a range at which a road or sensors are evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
enum RangePoint {
    Least,
    Middle,
    Greatest,
}

impl RangePoint {
    const ALL: [RangePoint; 3] = [RangePoint::Middle, RangePoint::Least, RangePoint::Greatest];

    fn of(self, NumberOrRange(Range { lo, hi }): NumberOrRange) -> f64 {
        match self {
            RangePoint::Least => lo,
            // Exact for a fixed number.
            RangePoint::Middle if lo == hi => lo,
            RangePoint::Middle => 0.5 * (lo + hi),
            RangePoint::Greatest => hi,
        }
    }
}

impl OwnRoad {
    /// Returns the friction, a number or a range.
    fn friction(&self) -> NumberOrRange {
        match self {
            OwnRoad::Straight { friction, .. }
            | OwnRoad::Curved { friction, .. }
            | OwnRoad::Polyline { friction, .. } => *friction,
        }
    }

    /// Returns the road with the middle of each range.
    pub(super) fn nominal(&self) -> Road {
        self.at(RangePoint::Middle)
    }

    fn at(&self, point: RangePoint) -> Road {
        let friction = point.of(self.friction());
        match self {
            OwnRoad::Straight {
                lanes,
                lane_width_m,
                speed_limit_mps,
                ..
            } => Road::Straight {
                lanes: *lanes,
                lane_width_m: *lane_width_m,
                friction,
                speed_limit_mps: *speed_limit_mps,
            },
            OwnRoad::Curved {
                lanes,
                lane_width_m,
                speed_limit_mps,
                pieces,
                ..
            } => Road::Curved {
                lanes: *lanes,
                lane_width_m: *lane_width_m,
                friction,
                speed_limit_mps: *speed_limit_mps,
                pieces: pieces.clone(),
            },
            OwnRoad::Polyline {
                lanes,
                lane_width_m,
                speed_limit_mps,
                points_m,
                corner_radius_m,
                ..
            } => Road::Polyline {
                lanes: *lanes,
                lane_width_m: *lane_width_m,
                friction,
                speed_limit_mps: *speed_limit_mps,
                points_m: points_m.clone(),
                corner_radius_m: *corner_radius_m,
            },
        }
    }
}

impl SensorsFile {
    fn at(&self, point: RangePoint) -> Sensors {
        Sensors {
            delay_s: point.of(self.delay_s),
            position_sd_m: point.of(self.position_sd_m),
            speed_sd_mps: point.of(self.speed_sd_mps),
            line_of_sight: self.line_of_sight,
        }
    }
}

/// Returns the ranges of a file with their places, the road's first.
fn ranges(file: &ScenarioFile) -> Vec<(EnvironmentQuantity, ValuePath, Range)> {
    let (road, sensors) = (ValuePath::top().to("road"), ValuePath::top().to("sensors"));
    let of_sensors = &file.sensors;
    let all = [
        (
            EnvironmentQuantity::Friction,
            road.to("friction"),
            file.road.friction(),
        ),
        (
            EnvironmentQuantity::SensorDelay,
            sensors.to("delay_s"),
            of_sensors.delay_s,
        ),
        (
            EnvironmentQuantity::PositionNoise,
            sensors.to("position_sd_m"),
            of_sensors.position_sd_m,
        ),
        (
            EnvironmentQuantity::SpeedNoise,
            sensors.to("speed_sd_mps"),
            of_sensors.speed_sd_mps,
        ),
    ];
    let ranges = all.into_iter().filter(|(_, _, it)| !it.0.is_fixed());
    ranges
        .map(|(quantity, place, NumberOrRange(range))| (quantity, place, range))
        .collect()
}

/// Checks the road and the sensors of a file, at both ends of their ranges.
///
/// Returns the road and the sensors in the middle of them.
pub(super) fn read(problems: &mut Problems, file: &ScenarioFile) -> (Road, Sensors) {
    for (_, place, range) in ranges(file) {
        check::range(problems, &place, range);
    }
    let (road, sensors) = (ValuePath::top().to("road"), ValuePath::top().to("sensors"));
    // Without ranges all points are the same.
    let points = if ranges(file).is_empty() {
        &RangePoint::ALL[..1]
    } else {
        &RangePoint::ALL
    };
    for &point in points {
        let before = problems.len();
        check::road(problems, &road, &file.road.at(point));
        // The middle of a delay is rounded to a multiple of the sample below.
        if point != RangePoint::Middle || file.sensors.delay_s.0.is_fixed() {
            check::sensors(problems, &sensors, &file.sensors.at(point), &file.clock);
        }
        // The same mistake is at every point of a range.
        if before < problems.len() {
            break;
        }
    }
    let sensors = file.sensors.at(RangePoint::Middle);
    (file.road.nominal(), with_whole_delay(sensors, &file.clock))
}

/// Rounds a delay to a multiple of the sample, if it is none.
fn with_whole_delay(sensors: Sensors, clock: &Clock) -> Sensors {
    if check::sensor_flaw(&sensors, clock).is_none() {
        return sensors;
    }
    let samples = (sensors.delay_s / clock.sample_s).round();
    Sensors {
        delay_s: samples * clock.sample_s,
        ..sensors
    }
}

/// Returns the ranges of the environment that starts draw.
pub(super) fn drawn(file: &ScenarioFile, spec: &DriveSpec) -> Vec<EnvironmentRange> {
    let ranges = ranges(file).into_iter();
    ranges
        .map(|(quantity, _, range)| EnvironmentRange {
            quantity,
            range,
            nominal: quantity.read(spec),
            applies: true,
        })
        .collect()
}
