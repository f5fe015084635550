//! Wind: a steady part and a gust, and the forces on bodies in it.

use core::f64::consts::TAU;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::{AIR_KG_PER_M3, Body, BodyState, rotation_by};

/// Coefficient of the force across a body, by its side area and the side wind.
///
/// About that of a box (Hoerner, Fluid-Dynamic Drag, 1965, chapter 3).
const SIDE_COEFFICIENT: f64 = 1.0;

/// Wind over the whole world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wind {
    /// Speed of the steady wind.
    pub speed_mps: f64,
    /// Direction from which it blows, counter-clockwise from world x.
    pub from_rad: f64,
    /// Gust in the same direction, if any.
    pub gust: Option<Gust>,
}

/// Gust that swells and fades as (1 − cos) / 2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gust {
    /// Speed that it adds at its middle.
    pub peak_mps: f64,
    /// Time at which it begins.
    pub begin_s: f64,
    /// Time from its beginning to its end.
    pub duration_s: f64,
}

impl Wind {
    /// Returns the velocity of the air in the world frame.
    fn velocity_mps(&self, time_s: f64) -> Vector2<f64> {
        let gust_mps = self.gust.map_or(0.0, |gust| gust.speed_mps(time_s));
        // The wind blows away from where it comes from.
        rotation_by(self.from_rad) * Vector2::new(-(self.speed_mps + gust_mps), 0.0)
    }

    /// Returns the acceleration of a body along its heading and to its left.
    ///
    /// Along the heading it is the change of the air drag that the plant applies in
    /// still air.
    pub fn accel_mps2(&self, time_s: f64, body: &Body, state: &BodyState) -> (f64, f64) {
        let air = rotation_by(-state.pose.heading_rad) * self.velocity_mps(time_s);
        let per_kg = 0.5 * AIR_KG_PER_M3 / body.mass_kg;
        // The plants drag vehicles only, so wind changes nothing for others along the
        // way.
        let drag_area_m2 = body.vehicle().map_or(0.0, |vehicle| vehicle.drag_area_m2);
        // The speed of the body through the air.
        let against_mps = state.speed_mps - air.x;
        let still_mps = state.speed_mps;
        // Products with the absolute value keep the sign of each speed, also
        // in a tail wind.
        let along = still_mps * still_mps.abs() - against_mps * against_mps.abs();
        let side_area_m2 = SIDE_COEFFICIENT * body.length_m * body.height_m;
        (
            per_kg * drag_area_m2 * along,
            // Without the body's own lateral speed, which is far below that of a side wind.
            per_kg * side_area_m2 * air.y * air.y.abs(),
        )
    }
}

impl Gust {
    fn speed_mps(&self, time_s: f64) -> f64 {
        let share = (time_s - self.begin_s) / self.duration_s;
        if (0.0..=1.0).contains(&share) {
            0.5 * self.peak_mps * (1.0 - libm::cos(TAU * share))
        } else {
            0.0
        }
    }
}
