//! Followers that stop for traffic lights (the paper's appendix).
//!
//! On yellow the paper's ego cruises while d(t) + δ < d_l, where d_l is the
//! distance to the line. Otherwise it brakes with a_max. The paper defines
//! d(t) = v (τ − t) + ½ a_max (τ − t)².
//!
//! Only a_max < 0 is consistent with both. d(t) is the
//! distance covered *until red* under full braking, and not the stopping
//! distance. This is the flaw that an ado exploits. [`YellowLightFixed`] uses
//! v²/2|a_max| + v·lag instead.
//!
//! Paper: silent on three points. Here: d(t) is clamped at standstill, because
//! the printed formula would reverse the car. On red it brakes while it is
//! before the line's far side and stops braking once past −δ. On green it
//! follows. τ − t is the assumed yellow time minus the time seen.

use super::acc::acc_in;
use super::parameters::parameters;
use super::{Acc, Briefing, Command, Controller, Fault, Percept, Phase, SeenLight};

/// Declares a controller that stops for lights. Both have the same parameters.
macro_rules! stops_for_lights {
    ($(#[doc = $about:literal])+ $name:ident by $reach:expr) => {
        parameters! {
            $(#[doc = $about])+
            pub struct $name {
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
                /// Deceleration of its stops, |a_max|, m/s².
                stop_brake_mps2, at_least 0.1;
                /// Length of the junction behind the stop line, δ, m.
                junction_m, at_least 0.0;
                /// Assumed time of a light from yellow to red, τ, s.
                yellow_s, at_least 0.0;
            }
        }

        impl $name {
            pub(super) fn build(&self) -> Stopping {
                Stopping {
                    follow: acc_in!(self),
                    stop_brake_mps2: self.stop_brake_mps2,
                    junction_m: self.junction_m,
                    yellow_s: self.yellow_s,
                    reach: $reach,
                    // Known only from the briefing, because the actuator
                    // belongs to the car.
                    lag_s: 0.0,
                }
            }
        }
    };
}

stops_for_lights! {
    /// Follows, and stops for lights by the paper's d(t).
    YellowLight by Reach::UntilRed
}

stops_for_lights! {
    /// Follows, and stops for lights by the stopping distance.
    YellowLightFixed by Reach::Stopping
}

/// Distance compared with the distance to the line.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Reach {
    /// d(t): the distance under full braking until red.
    UntilRed,
    /// v²/2a plus the distance lost by the lag of the brakes.
    Stopping,
}

/// The controller with the lag of its actuator, known from its briefing.
#[derive(Clone, Debug)]
pub(super) struct Stopping {
    follow: Acc,
    stop_brake_mps2: f64,
    junction_m: f64,
    yellow_s: f64,
    reach: Reach,
    lag_s: f64,
}

impl Stopping {
    fn reach_m(&self, speed_mps: f64, light: &SeenLight) -> f64 {
        match self.reach {
            Reach::UntilRed => {
                // A yellow phase may last longer than the ego assumes.
                let left_s = (self.yellow_s - light.phase_s).max(0.0);
                // Braking ends at standstill, where the printed formula would
                // reverse the car.
                let braking_s = left_s.min(speed_mps.max(0.0) / self.stop_brake_mps2);
                speed_mps * braking_s - 0.5 * self.stop_brake_mps2 * braking_s * braking_s
            }
            Reach::Stopping => {
                let stopping_m = speed_mps * speed_mps / (2.0 * self.stop_brake_mps2);
                stopping_m + speed_mps * self.lag_s
            }
        }
    }

    fn must_stop(&self, percept: &Percept) -> bool {
        let Some(light) = percept.light(self.junction_m) else {
            return false;
        };
        match (light.phase, self.reach) {
            (Phase::Green, _) => false,
            // By d(t) it brakes wherever it is before the far side of the line.
            (Phase::Red, Reach::UntilRed) => true,
            // By the stopping distance it brakes as late as on yellow.
            (Phase::Yellow, _) | (Phase::Red, Reach::Stopping) => {
                let reach_m = self.reach_m(percept.own.speed_mps, light);
                // The complement of d(t) + δ < d_l, with the junction on the
                // other side.
                light.line_m <= reach_m + self.junction_m
            }
        }
    }
}

impl Controller for Stopping {
    fn brief(&mut self, briefing: &Briefing) {
        self.lag_s = briefing.lag_s;
    }

    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        if self.must_stop(percept) {
            return Ok(Command::accelerate(-self.stop_brake_mps2));
        }
        self.follow.control(percept)
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
