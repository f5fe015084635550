//! Checks of the road and the sensors of a world, whose numbers may be ranges.

use super::check;
use super::roads;
use super::slope_and_wind;
use super::starts;
use crate::road::Road;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::Clock;
use crate::scene::drive::{DriveSpec, EnvironmentQuantity, EnvironmentRange, Range, Sensors};
use crate::world_file::{AgentFile, NumberOrRange, RangePoint, ScenarioFile};

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
    let range = of_sensors.range_m.map(|range_m| {
        let place = sensors.to("range_m");
        (EnvironmentQuantity::SensorRange, place, range_m)
    });
    let radii = file.road.radii_m().map(|(piece, radius_m)| {
        let place = road.to("pieces").at(piece).to("radius_m");
        (EnvironmentQuantity::ArcRadius { piece }, place, radius_m)
    });
    let agents = file.agents.iter().enumerate();
    let visibility = agents.filter_map(|(i, agent)| {
        let AgentFile::Weather(weather) = agent else {
            return None;
        };
        let place = ValuePath::top()
            .to("agents")
            .at(i)
            .to("start")
            .to("visibility_m");
        Some((
            EnvironmentQuantity::Visibility,
            place,
            weather.start.visibility_m?,
        ))
    });
    // A second weather is a mistake, and no second axis.
    let all = numbers
        .into_iter()
        .chain(range)
        .chain(radii)
        .chain(visibility.take(1))
        .chain(slope_and_wind::ranges(file));
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
        // Others check the ranges of the weather, the grades and the wind.
        let is_checked = matches!(
            quantity,
            EnvironmentQuantity::Visibility
                | EnvironmentQuantity::Rise { .. }
                | EnvironmentQuantity::WindSpeed
                | EnvironmentQuantity::GustPeak
                | EnvironmentQuantity::GustBegin
        );
        if !is_checked {
            check::range(problems, &place, range);
        }
        let turns = matches!(quantity, EnvironmentQuantity::ArcRadius { .. });
        if turns && range.lo <= 0.0 && range.hi >= 0.0 {
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
        // A mistake at one end usually recurs at others.
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
