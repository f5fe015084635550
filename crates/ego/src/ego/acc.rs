//! Adaptive cruise control (Sec. V-B): a proportional-derivative follower.
//!
//! u = Kp (d − d_ref) + Kd (v_lead − v_ego), saturated to [−brake, accel]. The
//! headway d is front bumper to front bumper, and d_ref = standstill + time gap
//! · v_ego. Without a leader the ego keeps its speed.

use super::parameters::parameters;
use super::{Command, Controller, Fault, Percept};

parameters! {
    /// The follower of Sec. V-B, with a constant time gap.
    pub struct Acc {
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
    }
}

impl Acc {
    /// Returns the law u before saturation, 0 without a leader.
    fn wish_mps2(&self, percept: &Percept) -> f64 {
        let Some(lead) = percept.leader() else {
            return 0.0;
        };
        let speed_mps = percept.own.speed_mps;
        let reference_m = self.standstill_headway_m + self.time_gap_s * speed_mps;
        self.kp_per_s2 * (lead.following_headway_m() - reference_m)
            + self.kd_per_s * (lead.speed_mps - speed_mps)
    }

    /// Returns the commanded acceleration, shared by all followers.
    pub(super) fn accel_mps2(&self, percept: &Percept) -> f64 {
        let wish_mps2 = self.wish_mps2(percept);
        // Both limits are checked to be at least 0, as `clamp` requires.
        wish_mps2.clamp(-self.max_brake_mps2, self.max_accel_mps2)
    }
}

/// Extracts the follower from a controller with the parameters of [`Acc`].
macro_rules! acc_in {
    ($it:expr) => {
        $crate::ego::Acc {
            kp_per_s2: $it.kp_per_s2,
            kd_per_s: $it.kd_per_s,
            standstill_headway_m: $it.standstill_headway_m,
            time_gap_s: $it.time_gap_s,
            max_brake_mps2: $it.max_brake_mps2,
            max_accel_mps2: $it.max_accel_mps2,
        }
    };
}

pub(super) use acc_in;

impl Controller for Acc {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        Ok(Command::accelerate(self.accel_mps2(percept)))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
