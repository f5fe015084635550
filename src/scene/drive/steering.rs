//! Keeping and changing the lateral position: a path curvature from an offset.

use crate::sim::BodyState;

/// Natural frequency of the lateral loop, 1/s.
const OMEGA_PER_S: f64 = 1.2;
/// Damping ratio of the lateral loop.
const ZETA: f64 = 1.0;
/// Curvature is worked out for at least this speed, so that it stays bounded.
const MIN_SPEED_MPS: f64 = 3.0;

/// Follows a lateral reference that may itself move.
///
/// With offset e and heading ψ relative to the moving reference,
/// κ = −(ω² e + 2 ζ ω v sin ψ) / v²: a critically damped second-order loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LaneKeeper {
    reference_m: f64,
}

impl LaneKeeper {
    /// Keeps `lateral_m`.
    pub(super) fn new(lateral_m: f64) -> LaneKeeper {
        LaneKeeper {
            reference_m: lateral_m,
        }
    }

    /// The curvature for the next sample; `lateral_mps` moves the reference.
    pub(super) fn curvature(&mut self, state: &BodyState, lateral_mps: f64, sample_s: f64) -> f64 {
        self.reference_m += lateral_mps * sample_s;
        let offset_m = state.pose.y_m - self.reference_m;
        let drift_mps = state.speed_mps * libm::sin(state.pose.heading_rad) - lateral_mps;
        let speed_mps = state.speed_mps.abs().max(MIN_SPEED_MPS);
        let wish_mps2 = OMEGA_PER_S * OMEGA_PER_S * offset_m + 2.0 * ZETA * OMEGA_PER_S * drift_mps;
        -wish_mps2 / (speed_mps * speed_mps)
    }
}
