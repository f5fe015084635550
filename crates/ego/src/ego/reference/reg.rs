//! REG: the cut-in formula of UN R157 ¶5.2.5.2 as a driver.
//!
//! The regulation demands that a cut-in is survived above a certain TTC, when
//! the other car is 0.3 m inside the lane: TTC > Δv / (2 · 6 m/s²) + 0.35 s.
//! As a driver, it detects danger when the other car is within 0.5 m laterally
//! and |g/Δv| ≤ Δv/12 + 0.35 s + 0.1 s. The 0.5 m correspond to those 0.3 m for
//! lanes of 3.5 m and cars of 1.9 m. After 0.35 s it brakes with 6 m/s² at once.
//! The 0.1 s is a step of the published model, kept as a constant.
//! EU 2022/1426 has 0.25 s instead of 0.35 s.

use super::{DriverModel, Encounter, Pedal};
use crate::ego::parameters::parameters;

parameters! {
    /// Brakes for cut-ins at the latest time of UN R157's formula (REG).
    pub struct RegDriver {
        /// Lateral clearance that counts as inside the lane, m.
        inside_m = 0.5, at_least 0.0;
        /// Time from danger to braking, s.
        reaction_s = 0.35, at_least 0.0;
        /// Deceleration that it applies and assumes, m/s².
        max_brake_mps2 = 6.0, at_least 0.1;
        /// Time by which it brakes early, s.
        early_s = 0.1, at_least 0.0;
    }
}

impl RegDriver {
    /// Returns the regulation's bound on the time to collision: Δv/(2b) + τ.
    pub fn bound_s(&self, closing_mps: f64) -> f64 {
        closing_mps / (2.0 * self.max_brake_mps2) + self.reaction_s
    }
}

impl DriverModel for RegDriver {
    fn pedal(&self) -> Pedal {
        Pedal {
            reaction_s: self.reaction_s,
            waiting_mps2: 0.0,
            // The formula assumes constant braking, so it does not build up.
            jerk_mps3: f64::INFINITY,
            max_brake_mps2: self.max_brake_mps2,
        }
    }

    fn danger(&self, encounter: &Encounter) -> Option<f64> {
        let bound_s = self.bound_s(encounter.closing_mps()) + self.early_s;
        let is_inside = encounter.clearance_m() <= self.inside_m;
        (is_inside && encounter.ttc_s() <= bound_s).then_some(f64::INFINITY)
    }
}
