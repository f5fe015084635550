//! The intelligent driver model (Treiber, Hennecke, Helbing 2000).
//!
//! u = a (1 − (v/v₀)⁴ − (s*/s)²) with s* = s₀ + max(0, v T + v Δv / (2 √(a
//! b))). Here s is the clearance to the leader and Δv the closing speed.

use super::following::car_following;
use super::parameters::parameters;

parameters! {
    /// A follower with a desired speed, a time gap and comfortable braking.
    pub struct Idm {
        /// Speed it drives at on a free road, v₀, m/s.
        desired_speed_mps, at_least 0.1;
        /// Desired time gap T, s.
        time_gap_s, at_least 0.0;
        /// Clearance at standstill s₀, m.
        min_gap_m, at_least 0.0;
        /// Greatest acceleration a, m/s².
        max_accel_mps2, at_least 0.01;
        /// Comfortable deceleration b, m/s².
        comfort_brake_mps2, at_least 0.01;
        /// Hardest commanded braking, m/s².
        max_brake_mps2, at_least 0.0;
    }
}

impl Idm {
    /// Returns the model's acceleration for a leader's clearance and speed.
    pub fn accel_mps2(&self, speed_mps: f64, leader: Option<(f64, f64)>) -> f64 {
        let speed_ratio = speed_mps / self.desired_speed_mps;
        let free = 1.0 - speed_ratio * speed_ratio * speed_ratio * speed_ratio;
        let closeness = leader.map_or(0.0, |(clearance_m, leader_mps)| {
            let root = (self.max_accel_mps2 * self.comfort_brake_mps2).sqrt();
            let dynamic_m =
                speed_mps * self.time_gap_s + speed_mps * (speed_mps - leader_mps) / (2.0 * root);
            let wanted_m = self.min_gap_m + dynamic_m.max(0.0);
            // Bumpers that nearly touch ask for full braking, and not for infinity.
            let ratio = wanted_m / clearance_m.max(0.01);
            ratio * ratio
        });
        let wish_mps2 = self.max_accel_mps2 * (free - closeness);
        wish_mps2.clamp(-self.max_brake_mps2, self.max_accel_mps2)
    }
}

car_following!(Idm);
