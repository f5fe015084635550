//! Quantities of the environment that starts draw: road, sensors and weather.

use super::range::Range;
use super::weather::Weather;
use crate::scene::Axis;

/// Quantity of the environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvironmentQuantity {
    /// Coefficient of friction μ of the road.
    Friction,
    /// Delay of the ego's sensors, a multiple of the sample.
    SensorDelay,
    /// Standard deviation of perceived positions.
    PositionNoise,
    /// Standard deviation of perceived speeds.
    SpeedNoise,
    /// Width of the lanes of the world's own road, and of roads that share it.
    LaneWidth,
    /// Radius of an arc of the world's own road. Its length stays.
    ArcRadius {
        /// Position of the arc among the pieces of the road, from 0.
        piece: usize,
    },
    /// Range of the ego's sensors.
    SensorRange,
    /// Rise of a grade of the world's own road.
    Rise {
        /// Position of the grade, from 0.
        grade: usize,
    },
    /// Speed of the steady wind.
    WindSpeed,
    /// Peak of the gust.
    GustPeak,
    /// Time at which the gust begins.
    GustBegin,
    /// Visibility at the start, in weather that an ado changes.
    Visibility,
}

/// Quantity of the environment with its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentRange {
    /// Quantity that starts draw.
    pub quantity: EnvironmentQuantity,
    /// Range from which it is drawn.
    pub range: Range,
    /// Value in the spec of a world, for code that has no start.
    pub nominal: f64,
    /// False if a changed ego replaces the drawn value by its own.
    pub applies: bool,
}

impl EnvironmentQuantity {
    /// Returns whether it belongs to the ego's sensors.
    pub fn is_of_sensors(self) -> bool {
        matches!(
            self,
            EnvironmentQuantity::SensorDelay
                | EnvironmentQuantity::PositionNoise
                | EnvironmentQuantity::SpeedNoise
                | EnvironmentQuantity::SensorRange
        )
    }

    /// Returns whether it belongs to the geometry of the road.
    pub fn is_of_geometry(self) -> bool {
        matches!(
            self,
            EnvironmentQuantity::LaneWidth | EnvironmentQuantity::ArcRadius { .. }
        )
    }

    /// Returns the name and the unit of its axis.
    fn axis(self, weather: Option<&Weather>) -> (String, &'static str) {
        let (name, unit) = match self {
            EnvironmentQuantity::Friction => ("road.friction", ""),
            EnvironmentQuantity::SensorDelay => ("sensors.delay", "s"),
            EnvironmentQuantity::PositionNoise => ("sensors.position_sd", "m"),
            EnvironmentQuantity::SpeedNoise => ("sensors.speed_sd", "m/s"),
            EnvironmentQuantity::LaneWidth => ("road.lane_width", "m"),
            EnvironmentQuantity::ArcRadius { piece } => {
                return (format!("road.piece{}.radius", piece + 1), "m");
            }
            EnvironmentQuantity::SensorRange => ("sensors.range", "m"),
            EnvironmentQuantity::Rise { grade } => {
                return (format!("road.grade{}", grade + 1), "");
            }
            EnvironmentQuantity::WindSpeed => ("wind.speed", "m/s"),
            EnvironmentQuantity::GustPeak => ("wind.gust_peak", "m/s"),
            EnvironmentQuantity::GustBegin => ("wind.gust_begin", "s"),
            EnvironmentQuantity::Visibility => {
                let name = weather.map_or("weather", |weather| weather.name.as_str());
                return (format!("{name}.visibility"), "m");
            }
        };
        (name.to_owned(), unit)
    }
}

impl EnvironmentRange {
    /// Returns the value at a share of the range, from 0 to 1.
    ///
    /// Delays are multiples of the sample, and each is equally likely.
    pub(super) fn at(&self, share: f64, sample_s: f64) -> f64 {
        let Range { lo, hi } = self.range;
        if self.quantity == EnvironmentQuantity::SensorDelay {
            let steps = ((hi - lo) / sample_s).round();
            // Every multiple of the sample is equally likely, both ends
            // included.
            let step = (share * (steps + 1.0)).floor().min(steps);
            // The last step is the end itself, which a sum could exceed by
            // rounding.
            if step == steps {
                hi
            } else {
                lo + step * sample_s
            }
        } else {
            lo + (hi - lo) * share
        }
    }

    /// Returns the axis of X_init.
    pub(super) fn axis(&self, weather: Option<&Weather>) -> Axis {
        let (name, unit) = self.quantity.axis(weather);
        Axis {
            name,
            unit,
            lo: self.range.lo,
            hi: self.range.hi,
        }
    }
}
