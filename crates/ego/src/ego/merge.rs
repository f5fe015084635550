//! The switching merge controller (Sec. V-B).
//!
//! d_lka = d_lat − v_ado,lat · t_lka is the predicted lateral distance of a
//! road user from the ego, t_lka from now. The ego brakes hard while an agent
//! ahead has d_lka at or below the threshold. Otherwise it cruises at its
//! initial speed.

use super::parameters::parameters;
use super::{Command, Controller, Fault, Percept, Seen};

parameters! {
    /// Cruises, and brakes hard while an agent ahead merges.
    pub struct Merge {
        /// Predicted lateral distance at or below which it brakes, m.
        threshold_m, at_least 0.0;
        /// Time ahead for which the lateral distance is predicted, s.
        t_lka_s, at_least 0.0;
        /// Gain on the cruising speed's error, 1/s.
        cruise_gain_per_s, at_least 0.0;
        /// Hardest acceleration or braking while cruising, m/s².
        cruise_limit_mps2, at_least 0.0;
        /// Deceleration of the hard brake, m/s².
        max_brake_mps2, at_least 0.0;
    }
}

impl Merge {
    /// Predicted lateral distance d_lka, negative if the agent will have crossed.
    fn d_lka_m(&self, seen: &Seen) -> f64 {
        let towards_mps = -seen.lateral_mps * seen.lateral_m.signum();
        seen.lateral_m.abs() - towards_mps * self.t_lka_s
    }
}

/// The controller with its cruising speed.
#[derive(Clone, Debug)]
pub(super) struct Merging {
    spec: Merge,
    cruise_mps: Option<f64>,
}

impl Merge {
    pub(super) fn build(&self) -> Merging {
        Merging {
            spec: self.clone(),
            cruise_mps: None,
        }
    }
}

impl Controller for Merging {
    fn reset(&mut self, _seed: u64) {
        self.cruise_mps = None;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let speed_mps = percept.own.speed_mps;
        let cruise_mps = *self.cruise_mps.get_or_insert(speed_mps);
        // Every agent ahead counts, at any headway: the law has no range.
        let merging =
            |seen: &Seen| seen.headway_m > 0.0 && self.spec.d_lka_m(seen) <= self.spec.threshold_m;
        if percept.others.iter().any(merging) {
            return Ok(Command::accelerate(-self.spec.max_brake_mps2));
        }
        let limit_mps2 = self.spec.cruise_limit_mps2;
        let wish_mps2 = self.spec.cruise_gain_per_s * (cruise_mps - speed_mps);
        Ok(Command::accelerate(
            wish_mps2.clamp(-limit_mps2, limit_mps2),
        ))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
