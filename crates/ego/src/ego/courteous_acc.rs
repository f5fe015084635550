//! Adaptive cruise control that spares the car behind.
//!
//! While a follower is closer than a time gap it brakes only softly, to avoid a
//! rear-end collision. Without such a follower it brakes fully.

use super::acc::acc_in;
use super::parameters::parameters;
use super::{Acc, Command, Controller, Fault, Percept};

parameters! {
    /// The follower of `Acc`, braking softly when tailgated.
    pub struct PoliteAcc {
        /// Gain on the headway error, 1/s².
        kp_per_s2, at_least 0.0;
        /// Gain on the speed difference, 1/s.
        kd_per_s, at_least 0.0;
        /// Reference headway at standstill, front to front, m.
        standstill_headway_m, at_least 0.0;
        /// Reference headway per speed, s.
        time_gap_s, at_least 0.0;
        /// Hardest commanded braking, m/s².
        max_brake_mps2, at_least 0.0;
        /// Hardest commanded acceleration, m/s².
        max_accel_mps2, at_least 0.0;
        /// Hardest braking while a follower is close, m/s².
        soft_brake_mps2, at_least 0.0;
        /// Time gap below which a follower is close, s.
        rear_gap_s, at_least 0.0;
    }
}

impl PoliteAcc {
    fn is_tailgated(&self, percept: &Percept) -> bool {
        percept.follower().is_some_and(|behind| {
            // Headways are front to front, so the ego's own length lies between
            // them.
            let clearance_m = -behind.headway_m - percept.own.length_m;
            clearance_m < self.rear_gap_s * behind.speed_mps
        })
    }
}

impl Controller for PoliteAcc {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let max_brake_mps2 = if self.is_tailgated(percept) {
            // A soft limit above the hard limit must not strengthen the brakes.
            self.soft_brake_mps2.min(self.max_brake_mps2)
        } else {
            self.max_brake_mps2
        };
        let follow = Acc {
            max_brake_mps2,
            ..acc_in!(self)
        };
        Ok(Command::accelerate(follow.accel_mps2(percept)))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
