//! Car-following models: an acceleration from the own speed and the leader alone.

/// Makes a model with `accel_mps2(speed_mps, leader)`, the leader as its clearance
/// and its speed, a controller.
macro_rules! car_following {
    ($model:ty) => {
        impl $crate::ego::Controller for $model {
            fn reset(&mut self, _seed: u64) {}

            fn control(
                &mut self,
                percept: &$crate::ego::Percept,
            ) -> Result<$crate::ego::Command, $crate::ego::Fault> {
                let leader = percept.leader();
                let leader = leader.map(|lead| (lead.clearance_m(), lead.speed_mps));
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

/// No car rolls back faster while it settles: who does comes towards the ego.
const ROLLS_BACK_MPS: f64 = 1.0;

/// A leader's speed as far as it carries it away from the ego before it stands:
/// an oncoming one leaves no room by braking.
pub(super) fn away_mps(leader_mps: f64) -> f64 {
    match leader_mps < -ROLLS_BACK_MPS {
        true => 0.0,
        false => leader_mps,
    }
}
