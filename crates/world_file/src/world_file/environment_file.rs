//! Road, sensors and wind of a world file, whose numbers may be ranges.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::default_field::is_default;
use super::number_or_range::NumberOrRange;
use crate::road::{Grade, Piece, Road};
use crate::scene::drive::{Range, Sensors};
use crate::sim::{Gust, Wind};

/// The world's own road.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Road", deny_unknown_fields)]
// Every variant repeats the shared fields, because serde cannot flatten a struct into a
// type that denies unknown fields.
pub enum OwnRoad {
    /// Straight road along world x, without end.
    Straight {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane, m.
        lane_width_m: NumberOrRange,
        /// Coefficient of friction μ between tyre and road.
        friction: NumberOrRange,
        /// Speed limit, which egos receive, m/s. Default: none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
    },
    /// Road of lines and arcs.
    Curved {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane, m.
        lane_width_m: NumberOrRange,
        /// Coefficient of friction μ between tyre and road.
        friction: NumberOrRange,
        /// Speed limit, which egos receive, m/s. Default: none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
        /// Lines and arcs of its course. It is straight before and after them.
        pieces: Vec<OwnPiece>,
    },
    /// Road along points, with rounded corners.
    Polyline {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane, m.
        lane_width_m: NumberOrRange,
        /// Coefficient of friction μ between tyre and road.
        friction: NumberOrRange,
        /// Speed limit, which egos receive, m/s. Default: none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
        /// Points of its course as `(x, y)`, m.
        points_m: Vec<(f64, f64)>,
        /// Radius of its corners, m.
        corner_radius_m: f64,
    },
    /// Way along lanes of an OpenDRIVE file, whose pieces replace it in the text.
    OpenDrive {
        /// OpenDRIVE file.
        file: String,
        /// Way along its lanes.
        along: LanesFile,
        /// Coefficient of friction μ between tyre and road.
        friction: NumberOrRange,
        /// Speed limit, which egos receive, m/s. Default: none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed_limit_mps: Option<f64>,
    },
}

/// Start on a lane of an OpenDRIVE file, and the way from there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Lanes", deny_unknown_fields)]
pub struct LanesFile {
    /// Road of the file on which the way begins.
    pub road: String,
    /// Lane of the road, by its number in the file.
    pub lane: i32,
    /// Station of the beginning, m. Default: 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub s_m: f64,
    /// Roads that the way visits, which decide at junctions. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub via: Vec<String>,
    /// Length of the way, m. Default: 500.
    #[serde(default = "usual_length")]
    pub length_m: f64,
}

fn usual_length() -> f64 {
    500.0
}

/// Width in metres of lanes in a file that is not read yet.
const UNREAD_WIDTH_M: f64 = 3.5;

/// A piece of the world's own road.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Piece", deny_unknown_fields)]
pub enum OwnPiece {
    /// Straight piece.
    Line {
        /// Length, m.
        length_m: f64,
    },
    /// Piece along a circle.
    Arc {
        /// Length, m.
        length_m: f64,
        /// Radius, m. Positive turns left, negative right.
        radius_m: NumberOrRange,
    },
}

impl From<Piece> for OwnPiece {
    fn from(piece: Piece) -> OwnPiece {
        match piece {
            Piece::Line { length_m } => OwnPiece::Line { length_m },
            Piece::Arc { length_m, radius_m } => OwnPiece::Arc {
                length_m,
                radius_m: radius_m.into(),
            },
        }
    }
}

impl OwnPiece {
    /// Returns the piece at a point of its ranges.
    pub fn at(&self, point: RangePoint) -> Piece {
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Sensors", deny_unknown_fields, default)]
pub struct SensorsFile {
    /// Delay of percepts of other agents, s, a multiple of the sample. Default: 0.
    #[serde(skip_serializing_if = "is_default")]
    pub delay_s: NumberOrRange,
    /// Standard deviation of headways and lateral offsets, m. Default: 0.
    #[serde(skip_serializing_if = "is_default")]
    pub position_sd_m: NumberOrRange,
    /// Standard deviation of other agents' speeds, m/s. Default: 0.
    #[serde(skip_serializing_if = "is_default")]
    pub speed_sd_mps: NumberOrRange,
    /// Distance beyond which it perceives no road user, m. Default: unlimited.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_m: Option<NumberOrRange>,
    /// Whether vehicles hide the agents behind them. Default: `false`.
    #[serde(skip_serializing_if = "is_default")]
    pub line_of_sight: bool,
}

/// Wind, whose numbers may be ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Wind", deny_unknown_fields)]
pub struct WindFile {
    /// Speed of the steady wind, m/s.
    pub speed_mps: NumberOrRange,
    /// Direction from which it blows, counter-clockwise from world x.
    pub from_rad: f64,
    /// Gust that adds to it. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gust: Option<GustFile>,
}

/// Gust of the wind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Gust", deny_unknown_fields)]
pub struct GustFile {
    /// Greatest added speed, m/s.
    pub peak_mps: NumberOrRange,
    /// Beginning, s.
    pub begin_s: NumberOrRange,
    /// Duration, s.
    pub duration_s: f64,
}

impl WindFile {
    /// Returns the wind with the middle of each range.
    pub fn nominal(&self) -> Wind {
        let of = |number| RangePoint::Middle.of(number);
        Wind {
            speed_mps: of(self.speed_mps),
            from_rad: self.from_rad,
            gust: self.gust.as_ref().map(|gust| Gust {
                peak_mps: of(gust.peak_mps),
                begin_s: of(gust.begin_s),
                duration_s: gust.duration_s,
            }),
        }
    }
}

/// Returns the grades of a road with the middle of each range.
pub fn nominal_grades(grades: &[(f64, NumberOrRange)]) -> Vec<Grade> {
    let grades = grades.iter().map(|&(from_s_m, rise)| Grade {
        from_s_m,
        rise: RangePoint::Middle.of(rise),
    });
    grades.collect()
}

/// Point of a range at which a road or sensors are evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RangePoint {
    /// Least value.
    Least,
    /// Middle, which is exact for a fixed number.
    Middle,
    /// Greatest value.
    Greatest,
}

impl RangePoint {
    /// All points, the middle first.
    // A road without ranges is checked at the first of them alone.
    pub const ALL: [RangePoint; 3] = [RangePoint::Middle, RangePoint::Least, RangePoint::Greatest];

    fn of(self, NumberOrRange(Range { lo, hi }): NumberOrRange) -> f64 {
        match self {
            RangePoint::Least => lo,
            // A huge number plus itself is infinite.
            RangePoint::Middle if lo == hi => lo,
            RangePoint::Middle => 0.5 * (lo + hi),
            RangePoint::Greatest => hi,
        }
    }
}

impl OwnRoad {
    /// Returns the friction, a number or a range.
    pub fn friction(&self) -> NumberOrRange {
        match self {
            OwnRoad::Straight { friction, .. }
            | OwnRoad::Curved { friction, .. }
            | OwnRoad::Polyline { friction, .. }
            | OwnRoad::OpenDrive { friction, .. } => *friction,
        }
    }

    /// Returns the width of a lane, a number or a range.
    pub fn lane_width_m(&self) -> NumberOrRange {
        match self {
            OwnRoad::Straight { lane_width_m, .. }
            | OwnRoad::Curved { lane_width_m, .. }
            | OwnRoad::Polyline { lane_width_m, .. } => *lane_width_m,
            // The file has the width, which replaces this variant.
            OwnRoad::OpenDrive { .. } => NumberOrRange::from(UNREAD_WIDTH_M),
        }
    }

    /// Returns the radii of its arcs with their positions among the pieces.
    pub fn radii_m(&self) -> impl Iterator<Item = (usize, NumberOrRange)> {
        let pieces = (match self {
            OwnRoad::Curved { pieces, .. } => pieces.as_slice(),
            // The corners of a polyline have one fixed radius, and the pieces of an
            // OpenDRIVE file have no ranges.
            OwnRoad::Straight { .. } | OwnRoad::Polyline { .. } | OwnRoad::OpenDrive { .. } => &[],
        })
        .iter()
        .enumerate();
        pieces.filter_map(|(i, piece)| match piece {
            OwnPiece::Line { .. } => None,
            OwnPiece::Arc { radius_m, .. } => Some((i, *radius_m)),
        })
    }

    /// Returns the road with the middle of each range.
    pub fn nominal(&self) -> Road {
        self.at(RangePoint::Middle)
    }

    /// Returns the road at a point of its ranges.
    pub fn at(&self, point: RangePoint) -> Road {
        let friction = point.of(self.friction());
        let lane_width_m = point.of(self.lane_width_m());
        match self {
            // A placeholder until the file is read, whose pieces replace this variant.
            OwnRoad::OpenDrive {
                speed_limit_mps, ..
            } => Road::Straight {
                lanes: 1,
                lane_width_m,
                friction,
                speed_limit_mps: *speed_limit_mps,
            },
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
    /// Returns the sensors at a point of their ranges.
    pub fn at(&self, point: RangePoint) -> Sensors {
        Sensors {
            delay_s: point.of(self.delay_s),
            position_sd_m: point.of(self.position_sd_m),
            speed_sd_mps: point.of(self.speed_sd_mps),
            range_m: self.range_m.map(|range_m| point.of(range_m)),
            line_of_sight: self.line_of_sight,
        }
    }
}
