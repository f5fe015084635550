//! Boxes of recorded obstacles over time, which may touch each other.

use crate::pose::Pose;
use crate::traffic::RecordedMotion;

/// Time between the instants at which boxes are compared, in seconds.
const STEP_S: f64 = 0.1;
/// Room that boxes keep from each other in metres.
const CLEAR_M: f64 = 0.05;

/// Box at every instant of a scenario.
#[derive(Clone, Debug)]
pub(super) struct BoxPlaces {
    middles: Vec<Pose>,
    half_m: [f64; 2],
}

impl BoxPlaces {
    /// Returns the places of a box whose middle is `ahead_m` of the point that moves.
    pub(super) fn of(
        motion: &RecordedMotion,
        ahead_m: f64,
        size_m: [f64; 2],
        until_s: f64,
    ) -> BoxPlaces {
        let middle = |i: usize| {
            let speed = motion.speed.as_ref();
            let way_m = speed.map_or(0.0, |it| it.position_m(i as f64 * STEP_S) - it.start_m);
            let point = motion.road.course.pose(motion.s_m + way_m, 0.0);
            point.ahead(ahead_m)
        };
        BoxPlaces {
            middles: (0..=(until_s / STEP_S).round() as usize)
                .map(middle)
                .collect(),
            // Half the room on each of both boxes.
            half_m: size_m.map(|it| 0.5 * (it + CLEAR_M)),
        }
    }

    /// Returns whether two boxes touch at some instant.
    pub(super) fn touches(&self, other: &BoxPlaces) -> bool {
        let instants = self.middles.iter().zip(&other.middles);
        let is_apart = |from: &BoxPlaces, to: &BoxPlaces, a: &Pose, b: &Pose| {
            let seen = a.sees(b);
            let (sin, cos) = libm::sincos(seen.heading_rad);
            let reach_m =
                |along: f64, across: f64| along.abs() * to.half_m[0] + across.abs() * to.half_m[1];
            seen.x_m.abs() > from.half_m[0] + reach_m(cos, sin)
                || seen.y_m.abs() > from.half_m[1] + reach_m(sin, cos)
        };
        // Boxes without a side that separates them overlap.
        instants
            .into_iter()
            .any(|(a, b)| !is_apart(self, other, a, b) && !is_apart(other, self, b, a))
    }
}
