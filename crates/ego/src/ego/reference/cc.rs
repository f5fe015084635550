//! CC: the competent and careful human driver of UN R157 (performance model 1).
//!
//! It detects danger when the other car is laterally relevant and |g/Δv| ≤ 2 s.
//! It releases the accelerator at once. After 0.75 s it brakes with 12.65 m/s³
//! up to 0.774 g. The readings differ in the lateral relevance:
//!
//! - [`CcDriver`]: bodies overlap laterally, c ≤ 0 (Mattas et al. 2022).
//! - [`CcLaneDriver`]: the other car is 0.375 m + 0.72 m off its lane's middle.
//!   0.375 m is the usual wandering of drivers. 0.72 m is 1.8 m/s sideways for
//!   the 0.4 s of perception. The ego is in the middle of its lane.
//! - [`CcLatchedDriver`]: as before, but it keeps braking when 2 s are reached
//!   again, until it is no faster than the other car.
//!
//! When following, the regulation's event itself is the danger: a lead car
//! within 2 s that brakes harder than 5 m/s² ([`Encounter::lead_brakes_hard`]).
//! The further 0.4 s of perception are omitted, as in the published model.
//! Behind a car that cuts out the drivers use the time to collision.

use super::{DriverModel, Encounter, Latching, Pedal};
use crate::ego::parameters::parameters;

/// Declares a reading with its additional parameters and its relevant clearance.
macro_rules! competent {
    (
        $(#[$meta:meta])*
        $name:ident { $($besides:tt)* },
        $counts:expr,
        $latching:expr
    ) => {
        parameters! {
            $(#[$meta])*
            pub struct $name {
                /// Time to collision that counts as danger, s.
                ttc_s = 2.0, at_least 0.0;
                /// Time from danger to braking, s.
                reaction_s = 0.75, at_least 0.0;
                /// Deceleration meanwhile, with the accelerator released, m/s².
                foot_off_mps2 = 0.4, at_least 0.0;
                /// Rate at which braking builds up, m/s³.
                jerk_mps3 = 12.65, at_least 0.01;
                /// Hardest braking, m/s².
                max_brake_mps2 = 7.59294, at_least 0.0;
                $($besides)*
            }
        }

        impl DriverModel for $name {
            fn pedal(&self) -> Pedal {
                Pedal {
                    reaction_s: self.reaction_s,
                    waiting_mps2: self.foot_off_mps2,
                    jerk_mps3: self.jerk_mps3,
                    max_brake_mps2: self.max_brake_mps2,
                }
            }

            fn danger(&self, encounter: &Encounter) -> Option<f64> {
                let counts_m: fn(&$name, &Encounter) -> f64 = $counts;
                let counts = encounter.clearance_m() <= counts_m(self, encounter);
                let is_near = counts && encounter.ttc_s() <= self.ttc_s;
                let is_danger = is_near || encounter.lead_brakes_hard();
                // The model has no graded response, so the pedal's limits
                // decide.
                is_danger.then_some(f64::INFINITY)
            }

            fn latching(&self) -> Latching {
                $latching
            }
        }
    };
}

competent! {
    /// Brakes for agents that overlap its path within 2 s (UN R157, reading CC).
    CcDriver {},
    |_, _| 0.0,
    Latching::Momentary
}

competent! {
    /// Brakes for agents that leave the next lane within 2 s (reading CC_LANE).
    CcLaneDriver {
        /// Usual offset of drivers from their lane's middle, m.
        wander_m = 0.375, at_least 0.0;
        /// Lateral distance in which a risk is perceived, m.
        perceived_m = 0.72, at_least 0.0;
    },
    |it, encounter| off_middle_m(encounter, it.wander_m + it.perceived_m),
    Latching::Momentary
}

competent! {
    /// Brakes like CC_LANE until it is no faster than the agent (CC_LATCHED).
    CcLatchedDriver {
        /// Usual offset of drivers from their lane's middle, m.
        wander_m = 0.375, at_least 0.0;
        /// Lateral distance in which a risk is perceived, m.
        perceived_m = 0.72, at_least 0.0;
    },
    |it, encounter| off_middle_m(encounter, it.wander_m + it.perceived_m),
    Latching::UntilSlower
}

/// Returns the clearance of an agent `off_m` off the next lane's middle.
fn off_middle_m(encounter: &Encounter, off_m: f64) -> f64 {
    let Encounter {
        ego,
        other,
        lane_width_m,
        ..
    } = encounter;
    // Both cars have half of their lane's spare width between body and border.
    0.5 * (lane_width_m - other.width_m) + 0.5 * (lane_width_m - ego.width_m) - off_m
}
