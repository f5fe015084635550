//! Road and sensors of a world file, whose numbers may be ranges.

use serde::Deserialize;

use super::number_or_range::NumberOrRange;
use crate::road::{Grade, Piece, Road};
use crate::scene::drive::{Range, Sensors};
use crate::sim::{Gust, Wind};

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
    /// Way along lanes of an OpenDRIVE file, whose pieces replace it in the text.
    OpenDrive {
        file: String,
        along: LanesFile,
        friction: NumberOrRange,
        #[serde(default)]
        speed_limit_mps: Option<f64>,
    },
}

/// Start on a lane of an OpenDRIVE file, and the way from there.
#[derive(Clone, Deserialize)]
#[serde(rename = "Lanes", deny_unknown_fields)]
pub(super) struct LanesFile {
    pub(super) road: String,
    pub(super) lane: i32,
    #[serde(default)]
    pub(super) s_m: f64,
    /// Roads that the way visits, which decide at junctions.
    #[serde(default)]
    pub(super) via: Vec<String>,
    #[serde(default = "usual_length")]
    pub(super) length_m: f64,
}

fn usual_length() -> f64 {
    500.0
}

/// Width in metres of lanes in a file that is not read yet.
const UNREAD_WIDTH_M: f64 = 3.5;

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
    pub(super) fn at(&self, point: RangePoint) -> Piece {
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
    pub(super) delay_s: NumberOrRange,
    pub(super) position_sd_m: NumberOrRange,
    pub(super) speed_sd_mps: NumberOrRange,
    pub(super) range_m: Option<NumberOrRange>,
    line_of_sight: bool,
}

impl Default for SensorsFile {
    fn default() -> SensorsFile {
        let none = NumberOrRange::from(0.0);
        SensorsFile {
            delay_s: none,
            position_sd_m: none,
            speed_sd_mps: none,
            range_m: None,
            line_of_sight: false,
        }
    }
}

/// Wind, whose numbers may be ranges.
#[derive(Deserialize)]
#[serde(rename = "Wind", deny_unknown_fields)]
pub(super) struct WindFile {
    pub(super) speed_mps: NumberOrRange,
    /// Direction from which it blows, counter-clockwise from world x.
    pub(super) from_rad: f64,
    #[serde(default)]
    pub(super) gust: Option<GustFile>,
}

/// Gust of the wind.
#[derive(Deserialize)]
#[serde(rename = "Gust", deny_unknown_fields)]
pub(super) struct GustFile {
    pub(super) peak_mps: NumberOrRange,
    pub(super) begin_s: NumberOrRange,
    pub(super) duration_s: f64,
}

impl WindFile {
    /// Returns the wind with the middle of each range.
    pub(super) fn nominal(&self) -> Wind {
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
pub(super) fn nominal_grades(grades: &[(f64, NumberOrRange)]) -> Vec<Grade> {
    let grades = grades.iter().map(|&(from_s_m, rise)| Grade {
        from_s_m,
        rise: RangePoint::Middle.of(rise),
    });
    grades.collect()
}

/// Point of a range at which a road or sensors are evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum RangePoint {
    Least,
    Middle,
    Greatest,
}

impl RangePoint {
    pub(super) const ALL: [RangePoint; 3] =
        [RangePoint::Middle, RangePoint::Least, RangePoint::Greatest];

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
    pub(super) fn friction(&self) -> NumberOrRange {
        match self {
            OwnRoad::Straight { friction, .. }
            | OwnRoad::Curved { friction, .. }
            | OwnRoad::Polyline { friction, .. }
            | OwnRoad::OpenDrive { friction, .. } => *friction,
        }
    }

    /// Returns the width of a lane, a number or a range.
    pub(super) fn lane_width_m(&self) -> NumberOrRange {
        match self {
            OwnRoad::Straight { lane_width_m, .. }
            | OwnRoad::Curved { lane_width_m, .. }
            | OwnRoad::Polyline { lane_width_m, .. } => *lane_width_m,
            // The file has the width, which replaces this variant.
            OwnRoad::OpenDrive { .. } => NumberOrRange::from(UNREAD_WIDTH_M),
        }
    }

    /// Returns the radii of its arcs with their positions among the pieces.
    pub(super) fn radii_m(&self) -> impl Iterator<Item = (usize, NumberOrRange)> {
        let pieces = (match self {
            OwnRoad::Curved { pieces, .. } => pieces.as_slice(),
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
    pub(super) fn nominal(&self) -> Road {
        self.at(RangePoint::Middle)
    }

    pub(super) fn at(&self, point: RangePoint) -> Road {
        let friction = point.of(self.friction());
        let lane_width_m = point.of(self.lane_width_m());
        match self {
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
    pub(super) fn at(&self, point: RangePoint) -> Sensors {
        Sensors {
            delay_s: point.of(self.delay_s),
            position_sd_m: point.of(self.position_sd_m),
            speed_sd_mps: point.of(self.speed_sd_mps),
            range_m: self.range_m.map(|range_m| point.of(range_m)),
            line_of_sight: self.line_of_sight,
        }
    }
}
