//! FSM: the fuzzy safety model (Mattas et al. 2020, UN R157 performance model 2).
//!
//! It rates the situation by two numbers from 0 to 1, between a surely safe
//! distance S and a surely unsafe distance U. The proactive number (PFS) rates
//! whether the ego could stop if the other car braked as hard as possible. The
//! critical number (CFS) rates whether the ego hits the other car if both keep
//! their motion. CFS causes hard braking and PFS comfortable braking, both in
//! proportion.

use super::{DriverModel, Encounter, Pedal};
use crate::ego::parameters::parameters;

parameters! {
    /// Brakes in proportion to the unsafety of its distance (FSM).
    pub struct FsmDriver {
        /// Reaction time τ, s.
        reaction_s = 0.75, at_least 0.0;
        /// Comfortable braking b₁, m/s².
        comfort_brake_mps2 = 4.0, at_least 0.1;
        /// Hard braking b₂, m/s².
        hard_brake_mps2 = 6.0, at_least 0.1;
        /// Hardest braking of the other car, m/s².
        other_brake_mps2 = 7.0, at_least 0.1;
        /// Clearance to be left at standstill, m.
        standstill_gap_m = 2.0, at_least 0.0;
        /// Additional clearance of the safe distance, m.
        safe_margin_m = 2.0, at_least 0.0;
        /// Time by which a car from the side must be late, s.
        passing_margin_s = 0.1, at_least 0.0;
        /// Rate at which braking builds up, m/s³.
        jerk_mps3 = 12.65, at_least 0.01;
        /// Hardest braking, m/s².
        max_brake_mps2 = 7.59294, at_least 0.0;
    }
}

/// Dissatisfaction of the driver, each from 0 (content) to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Satisfaction {
    /// PFS, for an agent that brakes as hard as possible.
    pub proactive: f64,
    /// CFS, for two agents that keep their motion.
    pub critical: f64,
}

impl FsmDriver {
    /// Returns both numbers, 0 if the agent will not be in the way in time.
    pub fn satisfaction(&self, encounter: &Encounter) -> Satisfaction {
        if self.passes_first(encounter) {
            // Both numbers are 0: the models rate no agent that arrives too
            // late.
            return Satisfaction::default();
        }
        Satisfaction {
            proactive: self.proactive(encounter),
            critical: self.critical(encounter),
        }
    }

    /// Lateral test: returns whether the ego is past before the agent arrives.
    fn passes_first(&self, encounter: &Encounter) -> bool {
        let clearance_m = encounter.clearance_m();
        if clearance_m <= 0.0 {
            return false;
        }
        let approach_mps = encounter.approach_mps();
        if approach_mps <= 0.0 {
            return true;
        }
        // Until the ego's rear is past the other's front. An opening gap gives a
        // negative time: an agent from the side then arrives too late.
        let way_m = encounter.gap_m() + 2.0 * encounter.mean_length_m();
        let past_s = if encounter.closing_mps() == 0.0 {
            f64::INFINITY
        } else {
            way_m / encounter.closing_mps()
        };
        past_s + self.passing_margin_s < clearance_m / approach_mps
    }

    /// Returns PFS.
    ///
    /// S and U are the stopping distances with b₁ and b₂ after τ, minus that of
    /// the agent. The gap counts above the clearance kept at standstill.
    fn proactive(&self, encounter: &Encounter) -> f64 {
        let (ego_mps, other_mps) = (encounter.ego.speed_mps, encounter.other.speed_mps);
        let behind_m = |brake_mps2: f64| {
            ego_mps * self.reaction_s + ego_mps * ego_mps / (2.0 * brake_mps2)
                - other_mps * other_mps / (2.0 * self.other_brake_mps2)
        };
        let safe_m = behind_m(self.comfort_brake_mps2) + self.safe_margin_m;
        let unsafe_m = behind_m(self.hard_brake_mps2);
        let spare_m = encounter.gap_m() - self.standstill_gap_m;
        between(spare_m, safe_m, unsafe_m)
    }

    /// Returns CFS.
    ///
    /// S and U are the distances by which the ego catches up: during τ at its
    /// current acceleration, and then while braking with b₁ and b₂ to the
    /// agent's speed.
    fn critical(&self, encounter: &Encounter) -> f64 {
        let (ego_mps, other_mps) = (encounter.ego.speed_mps, encounter.other.speed_mps);
        // A gap that does not close is never critical.
        if ego_mps <= other_mps {
            return 0.0;
        }
        let (tau_s, accel_mps2) = (self.reaction_s, encounter.accel_mps2);
        // Drivers do not keep braking harder than comfortably without a reason.
        let kept_mps2 = accel_mps2.max(-self.comfort_brake_mps2);
        let then_mps = ego_mps + tau_s * kept_mps2;
        let gap_m = encounter.gap_m();
        // Braking as now already suffices within τ, so only the distance of
        // that braking matters.
        if then_mps < other_mps {
            let closing_mps = encounter.closing_mps();
            let needed_m = closing_mps * closing_mps / (2.0 * accel_mps2.abs());
            return if gap_m < needed_m { 1.0 } else { 0.0 };
        }
        let lost_m = (ego_mps + 0.5 * kept_mps2 * tau_s - other_mps) * tau_s;
        let excess_mps = then_mps - other_mps;
        let caught_m = |brake_mps2: f64| lost_m + excess_mps * excess_mps / (2.0 * brake_mps2);
        between(
            gap_m,
            caught_m(self.comfort_brake_mps2),
            caught_m(self.hard_brake_mps2),
        )
    }
}

/// Returns 0 beyond the safe distance, 1 below the unsafe, linear between.
///
/// If both are equal, 1 up to that distance.
fn between(gap_m: f64, safe_m: f64, unsafe_m: f64) -> f64 {
    // Equal distances are a separate case: the quotient would divide by zero.
    if safe_m < gap_m {
        0.0
    } else if gap_m < unsafe_m || safe_m == unsafe_m {
        1.0
    } else {
        (gap_m - safe_m) / (unsafe_m - safe_m)
    }
}

impl DriverModel for FsmDriver {
    fn pedal(&self) -> Pedal {
        Pedal {
            reaction_s: self.reaction_s,
            waiting_mps2: 0.0,
            jerk_mps3: self.jerk_mps3,
            max_brake_mps2: self.max_brake_mps2,
        }
    }

    fn danger(&self, encounter: &Encounter) -> Option<f64> {
        let Satisfaction {
            proactive,
            critical,
        } = self.satisfaction(encounter);
        let harder_mps2 = self.hard_brake_mps2 - self.comfort_brake_mps2;
        let demanded_mps2 = if critical > 0.0 {
            self.comfort_brake_mps2 + critical * harder_mps2
        } else {
            proactive * self.comfort_brake_mps2
        };
        // Both are at least 0, so the sum is 0 only without any danger.
        (proactive + critical > 0.0).then_some(demanded_mps2)
    }
}
