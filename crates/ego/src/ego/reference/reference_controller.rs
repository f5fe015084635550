//! Reference drivers as controllers that read percepts and keep their lane.

use nalgebra::{UnitComplex, Vector2};

use super::{DriverModel, LaneBody, Reflexes, Response};
use crate::ego::{Briefing, Command, Controller, Fault, Own, Percept, Seen};
use crate::pose::rotation_by;

/// Hardest acceleration on the return to the nominal speed.
pub const NOMINAL_MPS2: f64 = 1.0;

/// A reference driver of the ego, whose nominal speed is its initial speed.
#[derive(Clone, Debug)]
pub struct ReferenceController<M> {
    model: M,
    lane_width_m: f64,
    driver: Option<Reflexes<M>>,
    nominal_mps: f64,
    /// Names of all agents perceived so far.
    ///
    /// The agent that the driver brakes for keeps its place while other agents
    /// are hidden.
    names: Vec<String>,
    /// All other agents of the current percept, in the order of the names.
    others: Vec<LaneBody>,
}

impl<M> ReferenceController<M> {
    pub(super) fn new(model: M) -> ReferenceController<M> {
        ReferenceController {
            model,
            lane_width_m: 0.0,
            driver: None,
            nominal_mps: 0.0,
            names: Vec::new(),
            others: Vec::new(),
        }
    }

    /// Stores perceived agents in their places and marks the rest as unseen.
    fn look(&mut self, percept: &Percept) {
        // Before the visible ones, so that an agent that is hidden now is not
        // remembered in place.
        self.others.fill(LaneBody::unseen());
        for (at, seen) in percept.others.iter().enumerate() {
            // Usually no agent is hidden, and the places do not change.
            let is_here = self.names.get(at) == Some(&seen.name);
            let place = if is_here {
                Some(at)
            } else {
                self.names.iter().position(|name| *name == seen.name)
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
    /// Returns a hidden agent: far behind, where no driver looks.
    pub fn unseen() -> LaneBody {
        LaneBody {
            x_m: f64::NEG_INFINITY,
            ..LaneBody::default()
        }
    }

    /// Returns a body from its front in lane coordinates.
    ///
    /// Velocity and heading are relative to the lane.
    pub fn behind_front(
        front_m: Vector2<f64>,
        velocity_mps: Vector2<f64>,
        heading: UnitComplex<f64>,
        length_m: f64,
        width_m: f64,
    ) -> LaneBody {
        LaneBody {
            x_m: front_m.x - 0.5 * length_m * heading.re,
            y_m: front_m.y - 0.5 * length_m * heading.im,
            speed_mps: velocity_mps.x,
            lateral_mps: velocity_mps.y,
            accel_mps2: 0.0,
            length_m,
            width_m,
        }
    }

    /// Returns the ego with its front at the origin.
    fn of_own(own: &Own) -> LaneBody {
        let heading = rotation_by(own.heading_rad);
        // Turning moves the front sideways, and not the middle.
        let lateral_mps = own.lateral_mps - 0.5 * own.length_m * own.yaw_rate_rad_per_s;
        // The own velocity is along the car, and models need it along the
        // lane.
        let velocity_mps = heading * Vector2::new(own.speed_mps, lateral_mps);
        let front_m = Vector2::zeros();
        LaneBody::behind_front(front_m, velocity_mps, heading, own.length_m, own.width_m)
    }

    /// Returns an agent from the front in its percept.
    fn of_seen(seen: &Seen) -> LaneBody {
        let heading = rotation_by(seen.road_heading_rad);
        // Turning moves the front sideways, so this share of its velocity is
        // removed.
        let lever_mps = 0.5 * seen.length_m * seen.yaw_rate_rad_per_s;
        let velocity_mps = Vector2::new(
            seen.speed_mps + lever_mps * heading.im,
            seen.lateral_mps - lever_mps * heading.re,
        );
        let front_m = Vector2::new(seen.headway_m, seen.lateral_m);
        let (length_m, width_m) = (seen.length_m, seen.width_m);
        LaneBody {
            accel_mps2: seen.ax_mps2,
            ..LaneBody::behind_front(front_m, velocity_mps, heading, length_m, width_m)
        }
    }
}

impl<M: DriverModel + Clone + 'static> Controller for ReferenceController<M> {
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
        // The driver is created with the first percept, which has the sample
        // time and the nominal speed.
        let driver = self.driver.get_or_insert_with(|| {
            self.nominal_mps = own.speed_mps;
            Reflexes::new(self.model.clone(), percept.sample_s, self.lane_width_m)
        });
        Ok(Command::accelerate(
            match driver.step(&LaneBody::of_own(own), &self.others) {
                Response::Nominal => {
                    // The acceleration that reaches the nominal speed within
                    // this sample.
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
