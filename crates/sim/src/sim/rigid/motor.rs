//! Motion model of a body on this plant, one file per kind of body.

use super::world::{ChassisId, RapierWorld};
use parry3d_f64::math::Pose;

use crate::sim::planar::Rect;
use crate::sim::{BodyCommand, Ground, Placement, Push};

/// Footprint of a body with its motion.
#[derive(Clone, Copy)]
pub(super) struct Stance {
    pub rect: Rect,
    /// Pose of the body's frame, on a surface only.
    pub pose: Option<Pose>,
}

/// Motion model of a body, with its current command.
pub(super) trait Motor: Send {
    /// Sets the command, or returns false if this kind of body refuses it.
    fn command(&mut self, command: BodyCommand) -> bool;
    /// Begins an `advance` of `dt_s` seconds.
    fn begin(&mut self, _dt_s: f64) {}
    /// Changes the ground under the body.
    fn set_ground(&mut self, _ground: Ground) {}
    /// Changes the external acceleration of the body.
    fn set_push(&mut self, _push: Push) {}
    /// Returns true if the body is already carried.
    fn is_carried(&self) -> bool {
        false
    }
    /// Moves the body's part of the world to a common origin and returns it.
    ///
    /// `None` if the world holds nothing of this body.
    fn join(&mut self, _world: &mut RapierWorld, _origin_m: (f64, f64)) -> Option<ChassisId> {
        None
    }
    /// Lets go of the controls, after a collision.
    fn release(&mut self, _world: &mut RapierWorld) {}
    /// Removes the body's parts from the world.
    fn leave(&mut self, _world: &mut RapierWorld) {}
    /// Acts for one step, before the world's step.
    ///
    /// `rect` is the current footprint with its motion.
    fn act(&mut self, world: &mut RapierWorld, rect: &Rect, dt_s: f64);
    /// Reads the result of the world's step.
    fn settle(&mut self, _world: &mut RapierWorld, _dt_s: f64) {}
    /// Moves back to a share of the last step.
    fn rewind(&mut self, world: &mut RapierWorld, share: f64);
    /// Returns the current footprint.
    fn rect(&self, world: &RapierWorld) -> Rect;
    /// Returns the pose of the body's frame on a surface.
    fn pose(&self, world: &RapierWorld, rect: &Rect) -> Pose;
    /// Returns the centre and orientation of the bounding box.
    fn placement(&self, world: &RapierWorld, height_m: f64) -> Placement;
    /// Returns the wheels of rapier, if the body has some.
    #[cfg(test)]
    fn wheels(&self) -> &[rapier3d::control::Wheel] {
        &[]
    }
    /// Returns a copy that continues bit for bit.
    fn fork(&self) -> Box<dyn Motor>;
}

impl Clone for Box<dyn Motor> {
    fn clone(&self) -> Box<dyn Motor> {
        self.fork()
    }
}
