//! Roads along the lanes of a map.

use crate::road_fit::{FittedRoad, RoadFit};

/// Distance from the lane with which a road of fewer pieces is enough.
const NEAR_M: f64 = 0.1;
/// Least length of a piece, as the bends of junctions need it.
const PIECE_M: f64 = 4.0;
/// Greatest number of pieces.
const MOST_PIECES: usize = 64;

impl FittedRoad {
    /// Fits a road to the middle of a lane, whose bends are of at least `least_radius_m`.
    ///
    /// Returns `None` for fewer than two points that are 0.5 m apart, and for sharper bends.
    pub fn of_lane(points_m: &[[f64; 2]], least_radius_m: f64) -> Option<FittedRoad> {
        let how = RoadFit {
            tolerance_m: NEAR_M,
            piece_m: PIECE_M,
            most_pieces: MOST_PIECES,
            most_per_m: 1.0 / least_radius_m,
        };
        FittedRoad::fit(points_m, how)
    }
}
