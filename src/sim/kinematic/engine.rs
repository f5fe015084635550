//! What moves the bodies of this plant: a file for each kind of body, and its
//! line in each function here.

use super::legs::Legs;
use super::path::{Anchor, Path, PathKind};
use super::rails::Rails;
use super::wheels::Wheels;
use crate::sim::{Body, BodyCommand, BodyKind, Ground};

/// What moves a body, and what it is asked to do.
#[derive(Clone, Debug)]
pub(super) enum Engine {
    Wheels(Wheels),
    Legs(Legs),
    /// Carried along a recorded motion.
    Rails(Rails),
}

impl Engine {
    /// What moves a body that is spawned with a velocity in the world frame.
    pub fn new(body: &Body, ground: Ground, velocity_mps: (f64, f64)) -> Engine {
        match &body.kind {
            BodyKind::Vehicle(vehicle) => Engine::Wheels(Wheels::new(body, vehicle, ground)),
            BodyKind::Walker(walker) => Engine::Legs(Legs::new(walker, velocity_mps)),
        }
    }

    /// The fixed point of its motion model, ahead of the centre of the body, and
    /// the velocity with which it walks at first.
    pub fn anchor(&self) -> (f64, (f64, f64)) {
        match self {
            Engine::Wheels(wheels) => (wheels.rear_axle_ahead_m(), (0.0, 0.0)),
            Engine::Legs(legs) => (0.0, legs.target_mps()),
            // Invariant: nobody is spawned on rails.
            Engine::Rails(_) => (0.0, (0.0, 0.0)),
        }
    }

    /// Takes a command; whether it is one for this kind of body.
    pub fn command(&mut self, command: BodyCommand) -> bool {
        match self {
            Engine::Wheels(wheels) => wheels.command(command),
            Engine::Legs(legs) => legs.command(command),
            Engine::Rails(_) => false,
        }
    }

    /// How it goes on from `start`; no point of the body is farther than `arm_m`
    /// from there.
    pub fn path(&self, start: Anchor, arm_m: f64, dt_s: f64) -> Path {
        match self {
            Engine::Wheels(wheels) => wheels.path(start, arm_m, dt_s),
            Engine::Legs(legs) => legs.path(start),
            Engine::Rails(rails) => rails.path(start, arm_m, dt_s),
        }
    }

    /// Speed along the heading, speed to the left, and yaw rate.
    pub fn motion(&self, at: &Anchor) -> (f64, f64, f64) {
        match self {
            Engine::Wheels(_) => Wheels::motion(at),
            Engine::Legs(_) => Legs::motion(at),
            Engine::Rails(_) => Rails::motion(at),
        }
    }
}

impl Path {
    /// Where the fixed point is after a time.
    pub fn at(&self, after_s: f64) -> Anchor {
        match self.kind {
            PathKind::Arc(drive) => Wheels::after(self.start, drive, after_s),
            PathKind::Ramp(ramp) => Legs::after(self.start, ramp, after_s),
            PathKind::Even => Rails::after(self.start, after_s),
        }
    }
}
