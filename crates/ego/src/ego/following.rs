//! Car-following models: acceleration from the own speed and the leader alone.

/// Implements `Controller` for a car-following model.
///
/// The model needs `accel_mps2(speed_mps, leader)`, with the clearance and the
/// speed of the leader.
macro_rules! car_following {
    ($model:ty) => {
        impl $crate::ego::Controller for $model {
            fn reset(&mut self, _seed: u64) {}

            fn control(
                &mut self,
                percept: &$crate::ego::Percept,
            ) -> Result<$crate::ego::Command, $crate::ego::Fault> {
                let leader = percept
                    .leader()
                    .map(|lead| (lead.clearance_m(), lead.speed_mps));
                let accel_mps2 = self.accel_mps2(percept.own.speed_mps, leader);
                Ok($crate::ego::Command::accelerate(accel_mps2))
            }

            fn fork(&self) -> Option<Box<dyn $crate::ego::Controller>> {
                Some(Box::new(self.clone()))
            }
        }
    };
}

pub(super) use car_following;

/// Largest speed at which a settling car rolls back. Faster cars are oncoming.
const ROLLS_BACK_MPS: f64 = 1.0;

/// Returns the leader's speed as far as it leads away from the ego.
///
/// An oncoming leader leaves no additional room by braking.
pub(super) fn away_mps(leader_mps: f64) -> f64 {
    if leader_mps < -ROLLS_BACK_MPS {
        0.0
    } else {
        leader_mps
    }
}

#[cfg(test)]
mod tests {
    use crate::ego::{Fvdm, Gipps, Idm, Krauss};

    /// Returns the least clearance of a follower that approaches a standing leader.
    fn least_m(model: impl Fn(f64, f64) -> f64, speed_mps: f64, clearance_m: f64) -> f64 {
        const DT_S: f64 = 0.05;
        const LAG_S: f64 = 0.2;
        let (mut speed, mut clearance, mut accel) = (speed_mps, clearance_m, 0.0);
        let mut least = clearance;
        for _ in 0..2000 {
            accel += (model(speed, clearance) - accel) * DT_S / LAG_S;
            speed = (speed + accel * DT_S).max(0.0);
            clearance -= speed * DT_S;
            least = least.min(clearance);
        }
        least
    }

    #[test]
    fn followers_stop_before_whoever_stands() {
        // Parameters of the models' own papers, or of SUMO.
        let idm = Idm {
            desired_speed_mps: 30.0,
            time_gap_s: 1.5,
            min_gap_m: 2.0,
            max_accel_mps2: 1.4,
            comfort_brake_mps2: 2.0,
            max_brake_mps2: 8.0,
        };
        let gipps = Gipps {
            desired_speed_mps: 30.0,
            reaction_s: 0.8,
            max_accel_mps2: 1.7,
            plan_brake_mps2: 3.4,
            leader_brake_mps2: 3.2,
            min_gap_m: 2.0,
            max_brake_mps2: 8.0,
        };
        let fvdm = Fvdm {
            desired_speed_mps: 30.0,
            transition_m: 15.0,
            form: 1.5,
            sensitivity_per_s: 0.5,
            closing_gain_per_s: 0.6,
            min_gap_m: 2.0,
            max_accel_mps2: 2.0,
            max_brake_mps2: 8.0,
        };
        let krauss = Krauss {
            desired_speed_mps: 30.0,
            reaction_s: 1.0,
            max_accel_mps2: 2.6,
            plan_brake_mps2: 4.5,
            min_gap_m: 2.5,
            max_brake_mps2: 9.0,
        };
        for speed in [5.0, 10.0, 16.67, 25.0] {
            // Three seconds away, plus the distance of full braking.
            let clearance = 3.0 * speed + speed * speed / 16.0;
            let standing = |gap: f64| Some((gap, 0.0));
            for (name, least) in [
                (
                    "Idm",
                    least_m(|v, gap| idm.accel_mps2(v, standing(gap)), speed, clearance),
                ),
                (
                    "Gipps",
                    least_m(
                        |v, gap| gipps.accel_mps2(v, standing(gap)),
                        speed,
                        clearance,
                    ),
                ),
                (
                    "Fvdm",
                    least_m(|v, gap| fvdm.accel_mps2(v, standing(gap)), speed, clearance),
                ),
                (
                    "Krauss",
                    least_m(
                        |v, gap| krauss.accel_mps2(v, standing(gap)),
                        speed,
                        clearance,
                    ),
                ),
            ] {
                assert!(least > 0.5, "{name} from {speed} m/s: {least} m");
            }
        }
    }
}
