//! Paths that cross, as roads.

use std::f64::consts::PI;

use brakecheck_road::road::OnRoad;

use crate::recording::RoadUserTrack;
use crate::road_fit::{FittedRoad, RoadFit};
use crate::stock_body::StockBody;

/// Greatest distance of the recorded path from its road.
const ACROSS_M: f64 = 0.5;
/// Roads of paths that cross. Sharper bends are no paths of road users.
const PATH_FIT: RoadFit = RoadFit {
    tolerance_m: 0.1,
    piece_m: 3.0,
    most_pieces: 48,
    most_per_m: 0.26,
};

/// Roads of a crossing, in the frame of the recording.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CrossingRoads {
    /// Path of the replaced road user.
    pub ego: FittedRoad,
    /// Path of the planned road user.
    pub other: FittedRoad,
    /// Front bumper of the ego along its road at the start.
    pub ego_s_m: f64,
    /// Front of the planned road user along its road at the start.
    pub other_s_m: f64,
    /// Mean speed of the replaced road user on its way to the crossing in m/s.
    pub desired_mps: f64,
    /// Post-encroachment time of the recorded crossing in seconds.
    pub pet_s: f64,
    /// Angle of the paths in (0, π/2].
    pub angle_rad: f64,
    /// Least recorded speed of the planned road user on the crossing in m/s.
    pub least_mps: f64,
    /// Greatest distance of its recorded path from the road in metres.
    pub across_m: f64,
}

impl CrossingRoads {
    /// Returns the distance from the crossing of the paths at which a body with a width
    /// reaches the strip of another one.
    pub fn reach_m(&self, own: StockBody, crossed: StockBody) -> f64 {
        let (sin, cos) = libm::sincos(self.angle_rad);
        0.5 * (crossed.width_m + own.width_m * cos) / sin
    }
}

/// Path of a body as a road, with its samples along it.
pub(crate) struct PlacedPath {
    pub(crate) road: FittedRoad,
    /// Moved point of the body along the road, a value per sample.
    pub(crate) s_m: Vec<f64>,
    /// Greatest offset of a sample.
    pub(crate) across_m: f64,
}

impl PlacedPath {
    /// Fits a road to the points of a body that plans move.
    ///
    /// Returns `None` if the path is more than 0.5 m from every road.
    pub(crate) fn fit(
        track: &RoadUserTrack,
        body: StockBody,
        samples: std::ops::Range<usize>,
    ) -> Option<PlacedPath> {
        PlacedPath::through(&body.points_m(track, samples))
    }

    /// Fits a road to points.
    pub(crate) fn through(points_m: &[[f64; 2]]) -> Option<PlacedPath> {
        let road = FittedRoad::fit(points_m, PATH_FIT)?;
        let places: Vec<OnRoad> = points_m.iter().map(|point| road.place(*point)).collect();
        let offsets_m = places.iter().map(|it| it.lateral_m.abs());
        let across_m = offsets_m.fold(0.0, f64::max);
        // Beyond it a place may have two stations.
        let is_clear = road.course.turned_rad() < 0.9 * PI;
        (across_m <= ACROSS_M && is_clear).then(|| PlacedPath {
            s_m: places.into_iter().map(|it| it.s_m).collect(),
            road,
            across_m,
        })
    }
}
