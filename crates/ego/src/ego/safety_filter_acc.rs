//! Adaptive cruise control under a safety filter.
//!
//! The filter compares stopping distances. If both cars braked with the
//! filter's deceleration a from now on, the ego would stop v²/2a − v_lead²/2a
//! nearer to its leader. The filter adds the distance lost while the brakes
//! build up and the margin. If the sum exceeds the clearance, it brakes with a.

use super::acc::acc_in;
use super::following::away_mps;
use super::parameters::parameters;
use super::{Command, Controller, Fault, Percept};

parameters! {
    /// The follower of `Acc` with a braking filter on top.
    pub struct FilteredAcc {
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
        /// Deceleration a that the filter assumes and commands, m/s².
        filter_brake_mps2, at_least 0.1;
        /// Clearance to be left by the filter after stopping, m.
        filter_margin_m, at_least 0.0;
        /// Time for which the filter counts the closing speed as lost, s.
        filter_delay_s, at_least 0.0;
    }
}

impl FilteredAcc {
    /// Returns whether the stopping distances leave no further delay.
    fn must_brake(&self, percept: &Percept) -> bool {
        percept.leader().is_some_and(|lead| {
            let speed_mps = percept.own.speed_mps;
            let away_mps = away_mps(lead.speed_mps);
            let squares = speed_mps * speed_mps - away_mps * away_mps;
            // A leader that is faster may need the longer distance, which adds
            // no room.
            let stopping_m = squares.max(0.0) / (2.0 * self.filter_brake_mps2);
            let delay_m = (speed_mps - lead.speed_mps).max(0.0) * self.filter_delay_s;
            let clearance_m = lead.clearance_m();
            clearance_m < stopping_m + delay_m + self.filter_margin_m
        })
    }
}

impl Controller for FilteredAcc {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let follow_mps2 = acc_in!(self).accel_mps2(percept);
        let wish_mps2 = if self.must_brake(percept) {
            // The filter never weakens the follower: the harder braking counts.
            follow_mps2.min(-self.filter_brake_mps2)
        } else {
            follow_mps2
        };
        Ok(Command::accelerate(wish_mps2))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
