//! Krauss' car-following model without dawdling (Krauss 1998), as in SUMO.
//!
//! The safe speed is −b τ + √(b² τ² + v_l² + 2 b s).
//!
//! From it the car can stop behind its leader if both brake with b. It drives
//! at the least of that speed, its desired speed and the speed it can reach.
//!
//! The steps of the published model last τ and end at that speed. A controller
//! that runs every sample and spread the change over τ would oscillate (damping
//! ½) and hit standing vehicles. With a quarter of τ it is critically damped.

use super::following::{away_mps, car_following};
use super::parameters::parameters;

/// Share of τ in which it adopts its safe speed.
const SETTLES: f64 = 0.25;

parameters! {
    /// A follower at the safe speed.
    pub struct Krauss {
        /// Speed it drives at on a free road, m/s.
        desired_speed_mps, at_least 0.1;
        /// Reaction time τ, s.
        reaction_s, at_least 0.05;
        /// Greatest acceleration, m/s².
        max_accel_mps2, at_least 0.01;
        /// Braking in its plans for both cars, b, m/s².
        plan_brake_mps2, at_least 0.01;
        /// Clearance at standstill, m.
        min_gap_m, at_least 0.0;
        /// Hardest commanded braking, m/s².
        max_brake_mps2, at_least 0.0;
    }
}

impl Krauss {
    /// Returns the model's acceleration for a leader's clearance and speed.
    pub fn accel_mps2(&self, speed_mps: f64, leader: Option<(f64, f64)>) -> f64 {
        let safe_mps = leader.map_or(f64::INFINITY, |(clearance_m, leader_mps)| {
            let step_mps = self.plan_brake_mps2 * self.reaction_s;
            // Without room the root would be that of a negative number.
            let room_m = (clearance_m - self.min_gap_m).max(0.0);
            let away_mps = away_mps(leader_mps);
            let squares = step_mps * step_mps + away_mps * away_mps;
            (squares + 2.0 * self.plan_brake_mps2 * room_m).sqrt() - step_mps
        });
        // Paper: steps of τ; here: a quarter of τ, because a sampled controller
        // would oscillate (see the module's documentation).
        let within_s = SETTLES * self.reaction_s;
        let wish_mps2 = (safe_mps.min(self.desired_speed_mps) - speed_mps) / within_s;
        wish_mps2.clamp(-self.max_brake_mps2, self.max_accel_mps2)
    }
}

car_following!(Krauss);

#[cfg(test)]
mod tests {
    use super::*;

    const KRAUSS: Krauss = Krauss {
        desired_speed_mps: 30.0,
        reaction_s: 1.0,
        max_accel_mps2: 2.0,
        plan_brake_mps2: 4.5,
        min_gap_m: 2.0,
        max_brake_mps2: 6.0,
    };

    #[test]
    fn behind_an_equally_fast_leader_it_settles_at_what_it_drives_in_its_reaction_time() {
        // v = v_safe where 2 b τ v = 2 b (s − s₀): s = 2 + 20 m.
        assert!(KRAUSS.accel_mps2(20.0, Some((22.0, 20.0))).abs() < 1e-12);
        assert!(KRAUSS.accel_mps2(20.0, Some((15.0, 20.0))) < -0.5);
    }

    #[test]
    fn alone_it_reaches_its_speed_and_no_more() {
        assert_eq!(KRAUSS.accel_mps2(30.0, None), 0.0);
        assert_eq!(KRAUSS.accel_mps2(10.0, None), 2.0);
        assert_eq!(KRAUSS.accel_mps2(20.0, Some((2.0, 0.0))), -6.0);
    }
}
