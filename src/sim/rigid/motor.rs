//! What moves the bodies of this plant: a file for each kind of body, and its
//! line here.

use super::car::Car;
use super::foot::Foot;
use super::world::World;
use crate::sim::planar::Rect;
use crate::sim::{Body, BodyCommand, BodyKind, Ground, Placement};

/// What moves a body, and what it is asked to do.
pub(super) trait Motor: Send {
    /// Takes a command; whether it is one for this kind of body.
    fn command(&mut self, command: BodyCommand) -> bool;
    /// An `advance` of so many seconds begins.
    fn begin(&mut self, _dt_s: f64) {}
    /// Whether it is carried already.
    fn is_carried(&self) -> bool {
        false
    }
    /// Takes what it has in the world out of it.
    fn leave(&mut self, _world: &mut World) {}
    /// Acts for one step, before the world takes its own; `rect` is where the
    /// body is and how it moves.
    fn act(&mut self, world: &mut World, rect: &Rect, dt_s: f64);
    /// Takes note of the world's step.
    fn settle(&mut self, _world: &World, _dt_s: f64) {}
    /// Goes back to a share of the last step.
    fn rewind(&mut self, world: &mut World, share: f64);
    /// The footprint now.
    fn rect(&self, world: &World) -> Rect;
    /// Centre and orientation of the bounding box.
    fn placement(&self, world: &World, height_m: f64) -> Placement;
    /// A copy that continues bit for bit.
    fn fork(&self) -> Box<dyn Motor>;
}

impl Clone for Box<dyn Motor> {
    fn clone(&self) -> Box<dyn Motor> {
        self.fork()
    }
}

/// Puts a body into the world with what moves it.
pub(super) fn motor(world: &mut World, body: &Body, ground: Ground, rect: &Rect) -> Box<dyn Motor> {
    match &body.kind {
        BodyKind::Vehicle(vehicle) => Box::new(Car::new(world, body, vehicle, ground, rect)),
        BodyKind::Walker(walker) => Box::new(Foot::new(walker, rect)),
    }
}
