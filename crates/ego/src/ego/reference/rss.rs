//! RSS: responsibility-sensitive safety (Shalev-Shwartz, Shammah, Shashua 2017).
//!
//! Danger exists when both safe distances are violated. With the response time
//! ρ, the ego may accelerate by a during ρ and brakes with b afterwards, while
//! the other car brakes with b_o from now on:
//!
//! d_lon = v_e ρ + a ρ²/2 + (v_e + ρ a)²/(2 b) − v_o²/(2 b_o)
//!
//! Laterally the other car, at speed v_y, may accelerate by a_lat during ρ
//! before it stops again:
//!
//! d_lat = μ + (2 v_y + a_lat ρ) ρ/2 + (v_y + a_lat ρ)²/(2 a_lat)
//!
//! As published for this comparison (Mattas et al. 2022), d_lon is not clamped
//! at 0. The speed v_y is a magnitude, so moving away counts too. Only the
//! other car moves laterally, and the ego always answers by braking.

use super::{DriverModel, Encounter, Pedal};
use crate::ego::parameters::parameters;

parameters! {
    /// Brakes when both safe distances of RSS are violated.
    pub struct RssDriver {
        /// Response time ρ, s.
        reaction_s = 0.75, at_least 0.0;
        /// Acceleration of the ego during ρ, m/s².
        ego_accel_mps2 = 3.0, at_least 0.0;
        /// Braking that the ego guarantees, m/s².
        ego_brake_mps2 = 6.0, at_least 0.1;
        /// Hardest braking of the other car, m/s².
        other_brake_mps2 = 6.0, at_least 0.1;
        /// Lateral acceleration of the other car, m/s².
        lateral_accel_mps2 = 1.0, at_least 0.01;
        /// Lateral distance that always remains, m.
        lateral_margin_m = 0.3, at_least 0.0;
        /// Rate at which braking builds up, m/s³.
        jerk_mps3 = 12.65, at_least 0.01;
        /// Hardest braking, m/s².
        max_brake_mps2 = 7.59294, at_least 0.0;
    }
}

impl RssDriver {
    /// Returns d_lon, the safe distance along the lane.
    pub fn longitudinal_m(&self, ego_mps: f64, other_mps: f64) -> f64 {
        let rho_s = self.reaction_s;
        let faster_mps = ego_mps + rho_s * self.ego_accel_mps2;
        // Not clamped at 0, as published: a faster lead gives a negative
        // distance.
        ego_mps * rho_s
            + 0.5 * self.ego_accel_mps2 * rho_s * rho_s
            + faster_mps * faster_mps / (2.0 * self.ego_brake_mps2)
            - other_mps * other_mps / (2.0 * self.other_brake_mps2)
    }

    /// Returns d_lat, the safe lateral distance.
    pub fn lateral_m(&self, other_lateral_mps: f64) -> f64 {
        // A magnitude, as published: moving away counts like approaching.
        let (v_mps, a_mps2) = (other_lateral_mps.abs(), self.lateral_accel_mps2);
        let then_mps = v_mps + a_mps2 * self.reaction_s;
        self.lateral_margin_m
            + 0.5 * (v_mps + then_mps) * self.reaction_s
            + then_mps * then_mps / (2.0 * a_mps2)
    }
}

impl DriverModel for RssDriver {
    fn pedal(&self) -> Pedal {
        Pedal {
            reaction_s: self.reaction_s,
            waiting_mps2: 0.0,
            jerk_mps3: self.jerk_mps3,
            max_brake_mps2: self.max_brake_mps2,
        }
    }

    fn danger(&self, encounter: &Encounter) -> Option<f64> {
        let Encounter { ego, other, .. } = encounter;
        let near = encounter.gap_m() < self.longitudinal_m(ego.speed_mps, other.speed_mps);
        let beside = encounter.clearance_m() < self.lateral_m(other.lateral_mps);
        (near && beside).then_some(f64::INFINITY)
    }
}
