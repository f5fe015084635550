//! The full velocity difference model (Jiang, Wu, Zhu 2001).
//!
//! An optimal velocity model (Bando 1995) with a term for the closing speed: u
//! = κ (V(s) − v) − λ Δv with V(s) = V₀ (tanh(s/L − β) + tanh β) / (1 + tanh
//! β). Here s is the clearance beyond the smallest clearance and Δv the closing
//! speed.

use super::following::car_following;
use super::parameters::parameters;

parameters! {
    /// A follower at the speed that suits its clearance.
    pub struct Fvdm {
        /// Speed it drives at on a free road, V₀, m/s.
        desired_speed_mps, at_least 0.1;
        /// Clearance over which its speed rises, L, m.
        transition_m, at_least 0.1;
        /// Form of that rise, β.
        form, at_least 0.0;
        /// Rate of adaptation of its speed, κ, 1/s.
        sensitivity_per_s, at_least 0.0;
        /// Gain on the closing speed, λ, 1/s.
        closing_gain_per_s, at_least 0.0;
        /// Clearance at standstill, m.
        min_gap_m, at_least 0.0;
        /// Greatest acceleration, m/s².
        max_accel_mps2, at_least 0.01;
        /// Hardest commanded braking, m/s².
        max_brake_mps2, at_least 0.0;
    }
}

impl Fvdm {
    /// Returns the model's acceleration for a leader's clearance and speed.
    pub fn accel_mps2(&self, speed_mps: f64, leader: Option<(f64, f64)>) -> f64 {
        let suits = |clearance_m: f64| {
            let shift = libm::tanh(self.form);
            // Below the smallest clearance V would be negative: the car would
            // reverse.
            let beyond_m = (clearance_m - self.min_gap_m).max(0.0);
            let rise = libm::tanh(beyond_m / self.transition_m - self.form) + shift;
            self.desired_speed_mps * rise / (1.0 + shift)
        };
        let (wanted_mps, closing_mps) = match leader {
            None => (self.desired_speed_mps, 0.0),
            Some((clearance_m, leader_mps)) => (suits(clearance_m), speed_mps - leader_mps),
        };
        let wish_mps2 = self.sensitivity_per_s * (wanted_mps - speed_mps)
            - self.closing_gain_per_s * closing_mps;
        wish_mps2.clamp(-self.max_brake_mps2, self.max_accel_mps2)
    }
}

car_following!(Fvdm);

#[cfg(test)]
mod tests {
    use super::*;

    const FVDM: Fvdm = Fvdm {
        desired_speed_mps: 30.0,
        transition_m: 15.0,
        form: 1.5,
        sensitivity_per_s: 0.4,
        closing_gain_per_s: 0.6,
        min_gap_m: 1.0,
        max_accel_mps2: 2.0,
        max_brake_mps2: 6.0,
    };

    #[test]
    fn it_wants_to_stand_at_the_smallest_clearance_and_to_drive_freely_far_away() {
        assert!(FVDM.accel_mps2(0.0, Some((1.0, 0.0))).abs() < 1e-12);
        assert!(FVDM.accel_mps2(30.0, Some((300.0, 30.0))).abs() < 1e-6);
        assert_eq!(FVDM.accel_mps2(30.0, None), 0.0);
    }

    #[test]
    fn a_closing_speed_counts_beside_the_clearance() {
        // In the middle of the rise V is 30 · tanh β / (1 + tanh β).
        let shift = libm::tanh(1.5);
        let middle_mps = 30.0 * shift / (1.0 + shift);
        let leader = |speed_mps| Some((1.0 + 15.0 * 1.5, speed_mps));
        assert!(FVDM.accel_mps2(middle_mps, leader(middle_mps)).abs() < 1e-12);
        let closing = FVDM.accel_mps2(middle_mps, leader(middle_mps - 2.0));
        assert!((closing + 1.2).abs() < 1e-12, "{closing}");
    }
}
