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
    /// Everybody whom it has ever seen, by name: whom it brakes for keeps its
    /// place among them while others are hidden.
    names: Vec<String>,
    /// The others of the present percept, in the order of the names.
    others: Vec<LaneBody>,
}

impl<M> AtTheWheel<M> {
    pub(super) fn new(model: M) -> AtTheWheel<M> {
        AtTheWheel {
            model,
            lane_width_m: 0.0,
            driver: None,
            nominal_mps: 0.0,
            names: Vec::new(),
            others: Vec::new(),
        }
    }

    /// Puts everybody who is seen in their places, and the others nowhere.
    fn look(&mut self, percept: &Percept) {
        self.others.fill(LaneBody::unseen());
        for (at, seen) in percept.others.iter().enumerate() {
            // Most of the time nobody is hidden, and places do not change.
            let is_here = self.names.get(at) == Some(&seen.name);
            let place = match is_here {
                true => Some(at),
                false => self.names.iter().position(|name| *name == seen.name),
            };
            let body = LaneBody::of_seen(seen);
            match place {
                Some(place) => self.others[place] = body,
                None => {
                    self.names.push(seen.name.clone());
                    self.others.push(body);
                }
            }
        }
    }
}

impl LaneBody {
    /// Somebody who is hidden: far behind, where no driver looks.
    pub(crate) fn unseen() -> LaneBody {
        LaneBody {
            x_m: f64::NEG_INFINITY,
            ..LaneBody::default()
        }
    }

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
        let size = (own.length_m, own.width_m);
        // Turning moves the front sideways, not the middle.
        let lateral_mps = own.lateral_mps - 0.5 * own.length_m * own.yaw_rate_rad_per_s;
        let velocity = (
            own.speed_mps * cos - lateral_mps * sin,
            own.speed_mps * sin + lateral_mps * cos,
        );
        LaneBody::behind_front((0.0, 0.0), velocity, (sin, cos), size)
    }

    /// Somebody else, as a percept shows its front.
    fn of_seen(seen: &Seen) -> LaneBody {
        let (sin, cos) = libm::sincos(seen.road_heading_rad);
        let lever_mps = 0.5 * seen.length_m * seen.yaw_rate_rad_per_s;
        let velocity = (
            seen.speed_mps + lever_mps * sin,
            seen.lateral_mps - lever_mps * cos,
        );
        let front = (seen.headway_m, seen.lateral_m);
        let size = (seen.length_m, seen.width_m);
        LaneBody {
            accel_mps2: seen.ax_mps2,
            ..LaneBody::behind_front(front, velocity, (sin, cos), size)
        }
    }
}

impl<M: DriverModel + Clone + 'static> Controller for AtTheWheel<M> {
    fn brief(&mut self, briefing: &Briefing) {
        self.lane_width_m = briefing.road.lane_width_m;
    }

    fn reset(&mut self, _seed: u64) {
        self.driver = None;
        self.names.clear();
        self.others.clear();
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        self.look(percept);
        let own = &percept.own;
        let driver = self.driver.get_or_insert_with(|| {
            self.nominal_mps = own.speed_mps;
            Reflexes::new(self.model.clone(), percept.sample_s, self.lane_width_m)
        });
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
