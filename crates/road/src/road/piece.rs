//! Pieces of a road: as a world file states them, by their curvature, and with a station.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Greatest turn of a part of a longer arc: a leg turns by half a circle at most.
const PART_RAD: f64 = 3.0;

/// A piece of a curved road.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "FixedPiece")]
pub enum Piece {
    /// A straight piece.
    Line {
        /// Length along the middle of lane 0.
        length_m: f64,
    },
    /// A piece along a circle.
    Arc {
        /// Length along the middle of lane 0.
        length_m: f64,
        /// Radius of the circle. Positive turns left, negative right.
        radius_m: f64,
    },
}

/// Piece of constant curvature: a line or an arc.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bend {
    /// Length of the piece.
    pub length_m: f64,
    /// Curvature in 1/m, positive to the left and 0 on a line.
    pub per_m: f64,
}

impl From<Piece> for Bend {
    fn from(piece: Piece) -> Bend {
        match piece {
            Piece::Line { length_m } => Bend {
                length_m,
                per_m: 0.0,
            },
            Piece::Arc { length_m, radius_m } => Bend {
                length_m,
                per_m: 1.0 / radius_m,
            },
        }
    }
}

impl From<Bend> for Piece {
    fn from(bend: Bend) -> Piece {
        let length_m = bend.length_m;
        if bend.per_m == 0.0 {
            Piece::Line { length_m }
        } else {
            let radius_m = 1.0 / bend.per_m;
            Piece::Arc { length_m, radius_m }
        }
    }
}

impl Bend {
    /// Returns the angle by which the piece turns, in either direction.
    pub fn turn_rad(&self) -> f64 {
        (self.length_m * self.per_m).abs()
    }

    /// Returns equal parts that turn by less than half a circle each.
    pub fn parts(self) -> impl Iterator<Item = Bend> {
        // At least one part, because a line does not turn.
        let parts = (self.turn_rad() / PART_RAD).ceil().max(1.0);
        let part = Bend {
            length_m: self.length_m / parts,
            ..self
        };
        core::iter::repeat_n(part, parts as usize)
    }
}

/// A part of the course with constant curvature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoadPiece {
    /// Start along the course.
    pub from_s_m: f64,
    /// Its length.
    pub length_m: f64,
    /// Its curvature, positive to the left.
    pub curvature_per_m: f64,
}
