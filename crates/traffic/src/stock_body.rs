//! Bodies of world files that stand in for recorded road users.

use crate::recording::{Class, RoadUserTrack};

/// Body of world files that stands in for a recorded road user.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StockBody {
    /// Name in world files.
    pub name: &'static str,
    /// Length in metres.
    pub length_m: f64,
    /// Width in metres.
    pub width_m: f64,
    /// Distance from the rear bumper to the point that plans move: the rear axle, and the
    /// middle of a pedestrian.
    pub rear_overhang_m: f64,
}

impl StockBody {
    /// Body of the egos of recorded worlds.
    pub const EGO: StockBody = StockBody {
        name: "sedan",
        length_m: 4.54,
        width_m: 1.80,
        rear_overhang_m: 0.92,
    };

    /// Returns the stock body for a class and a length.
    pub fn nearest(class: Class, length_m: f64) -> StockBody {
        let (name, length_m, width_m, rear_overhang_m) = match class {
            Class::Pedestrian => ("pedestrian", 0.50, 0.60, 0.25),
            Class::Bicycle => ("bicyclist", 1.75, 0.60, 0.35),
            Class::Motorcycle => ("motorcycle", 2.10, 0.80, 0.34),
            Class::Van => ("van", 5.93, 2.02, 1.27),
            // A longer truck is articulated as a rule.
            Class::Truck if length_m < 12.5 => ("truck", 9.20, 2.50, 2.50),
            Class::Truck | Class::Trailer => ("semitrailer", 16.50, 2.55, 5.60),
            Class::Car | Class::Other => return StockBody::EGO,
        };
        StockBody {
            name,
            length_m,
            width_m,
            rear_overhang_m,
        }
    }

    /// Returns the stock body for a track.
    pub(crate) fn of(track: &RoadUserTrack) -> StockBody {
        StockBody::nearest(track.class, track.length_m)
    }

    /// Returns true for pedestrians.
    pub fn is_on_foot(&self) -> bool {
        self.name == "pedestrian"
    }

    /// Returns the greatest speed at the start of a world, `None` without a limit.
    pub(crate) fn most_mps(&self) -> Option<f64> {
        match self.name {
            // Limits of the starts in world files, which refuse more.
            "pedestrian" => Some(4.0),
            "bicyclist" => Some(10.0),
            _ => None,
        }
    }

    /// Returns the distance from the moved point to the front bumper.
    pub(crate) fn lever_m(&self) -> f64 {
        self.length_m - self.rear_overhang_m
    }

    /// Returns the moved points of a track whose box centres the body shares.
    pub(crate) fn points_m(
        &self,
        track: &RoadUserTrack,
        samples: std::ops::Range<usize>,
    ) -> Vec<[f64; 2]> {
        // Recordings state box centres, but plans move the rear axle.
        let ahead_m = self.rear_overhang_m - 0.5 * self.length_m;
        let point = |i: usize| {
            let (sin, cos) = libm::sincos(track.heading_rad[i]);
            [track.x_m[i] + ahead_m * cos, track.y_m[i] + ahead_m * sin]
        };
        samples.map(point).collect()
    }
}
