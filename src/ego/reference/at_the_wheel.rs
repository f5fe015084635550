//! A reference driver as a controller: it reads percepts and keeps its lane.

use super::{DriverModel, LaneBody, Reflexes, Response};
use crate::ego::{Briefing, Command, Controller, Fault, Own, Percept, Seen};

/// Hardest change of speed on the way back to the nominal one.
pub(crate) const NOMINAL_MPS2: f64 = 1.0;

/// A driver of the ego; its nominal speed is the initial one.
#[derive(Clone, Debug)]
pub struct AtTheWheel<M> {
    model: M,
    lane_width_m: f64,
    driver: Option<Reflexes<M>>,
    nominal_mps: f64,
    /// The others of the present percept, kept to save the allocation.
    others: Vec<LaneBody>,
}

impl<M> AtTheWheel<M> {
    pub(super) fn new(model: M) -> AtTheWheel<M> {
        AtTheWheel {
            model,
            lane_width_m: 0.0,
            driver: None,
            nominal_mps: 0.0,
            others: Vec::new(),
        }
    }
}

impl LaneBody {
    /// A body by its front: where that is in lane coordinates, how it moves
    /// along and across the lane, and the sine and cosine of its heading there.
    pub fn behind_front(
        (front_x_m, front_y_m): (f64, f64),
        (speed_mps, lateral_mps): (f64, f64),
        (sin, cos): (f64, f64),
        (length_m, width_m): (f64, f64),
    ) -> LaneBody {
        LaneBody {
            x_m: front_x_m - 0.5 * length_m * cos,
            y_m: front_y_m - 0.5 * length_m * sin,
            speed_mps,
            lateral_mps,
            accel_mps2: 0.0,
            length_m,
            width_m,
        }
    }

    /// The ego, with its front at the origin.
    fn of_own(own: &Own) -> LaneBody {
        let (sin, cos) = libm::sincos(own.heading_rad);
        let velocity = (own.speed_mps * cos, own.speed_mps * sin);
        let size = (own.length_m, own.width_m);
        LaneBody::behind_front((0.0, 0.0), velocity, (sin, cos), size)
    }

    /// Somebody else, whose heading on the road is that of its velocity.
    fn of_seen(seen: &Seen) -> LaneBody {
        let velocity = (seen.speed_mps, seen.lateral_mps);
        let over_ground_mps = libm::hypot(velocity.0, velocity.1);
        // Who hardly moves has no direction to speak of, and no lateral motion.
        let direction = match over_ground_mps < 1.0 {
            true => (0.0, 1.0),
            false => (velocity.1 / over_ground_mps, velocity.0 / over_ground_mps),
        };
        let front = (seen.headway_m, seen.lateral_m);
        let size = (seen.length_m, seen.width_m);
        LaneBody {
            accel_mps2: seen.ax_mps2,
            ..LaneBody::behind_front(front, velocity, direction, size)
        }
    }
}

impl<M: DriverModel + Clone + 'static> Controller for AtTheWheel<M> {
    fn brief(&mut self, briefing: &Briefing) {
        self.lane_width_m = briefing.road.lane_width_m;
    }

    fn reset(&mut self, _seed: u64) {
        self.driver = None;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let own = &percept.own;
        let driver = self.driver.get_or_insert_with(|| {
            self.nominal_mps = own.speed_mps;
            Reflexes::new(self.model.clone(), percept.sample_s, self.lane_width_m)
        });
        self.others.clear();
        self.others
            .extend(percept.others.iter().map(LaneBody::of_seen));
        Ok(Command::accelerate(
            match driver.step(&LaneBody::of_own(own), &self.others) {
                Response::Nominal => {
                    let wish_mps2 = (self.nominal_mps - own.speed_mps) / percept.sample_s;
                    wish_mps2.clamp(-NOMINAL_MPS2, NOMINAL_MPS2)
                }
                Response::Hold => 0.0,
                Response::Brake(brake_mps2) => -brake_mps2,
            },
        ))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
