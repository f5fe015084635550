//! Cruise control with automatic emergency braking.
//!
//! It cruises at its initial speed. At constant lateral speed it predicts where
//! each agent ahead will be when the ego arrives, up to its look-ahead. The ego
//! must stop for an agent that will then be in its corridor. If that takes more
//! than the trigger's deceleration, the ego brakes fully. For agents across or
//! against the road it uses the space that their bodies occupy and the time in
//! which both would be there.

use super::parameters::parameters;
use super::{Command, Controller, Fault, Own, Percept, Seen};

parameters! {
    /// Cruises, and brakes hard for agents that cross its path.
    pub struct Aeb {
        /// Gain on the cruising speed's error, 1/s.
        cruise_gain_per_s, at_least 0.0;
        /// Hardest acceleration or braking while cruising, m/s².
        cruise_limit_mps2, at_least 0.0;
        /// Deceleration needed at or above which it brakes, m/s².
        trigger_mps2, at_least 0.0;
        /// Deceleration of the emergency brake, m/s².
        max_brake_mps2, at_least 0.0;
        /// Clearance it wants to keep when it has stopped, m.
        margin_m, at_least 0.0;
        /// Free width it wants at either side, m.
        side_m, at_least 0.0;
        /// Time ahead for which lateral motion is predicted, s.
        look_ahead_s, at_least 0.0;
    }
}

impl Aeb {
    /// Returns the deceleration that avoids an agent, 0 if it will be elsewhere.
    pub(super) fn needed_mps2(&self, own: &Own, seen: &Seen) -> f64 {
        let clearance_m = seen.clearance_m() - self.margin_m;
        let closing_mps = own.speed_mps - seen.speed_mps;
        if closing_mps <= 0.0 {
            return 0.0;
        }
        if !self.is_in_path(own, seen, clearance_m, closing_mps) {
            return 0.0;
        }
        // Inside the margin no finite deceleration restores the clearance.
        if clearance_m <= 0.0 {
            return f64::INFINITY;
        }
        closing_mps * closing_mps / (2.0 * clearance_m)
    }

    /// Returns whether an agent is in the corridor when the ego arrives.
    fn is_in_path(&self, own: &Own, seen: &Seen, clearance_m: f64, closing_mps: f64) -> bool {
        if !seen.is_along() {
            return seen.crosses_path(own, self.side_m, self.look_ahead_s);
        }
        if seen.headway_m <= 0.0 {
            return false;
        }
        let reach_s = (clearance_m.max(0.0) / closing_mps).min(self.look_ahead_s);
        let half_m = 0.5 * (own.width_m + seen.width_m) + self.side_m;
        let then_m = seen.lateral_m + seen.lateral_mps * reach_s;
        // An agent may pass the whole corridor between now and then, so a
        // change of sides counts even if both ends are outside.
        let crosses = seen.lateral_m * then_m <= 0.0 && reach_s > 0.0;
        seen.lateral_m.abs() < half_m || then_m.abs() < half_m || crosses
    }
}

impl Aeb {
    /// Returns the emergency braking or the cruise control's acceleration.
    pub(super) fn accel_mps2(&self, percept: &Percept, cruise_mps: f64) -> f64 {
        let needed = percept
            .others
            .iter()
            .map(|seen| self.needed_mps2(&percept.own, seen));
        // The worst agent alone decides, since full braking answers all of
        // them.
        if self.trigger_mps2 <= needed.fold(0.0, f64::max) {
            return -self.max_brake_mps2;
        }
        let limit_mps2 = self.cruise_limit_mps2;
        let wish_mps2 = self.cruise_gain_per_s * (cruise_mps - percept.own.speed_mps);
        wish_mps2.clamp(-limit_mps2, limit_mps2)
    }
}

/// The controller with its cruising speed.
#[derive(Clone, Debug)]
pub(super) struct Guarding {
    spec: Aeb,
    cruise_mps: Option<f64>,
}

impl Aeb {
    pub(super) fn build(&self) -> Guarding {
        Guarding {
            spec: self.clone(),
            cruise_mps: None,
        }
    }
}

impl Controller for Guarding {
    fn reset(&mut self, _seed: u64) {
        self.cruise_mps = None;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        // The speed of the first percept is the initial speed, which `reset`
        // does not know.
        let cruise_mps = *self.cruise_mps.get_or_insert(percept.own.speed_mps);
        Ok(Command::accelerate(
            self.spec.accel_mps2(percept, cruise_mps),
        ))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
