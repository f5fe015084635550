//! CC: the competent and careful human driver of UN R157 (performance model 1).
//!
//! It sees danger when the other is sideways where it counts and |g/Δv| ≤ 2 s.
//! It takes its foot off the accelerator at once, and after 0.75 s brakes with
//! 12.65 m/s³ up to 0.774 g. Readings of "where it counts":
//!
//! - [`CcDriver`]: bodies overlap laterally, c ≤ 0 (Mattas et al. 2022).
//! - [`CcLaneDriver`]: the other is 0.375 m off its lane's middle, which is how
//!   far people wander, plus 0.72 m, which is 1.8 m/s sideways for the 0.4 s in
//!   which the risk is perceived; the ego is mid-lane.
//! - [`CcLatchedDriver`]: as before, but it does not let go when 2 s are reached
//!   again: it brakes until it is no faster than the other.
//!
//! Following, the regulation's event itself is the danger: a lead car within 2 s
//! that brakes harder than 5 m/s² ([`Encounter::lead_brakes_hard`]). The further
//! 0.4 s of perception are not counted, as in the published model. Behind a car
//! that cuts out they look at the time to collision.

use super::{DriverModel, Encounter, Latching, Pedal};
use crate::ego::parameters::parameters;

/// Declares a reading, with the parameters that it has besides and the
/// clearance up to which the other counts.
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
                /// Time to collision that is danger, s.
                ttc_s = 2.0, at_least 0.0;
                /// Time from danger to the foot on the brake, s.
                reaction_s = 0.75, at_least 0.0;
                /// Deceleration meanwhile, with the foot off the accelerator, m/s².
                foot_off_mps2 = 0.4, at_least 0.0;
                /// How fast braking builds up, m/s³.
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
                is_danger.then_some(f64::INFINITY)
            }

            fn latching(&self) -> Latching {
                $latching
            }
        }
    };
}

competent! {
    /// Brakes for whoever overlaps its path within 2 s (UN R157, reading CC).
    CcDriver {},
    |_, _| 0.0,
    Latching::Momentary
}

competent! {
    /// Brakes for whoever leaves the next lane within 2 s (reading CC_LANE).
    CcLaneDriver {
        /// How far drivers wander off their lane's middle, m.
        wander_m = 0.375, at_least 0.0;
        /// Way sideways in which a risk is perceived, m.
        perceived_m = 0.72, at_least 0.0;
    },
    |it, encounter| off_middle_m(encounter, it.wander_m + it.perceived_m),
    Latching::Momentary
}

competent! {
    /// The same, and does not let go before it is the slower one (CC_LATCHED).
    CcLatchedDriver {
        /// How far drivers wander off their lane's middle, m.
        wander_m = 0.375, at_least 0.0;
        /// Way sideways in which a risk is perceived, m.
        perceived_m = 0.72, at_least 0.0;
    },
    |it, encounter| off_middle_m(encounter, it.wander_m + it.perceived_m),
    Latching::UntilSlower
}

/// The clearance at which another is `off_m` off the next lane's middle.
fn off_middle_m(encounter: &Encounter, off_m: f64) -> f64 {
    let Encounter {
        ego,
        other,
        lane_width_m,
        ..
    } = encounter;
    0.5 * (lane_width_m - other.width_m) + 0.5 * (lane_width_m - ego.width_m) - off_m
}
