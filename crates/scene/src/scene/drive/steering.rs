//! Lateral control: path curvature from a lateral offset.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ego::Actuator;
use crate::road::{Course, Direction, OnRoad};
use crate::sim::{Body, Pose, sine};

/// Natural frequency of the lateral loop, in 1/s.
const OMEGA_PER_S: f64 = 1.2;
/// Damping ratio of the lateral loop.
const ZETA: f64 = 1.0;
/// Least speed for which curvature is computed, so that it stays bounded.
const MIN_SPEED_MPS: f64 = 3.0;
/// Largest lateral speed of a vehicle, as a share of its speed.
const MAX_SLIP: f64 = 0.4;

/// Point of a driven vehicle that keeps the lane.
///
/// On a straight road both points move alike. In a bend the front swings out of
/// the line of the rear axle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
pub enum LaneKeeping {
    /// The middle of the front bumper.
    #[default]
    Front,
    /// The middle of the rear axle, as in the paths of test protocols.
    RearAxle,
}

/// Course of a road, in the direction in which a vehicle drives on it.
#[derive(Clone, Copy, Debug)]
pub struct CourseAhead<'a> {
    /// Course of the road.
    pub course: &'a Course,
    /// Driving direction.
    pub direction: Direction,
}

impl LaneKeeping {
    /// Returns the initial pose for a front bumper at a place of the road.
    ///
    /// In road direction. The body lies along the tangent at the point that
    /// keeps the lane.
    pub fn begun(self, body: &Body, ahead: CourseAhead<'_>, s_m: f64, lateral_m: f64) -> Pose {
        let course = ahead.course;
        let lever_m = match (self, ahead.direction) {
            (LaneKeeping::Front, _) => return course.pose(s_m, lateral_m),
            (LaneKeeping::RearAxle, Direction::With) => body.lever_m(),
            // The pose is in road direction, so the axle is ahead of the front.
            (LaneKeeping::RearAxle, Direction::Against) => -body.lever_m(),
        };
        course.pose(s_m - lever_m, lateral_m).ahead(lever_m)
    }

    /// Returns the input of the lane keeper: the place of the point that it keeps.
    ///
    /// In driving direction. `at` is the place of the front, whose pose is
    /// `front`. A rear axle moves along an arc per sample. The curvature that
    /// keeps it on its line is the mean of the road's curvature over that
    /// distance.
    #[inline]
    pub fn seen(
        self,
        body: &Body,
        front: &Pose,
        at: OnRoad,
        ahead: CourseAhead<'_>,
        way_m: f64,
    ) -> OnRoad {
        let along_m = match ahead.direction {
            Direction::With => way_m,
            Direction::Against => -way_m,
        };
        let kept = match self {
            LaneKeeping::Front => at,
            LaneKeeping::RearAxle => {
                let axle = ahead.course.locate(&front.ahead(-body.lever_m()));
                let curvature_per_m = ahead.course.mean_curvature_per_m(axle.s_m, along_m);
                OnRoad {
                    curvature_per_m,
                    ..axle
                }
            }
        };
        match ahead.direction {
            Direction::With => kept,
            Direction::Against => kept.reversed(),
        }
    }
}

/// Controller that follows a lateral reference, which may itself move.
///
/// The reference's speed w follows the commanded speed with a first-order lag.
/// With offset e and drift ė relative to the reference, κ = (ẇ − ω² e − 2 ζ ω
/// ė) / v², plus the curvature of the road. The loop is critically damped
/// around a reference that is fed forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneKeeper {
    reference_m: f64,
    reference_mps: f64,
    lag: Actuator,
    /// Distance from the rear axle, which follows the path, to the kept point.
    lever_m: f64,
}

impl LaneKeeper {
    /// Keeps `lateral_m` with a point of a body, with a lag on lateral speeds.
    pub fn new(
        body: &Body,
        keeps: LaneKeeping,
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

    /// Returns the curvature for the next sample. `lateral_mps` moves the reference.
    #[inline]
    pub(crate) fn curvature(
        &mut self,
        at: &OnRoad,
        speed_mps: f64,
        lateral_mps: f64,
        sample_s: f64,
    ) -> f64 {
        let most_mps = MAX_SLIP * speed_mps.abs();
        let moving_mps = self.lag.step(lateral_mps).clamp(-most_mps, most_mps);
        // The acceleration of the reference is fed forward, so that the loop
        // does not lag.
        let feed_mps2 = quotient(moving_mps - self.reference_mps, sample_s);
        self.reference_mps = moving_mps;
        self.reference_m += moving_mps * sample_s;
        let offset_m = at.lateral_m - self.reference_m;
        // In a curve the front bumper points outwards of the path beneath it.
        let slip_rad = if at.curvature_per_m == 0.0 {
            at.heading_rad
        } else {
            at.heading_rad + self.lever_m * at.curvature_per_m
        };
        let drift_mps = speed_mps * sine(slip_rad) - moving_mps;
        let speed_mps = speed_mps.abs().max(MIN_SPEED_MPS);
        // Second-order loop: ω²·offset + 2ζω·drift, less the feed-forward.
        let wish_mps2 =
            OMEGA_PER_S * OMEGA_PER_S * offset_m + 2.0 * ZETA * OMEGA_PER_S * drift_mps - feed_mps2;
        let keeping_per_m = quotient(-wish_mps2, speed_mps * speed_mps);
        // A branch, so that straight roads stay free of rounding. In a bend the
        // path at this offset has radius R − lateral.
        if at.curvature_per_m == 0.0 {
            keeping_per_m
        } else {
            keeping_per_m + at.curvature_per_m / (1.0 - at.curvature_per_m * at.lateral_m)
        }
    }
}

/// Returns `of / by`, above 0, without a division for the 0 of a car in its place.
#[inline]
fn quotient(of: f64, by: f64) -> f64 {
    if of == 0.0 { of } else { of / by }
}
