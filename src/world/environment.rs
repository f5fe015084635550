//! Road and sensors of a world file, whose numbers may be ranges.

use serde::Deserialize;

use super::check;
use super::file::{NumberOrRange, ScenarioFile};
use super::locate::ValuePath;
use super::problems::Problems;
use super::roads;
use super::starts;
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
        lane_width_m: NumberOrRange,
        friction: NumberOrRange,
        #[serde(default)]
        speed_limit_mps: Option<f64>,
    },
    Curved {
        lanes: usize,
        lane_width_m: NumberOrRange,
        friction: NumberOrRange,
        #[serde(default)]
        speed_limit_mps: Option<f64>,
        pieces: Vec<OwnPiece>,
    },
    Polyline {
        lanes: usize,
        lane_width_m: NumberOrRange,
        friction: NumberOrRange,
        #[serde(default)]
        speed_limit_mps: Option<f64>,
        points_m: Vec<(f64, f64)>,
        corner_radius_m: f64,
    },
}

/// A piece of the world's own road.
#[derive(Deserialize)]
#[serde(rename = "Piece", deny_unknown_fields)]
pub(super) enum OwnPiece {
    Line {
        length_m: f64,
    },
    Arc {
        length_m: f64,
        radius_m: NumberOrRange,
    },
}

impl OwnPiece {
    fn at(&self, point: RangePoint) -> Piece {
        match *self {
            OwnPiece::Line { length_m } => Piece::Line { length_m },
            OwnPiece::Arc { length_m, radius_m } => Piece::Arc {
                length_m,
                radius_m: point.of(radius_m),
            },
        }
    }
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

    /// Returns the width of a lane, a number or a range.
    fn lane_width_m(&self) -> NumberOrRange {
        match self {
            OwnRoad::Straight { lane_width_m, .. }
            | OwnRoad::Curved { lane_width_m, .. }
            | OwnRoad::Polyline { lane_width_m, .. } => *lane_width_m,
        }
    }

    /// Returns the radii of its arcs with their positions among the pieces.
    fn radii_m(&self) -> impl Iterator<Item = (usize, NumberOrRange)> {
        let pieces = match self {
            OwnRoad::Curved { pieces, .. } => pieces.as_slice(),
            OwnRoad::Straight { .. } | OwnRoad::Polyline { .. } => &[],
        };
        let pieces = pieces.iter().enumerate();
        pieces.filter_map(|(i, piece)| match piece {
            OwnPiece::Line { .. } => None,
            OwnPiece::Arc { radius_m, .. } => Some((i, *radius_m)),
        })
    }

    /// Returns the road with the middle of each range.
    pub(super) fn nominal(&self) -> Road {
        self.at(RangePoint::Middle)
    }

    fn at(&self, point: RangePoint) -> Road {
        let friction = point.of(self.friction());
        let lane_width_m = point.of(self.lane_width_m());
        match self {
            OwnRoad::Straight {
                lanes,
                speed_limit_mps,
                ..
            } => Road::Straight {
                lanes: *lanes,
                lane_width_m,
                friction,
                speed_limit_mps: *speed_limit_mps,
            },
            OwnRoad::Curved {
                lanes,
                speed_limit_mps,
                pieces,
                ..
            } => Road::Curved {
                lanes: *lanes,
                lane_width_m,
                friction,
                speed_limit_mps: *speed_limit_mps,
                pieces: pieces.iter().map(|piece| piece.at(point)).collect(),
            },
            OwnRoad::Polyline {
                lanes,
                speed_limit_mps,
                points_m,
                corner_radius_m,
                ..
            } => Road::Polyline {
                lanes: *lanes,
                lane_width_m,
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
    let numbers = [
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
        (
            EnvironmentQuantity::LaneWidth,
            road.to("lane_width_m"),
            file.road.lane_width_m(),
        ),
    ];
    let radii = file.road.radii_m().map(|(piece, radius_m)| {
        let place = road.to("pieces").at(piece).to("radius_m");
        (EnvironmentQuantity::ArcRadius { piece }, place, radius_m)
    });
    let all = numbers.into_iter().chain(radii);
    let ranges = all.filter(|(_, _, it)| !it.0.is_fixed());
    ranges
        .map(|(quantity, place, NumberOrRange(range))| (quantity, place, range))
        .collect()
}

/// Checks the road and the sensors of a file, at both ends of their ranges.
///
/// Returns the road and the sensors in the middle of them.
pub(super) fn read(problems: &mut Problems, file: &ScenarioFile) -> (Road, Sensors) {
    for (quantity, place, range) in ranges(file) {
        check::range(problems, &place, range);
        let turns = matches!(quantity, EnvironmentQuantity::ArcRadius { .. });
        if turns && range.lo <= 0.0 && 0.0 <= range.hi {
            let what = format!("radii from {} to {} m turn both ways", range.lo, range.hi);
            let help = "a positive radius turns left and a negative radius right: \
                        keep both ends on one side of 0";
            problems.add(&place, what, "contains 0", Some(help.to_owned()));
        }
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

/// Checks the road's geometry at the ends of its ranges.
///
/// Lanes of different widths may overlap differently, and arcs of different
/// radii lead elsewhere.
pub(super) fn check_geometry(problems: &mut Problems, spec: &DriveSpec, entries: &[usize]) {
    let top = ValuePath::top();
    for spec in spec.extreme_roads() {
        if !problems.is_empty() {
            return;
        }
        roads::lay(problems, &top, &spec);
        starts::check(problems, &top.to("agents"), &spec, entries);
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
