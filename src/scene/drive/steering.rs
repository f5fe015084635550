//! Keeping and changing the lateral position: a path curvature from an offset.

use serde::Deserialize;

use super::course::{Course, OnRoad};
use super::placed::Direction;
use crate::ego::Actuator;
use crate::sim::{Body, Pose};

/// Natural frequency of the lateral loop, 1/s.
const OMEGA_PER_S: f64 = 1.2;
/// Damping ratio of the lateral loop.
const ZETA: f64 = 1.0;
/// Curvature is worked out for at least this speed, so that it stays bounded.
const MIN_SPEED_MPS: f64 = 3.0;
/// No car moves sideways faster than this share of its speed.
const MAX_SLIP: f64 = 0.4;

/// Which point of a driven vehicle keeps its line. On a straight road it is the
/// same; in a bend the front swings out of the line that the rear axle keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum LaneKeeping {
    /// The middle of the front bumper.
    #[default]
    Front,
    /// The middle of the rear axle, as paths of test protocols mean it.
    RearAxle,
}

impl LaneKeeping {
    /// The pose of who begins with the front at a place of the road, as the road
    /// goes: the body lies along the tangent at the point that keeps the line.
    pub(super) fn begun(
        self,
        body: &Body,
        (course, direction): (&Course, Direction),
        (s_m, lateral_m): (f64, f64),
    ) -> Pose {
        let lever_m = match (self, direction) {
            (LaneKeeping::Front, _) => return course.pose(s_m, lateral_m),
            (LaneKeeping::RearAxle, Direction::With) => body.lever_m(),
            (LaneKeeping::RearAxle, Direction::Against) => -body.lever_m(),
        };
        ahead(&course.pose(s_m - lever_m, lateral_m), lever_m)
    }

    /// What the keeper steers by: the place of the point that keeps the line, as
    /// it is driven; `at` is that of the front, in the pose `front`.
    ///
    /// A rear axle runs along arcs of a sample each: the curvature that keeps it
    /// on its line is the mean of the road's over the way of that sample.
    pub(super) fn seen(
        self,
        body: &Body,
        (front, at): (&Pose, OnRoad),
        (course, direction): (&Course, Direction),
        way_m: f64,
    ) -> OnRoad {
        let along_m = match direction {
            Direction::With => way_m,
            Direction::Against => -way_m,
        };
        let at = match self {
            LaneKeeping::Front => at,
            LaneKeeping::RearAxle => {
                let at = course.locate(&ahead(front, -body.lever_m()));
                let curvature_per_m = course.mean_curvature_per_m(at.s_m, along_m);
                OnRoad {
                    curvature_per_m,
                    ..at
                }
            }
        };
        match direction {
            Direction::With => at,
            Direction::Against => at.reversed(),
        }
    }
}

/// Follows a lateral reference that may itself move.
///
/// The reference's speed w follows the one asked for with a first-order lag.
/// With offset e and drift ė relative to the reference,
/// κ = (ẇ − ω² e − 2 ζ ω ė) / v², plus what the road's own curve takes: a
/// critically damped loop around a reference that is fed forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LaneKeeper {
    reference_m: f64,
    reference_mps: f64,
    lag: Actuator,
    /// From the rear axle, which follows the path, to the point that keeps the
    /// line.
    lever_m: f64,
}

impl LaneKeeper {
    /// Keeps `lateral_m` with a point of a body; lateral speeds follow with a lag.
    pub(super) fn new(
        (body, keeps): (&Body, LaneKeeping),
        lateral_m: f64,
        lag_s: f64,
        sample_s: f64,
    ) -> LaneKeeper {
        LaneKeeper {
            reference_m: lateral_m,
            reference_mps: 0.0,
            lag: Actuator::new(lag_s, sample_s),
            lever_m: match keeps {
                LaneKeeping::Front => body.lever_m(),
                LaneKeeping::RearAxle => 0.0,
            },
        }
    }

    /// The curvature for the next sample; `lateral_mps` moves the reference.
    pub(super) fn curvature(
        &mut self,
        at: &OnRoad,
        speed_mps: f64,
        lateral_mps: f64,
        sample_s: f64,
    ) -> f64 {
        let most_mps = MAX_SLIP * speed_mps.abs();
        let moving_mps = self.lag.step(lateral_mps).clamp(-most_mps, most_mps);
        let feed_mps2 = (moving_mps - self.reference_mps) / sample_s;
        self.reference_mps = moving_mps;
        self.reference_m += moving_mps * sample_s;
        let offset_m = at.lateral_m - self.reference_m;
        // In a curve the front bumper points outwards of the path under it.
        let slip_rad = match at.curvature_per_m == 0.0 {
            true => at.heading_rad,
            false => at.heading_rad + self.lever_m * at.curvature_per_m,
        };
        let drift_mps = speed_mps * libm::sin(slip_rad) - moving_mps;
        let speed_mps = speed_mps.abs().max(MIN_SPEED_MPS);
        let wish_mps2 =
            OMEGA_PER_S * OMEGA_PER_S * offset_m + 2.0 * ZETA * OMEGA_PER_S * drift_mps - feed_mps2;
        let keeping_per_m = -wish_mps2 / (speed_mps * speed_mps);
        match at.curvature_per_m == 0.0 {
            true => keeping_per_m,
            false => keeping_per_m + at.curvature_per_m / (1.0 - at.curvature_per_m * at.lateral_m),
        }
    }
}

/// The pose so far ahead of another.
fn ahead(pose: &Pose, by_m: f64) -> Pose {
    let (sin, cos) = libm::sincos(pose.heading_rad);
    Pose {
        x_m: pose.x_m + by_m * cos,
        y_m: pose.y_m + by_m * sin,
        heading_rad: pose.heading_rad,
    }
}
