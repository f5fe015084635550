//! Gipps' car-following model (Gipps 1981).
//!
//! The speed after a reaction time τ is the lesser of two speeds.
//!
//! On a free road the car reaches v + 2.5 a τ (1 − v/V) √(0.025 + v/V).
//!
//! If its leader brakes with b̂, the car can still stop behind it from
//! −b τ + √(b² τ² + b (2 (s − s₀) − v τ + v_l²/b̂)).

use super::following::{away_mps, car_following};
use super::parameters::parameters;

parameters! {
    /// A follower that can always stop in time if its leader brakes as expected.
    pub struct Gipps {
        /// Speed it drives at on a free road, V, m/s.
        desired_speed_mps, at_least 0.1;
        /// Reaction time τ, s.
        reaction_s, at_least 0.05;
        /// Greatest acceleration a, m/s².
        max_accel_mps2, at_least 0.01;
        /// Hardest braking in its plans, b, m/s².
        plan_brake_mps2, at_least 0.01;
        /// Hardest expected braking of its leader, b̂, m/s².
        leader_brake_mps2, at_least 0.01;
        /// Clearance at standstill s₀, m.
        min_gap_m, at_least 0.0;
        /// Hardest commanded braking, m/s².
        max_brake_mps2, at_least 0.0;
    }
}

impl Gipps {
    /// Returns the model's acceleration for a leader's clearance and speed.
    pub fn accel_mps2(&self, speed_mps: f64, leader: Option<(f64, f64)>) -> f64 {
        let (tau_s, brake_mps2) = (self.reaction_s, self.plan_brake_mps2);
        let share = speed_mps / self.desired_speed_mps;
        // The root of a negative share, when rolling back, would be NaN.
        let root = (0.025 + share.max(0.0)).sqrt();
        let free_mps = speed_mps + 2.5 * self.max_accel_mps2 * tau_s * (1.0 - share) * root;
        let safe_mps = leader.map_or(f64::INFINITY, |(clearance_m, leader_mps)| {
            let away_mps = away_mps(leader_mps);
            let stops_m = away_mps * away_mps / self.leader_brake_mps2;
            let room_m = 2.0 * (clearance_m - self.min_gap_m) - speed_mps * tau_s + stops_m;
            let step_mps = brake_mps2 * tau_s;
            // Without room it stops at once.
            (step_mps * step_mps + brake_mps2 * room_m).max(0.0).sqrt() - step_mps
        });
        // The published model has steps of τ. Here the speed change is spread
        // over τ, because a command holds for a sample only.
        let wish_mps2 = (free_mps.min(safe_mps).max(0.0) - speed_mps) / tau_s;
        wish_mps2.clamp(-self.max_brake_mps2, self.max_accel_mps2)
    }
}

car_following!(Gipps);

#[cfg(test)]
mod tests {
    use super::*;

    const GIPPS: Gipps = Gipps {
        desired_speed_mps: 30.0,
        reaction_s: 1.0,
        max_accel_mps2: 2.0,
        plan_brake_mps2: 3.0,
        leader_brake_mps2: 3.0,
        min_gap_m: 2.0,
        max_brake_mps2: 6.0,
    };

    #[test]
    fn behind_an_equally_fast_leader_it_settles_where_it_could_stop() {
        // Equal speeds and brakes: 2 (s − s₀) = 3 v τ, so s = 2 + 1.5 · 20 = 32 m.
        assert!(GIPPS.accel_mps2(20.0, Some((32.0, 20.0))).abs() < 1e-12);
        assert!(GIPPS.accel_mps2(20.0, Some((25.0, 20.0))) < -0.5);
    }

    #[test]
    fn alone_it_reaches_its_speed_and_no_more() {
        assert_eq!(GIPPS.accel_mps2(30.0, None), 0.0);
        assert!(GIPPS.accel_mps2(10.0, None) > 0.0);
        assert_eq!(GIPPS.accel_mps2(20.0, Some((0.0, 0.0))), -6.0);
    }
}
