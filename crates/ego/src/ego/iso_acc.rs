//! A follower within the limits of ISO 15622, with an optional emergency brake.
//!
//! ISO 15622:2018 (full speed range adaptive cruise control) requires a time
//! gap of at least 0.8 s and limits the system's own actions. Limits apply at 5
//! m/s and below, at 20 m/s and above, and linearly between: deceleration 5 and
//! 3.5 m/s², acceleration 4 and 2 m/s², negative jerk 5 and 2.5 m/s³. Within
//! these limits it follows by the law of `Acc`.
//!
//! The emergency brake resembles that of UN R152 (at least 5 m/s²). It acts
//! when avoiding the leader takes the trigger's deceleration or more. It then
//! brakes fully and without a limit of jerk until it is no faster than the
//! leader.

use super::parameters::parameters;
use super::{Acc, Command, Controller, Fault, Percept};

parameters! {
    /// Follows within the limits of ISO 15622 and may brake in an emergency.
    pub struct IsoAcc {
        /// Gain on the headway error, 1/s².
        kp_per_s2, at_least 0.0;
        /// Gain on the speed difference, 1/s.
        kd_per_s, at_least 0.0;
        /// Reference headway at standstill, front to front, m.
        standstill_headway_m, at_least 0.0;
        /// Reference headway per speed, at least 0.8 in the standard, s.
        time_gap_s, at_least 0.0;
        /// Deceleration needed at or above which the emergency brake acts, m/s².
        aeb_trigger_mps2, at_least 0.0;
        /// Deceleration of the emergency brake, 0 for none, m/s².
        aeb_brake_mps2, at_least 0.0;
    }
}

/// A limit that falls from 5 m/s to 20 m/s and is constant elsewhere.
fn limit(speed_mps: f64, slow: f64, fast: f64) -> f64 {
    let share = ((speed_mps - 5.0) / 15.0).clamp(0.0, 1.0);
    slow + share * (fast - slow)
}

/// The controller with its last command.
#[derive(Clone, Debug)]
pub(super) struct Following {
    spec: IsoAcc,
    last_mps2: f64,
    is_emergency: bool,
}

impl IsoAcc {
    pub(super) fn build(&self) -> Following {
        Following {
            spec: self.clone(),
            last_mps2: 0.0,
            is_emergency: false,
        }
    }

    /// Returns the command that ISO 15622 permits now.
    fn follow_mps2(&self, percept: &Percept, last_mps2: f64) -> f64 {
        let speed_mps = percept.own.speed_mps;
        let law = Acc {
            kp_per_s2: self.kp_per_s2,
            kd_per_s: self.kd_per_s,
            standstill_headway_m: self.standstill_headway_m,
            time_gap_s: self.time_gap_s,
            max_brake_mps2: limit(speed_mps, 5.0, 3.5),
            max_accel_mps2: limit(speed_mps, 4.0, 2.0),
        };
        let fall_mps2 = limit(speed_mps, 5.0, 2.5) * percept.sample_s;
        // The jerk limit applies downwards only: releasing the brake is not
        // limited.
        law.accel_mps2(percept).max(last_mps2 - fall_mps2)
    }
}

impl Following {
    /// Returns whether the emergency brake acts, once begun until the danger ends.
    fn brakes_hard(&self, percept: &Percept) -> bool {
        let Some(lead) = percept.leader() else {
            return false;
        };
        let closing_mps = percept.own.speed_mps - lead.speed_mps;
        let clearance_m = lead.clearance_m();
        let needed_mps2 = if clearance_m > 0.0 {
            closing_mps * closing_mps / (2.0 * clearance_m)
        } else {
            f64::INFINITY
        };
        // A brake that has begun ends with the closing and not with the
        // trigger, as braking lowers the need.
        closing_mps > 0.0 && (self.is_emergency || self.spec.aeb_trigger_mps2 <= needed_mps2)
    }
}

impl Controller for Following {
    fn reset(&mut self, _seed: u64) {
        (self.last_mps2, self.is_emergency) = (0.0, false);
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        self.is_emergency = self.spec.aeb_brake_mps2 > 0.0 && self.brakes_hard(percept);
        let follow_mps2 = self.spec.follow_mps2(percept, self.last_mps2);
        self.last_mps2 = if self.is_emergency {
            // Never weaker than the follower itself.
            follow_mps2.min(-self.spec.aeb_brake_mps2)
        } else {
            follow_mps2
        };
        Ok(Command::accelerate(self.last_mps2))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::{Own, Seen};

    /// Returns a percept at `speed_mps`, `clearance_m` behind a leader.
    fn behind(speed_mps: f64, clearance_m: f64, lead_mps: f64) -> Percept {
        let lead = Seen {
            headway_m: clearance_m + 4.0,
            length_m: 4.0,
            width_m: 2.0,
            speed_mps: lead_mps,
            ..Seen::default()
        };
        let own = Own {
            speed_mps,
            length_m: 4.0,
            width_m: 2.0,
            ..Own::default()
        };
        Percept {
            sample_s: 0.1,
            own,
            others: vec![lead],
            ..Percept::default()
        }
    }

    fn ego(aeb_brake_mps2: f64) -> Following {
        let spec = IsoAcc {
            kp_per_s2: 0.3,
            kd_per_s: 1.0,
            standstill_headway_m: 6.0,
            time_gap_s: 1.0,
            aeb_trigger_mps2: 5.0,
            aeb_brake_mps2,
        };
        spec.build()
    }

    fn commanded(ego: &mut Following, percept: &Percept) -> f64 {
        ego.control(percept).expect("a command").accel_mps2
    }

    #[test]
    fn braking_builds_up_by_the_jerk_to_the_limit_of_its_speed() {
        for (speed_mps, jerk, limit) in [(25.0, 2.5, 3.5), (12.5, 3.75, 4.25), (4.0, 5.0, 5.0)] {
            let mut ego = ego(0.0);
            let near = behind(speed_mps, 1.0, 0.0);
            let first = commanded(&mut ego, &near);
            assert!((first + 0.1 * jerk).abs() < 1e-12, "{first}");
            for _ in 0..30 {
                commanded(&mut ego, &near);
            }
            assert!((commanded(&mut ego, &near) + limit).abs() < 1e-12);
        }
        // Free to accelerate at once, within the limit.
        assert_eq!(commanded(&mut ego(0.0), &behind(25.0, 200.0, 30.0)), 2.0);
    }

    #[test]
    fn the_emergency_brake_acts_at_its_trigger_and_until_the_danger_is_over() {
        let mut ego = ego(8.0);
        // 100 / (2 · 10.1) and 100 / (2 · 9.9) m/s² lie on either side of 5.
        assert!(commanded(&mut ego, &behind(15.0, 10.1, 5.0)) > -1.0);
        assert_eq!(commanded(&mut ego, &behind(15.0, 9.9, 5.0)), -8.0);
        assert_eq!(commanded(&mut ego, &behind(7.0, 9.0, 5.0)), -8.0);
        assert!(commanded(&mut ego, &behind(5.0, 8.5, 5.0)) > -8.0);
        ego.reset(0);
        assert!(commanded(&mut ego, &behind(7.0, 9.0, 5.0)) > -1.0);
    }
}
