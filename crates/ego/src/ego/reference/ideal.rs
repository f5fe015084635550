//! The ideal driver: no delay, full braking, until standstill.
//!
//! It brakes from the first sample at which straight extrapolation gives
//! contact within 4 s, at constant speeds along and across the lane. It also
//! brakes if the lead in its path brakes by more than 1 m/s² at a headway below
//! 2 s. A lead at constant speed is avoided exactly if g > Δv T + Δv²/(2B)
//! − B T²/2, with braking B behind a first-order lag T.

use super::{DriverModel, Encounter, Latching, Pedal};
use crate::ego::parameters::parameters;

parameters! {
    /// Brakes at once and fully for an unavoidable contact.
    pub struct IdealDriver {
        /// Time ahead for which it extrapolates, s.
        look_ahead_s = 4.0, at_least 0.0;
        /// Headway within which it observes the brakes of its lead, s.
        headway_s = 2.0, at_least 0.0;
        /// Braking of its lead that it answers, m/s².
        lead_brake_mps2 = 1.0, at_least 0.0;
        /// Its braking, limited by the road's friction too, m/s².
        max_brake_mps2 = 9.81, at_least 0.0;
    }
}

impl IdealDriver {
    /// Returns whether straight extrapolation gives contact within the look-ahead.
    fn will_touch(&self, encounter: &Encounter) -> bool {
        let Encounter { ego, other, .. } = encounter;
        let along = window(
            other.x_m - ego.x_m,
            other.speed_mps - ego.speed_mps,
            0.5 * (ego.length_m + other.length_m),
        );
        let across = window(
            other.y_m - ego.y_m,
            other.lateral_mps - ego.lateral_mps,
            0.5 * (ego.width_m + other.width_m),
        );
        // Boxes overlap only while they overlap along and across the lane.
        let from_s = along.0.max(across.0).max(0.0);
        let to_s = along.1.min(across.1).min(self.look_ahead_s);
        from_s < to_s
    }

    /// Returns whether a lead in the path brakes at too small a headway.
    fn lead_brakes(&self, encounter: &Encounter) -> bool {
        let Encounter { ego, other, .. } = encounter;
        let in_path = encounter.clearance_m() < 0.0;
        let near = encounter.gap_m() < self.headway_s * ego.speed_mps;
        in_path && near && other.accel_mps2 < -self.lead_brake_mps2
    }
}

/// Returns the times between which |at + speed · t| < reach, empty if reversed.
fn window(at_m: f64, speed_mps: f64, reach_m: f64) -> (f64, f64) {
    if speed_mps == 0.0 {
        // Without relative motion a body is inside for ever or never.
        return if at_m.abs() < reach_m {
            (f64::NEG_INFINITY, f64::INFINITY)
        } else {
            (f64::INFINITY, f64::NEG_INFINITY)
        };
    }
    let (a_s, b_s) = ((-reach_m - at_m) / speed_mps, (reach_m - at_m) / speed_mps);
    (a_s.min(b_s), a_s.max(b_s))
}

impl DriverModel for IdealDriver {
    fn pedal(&self) -> Pedal {
        Pedal {
            reaction_s: 0.0,
            waiting_mps2: 0.0,
            jerk_mps3: f64::INFINITY,
            max_brake_mps2: self.max_brake_mps2,
        }
    }

    fn danger(&self, encounter: &Encounter) -> Option<f64> {
        let must = self.will_touch(encounter) || self.lead_brakes(encounter);
        must.then_some(f64::INFINITY)
    }

    fn latching(&self) -> Latching {
        Latching::UntilStandstill
    }
}
