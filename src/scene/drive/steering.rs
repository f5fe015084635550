//! Keeping and changing the lateral position: a path curvature from an offset.

use super::course::OnRoad;
use crate::ego::Actuator;
use crate::sim::Body;

/// Natural frequency of the lateral loop, 1/s.
const OMEGA_PER_S: f64 = 1.2;
/// Damping ratio of the lateral loop.
const ZETA: f64 = 1.0;
/// Curvature is worked out for at least this speed, so that it stays bounded.
const MIN_SPEED_MPS: f64 = 3.0;
/// No car moves sideways faster than this share of its speed.
const MAX_SLIP: f64 = 0.4;

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
    /// From the rear axle, which follows the path, to the front bumper.
    lever_m: f64,
}

impl LaneKeeper {
    /// Keeps `lateral_m` with a body; lateral speeds follow with a lag.
    pub(super) fn new(body: &Body, lateral_m: f64, lag_s: f64, sample_s: f64) -> LaneKeeper {
        LaneKeeper {
            reference_m: lateral_m,
            reference_mps: 0.0,
            lag: Actuator::new(lag_s, sample_s),
            lever_m: body.lever_m(),
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
