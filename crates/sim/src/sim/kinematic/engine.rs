//! Motion models of this plant: one file per kind of body, listed here.

use super::bicycle::Bicycle;
use super::kinematic_playback::PlaybackPose;
use super::legs::Legs;
use super::path::{Anchor, AnchorMotion, BodyPath, PathKind};
use super::wheels::Wheels;
use crate::sim::{Body, BodyCommand, BodyKind, Ground, Push};

/// Motion model of a body, with its current command.
#[derive(Clone, Debug)]
pub(super) enum Engine {
    Wheels(Wheels),
    Bicycle(Bicycle),
    Legs(Legs),
    /// Motion along a recording or a plan.
    Rails(PlaybackPose),
}

impl Engine {
    /// Creates the model of a body spawned with a velocity in the world frame.
    pub(super) fn new(body: &Body, ground: Ground, velocity_mps: (f64, f64)) -> Engine {
        match &body.kind {
            BodyKind::Vehicle(vehicle) => Engine::Wheels(Wheels::new(body, vehicle, ground)),
            BodyKind::Cyclist(cyclist) => Engine::Bicycle(Bicycle::new(body, cyclist, ground)),
            BodyKind::Walker(walker) => Engine::Legs(Legs::new(walker, velocity_mps)),
        }
    }

    /// Returns the fixed point of the model and the initial walking velocity.
    ///
    /// The fixed point is measured ahead of the centre of the body.
    pub(super) fn anchor(&self) -> (f64, (f64, f64)) {
        match self {
            Engine::Wheels(wheels) => (wheels.rear_axle_ahead_m(), (0.0, 0.0)),
            Engine::Bicycle(bicycle) => (bicycle.rear_axle_ahead_m(), (0.0, 0.0)),
            Engine::Legs(legs) => (0.0, legs.target_mps()),
            // Invariant: no body is spawned on rails.
            Engine::Rails(_) => (0.0, (0.0, 0.0)),
        }
    }

    /// Returns the speed at which the body starts when it is spawned at a speed.
    pub(super) fn starting_mps(&self, speed_mps: f64) -> f64 {
        match self {
            Engine::Bicycle(bicycle) => bicycle.within_limit(speed_mps),
            // Legs keep a velocity of their own, within their limit.
            _ => speed_mps,
        }
    }

    /// Sets the command, or returns false if this kind of body refuses it.
    pub(super) fn command(&mut self, command: BodyCommand) -> bool {
        match self {
            Engine::Wheels(wheels) => wheels.command(command),
            Engine::Bicycle(bicycle) => bicycle.command(command),
            Engine::Legs(legs) => legs.command(command),
            // A carried body accepts no drive or walk command, which makes the plant
            // unsound.
            Engine::Rails(_) => false,
        }
    }

    /// Changes the ground under the body.
    pub(super) fn set_ground(&mut self, ground: Ground) {
        match self {
            Engine::Wheels(wheels) => wheels.set_ground(ground),
            Engine::Bicycle(bicycle) => bicycle.set_ground(ground),
            // Feet and carried bodies have the same limits on any ground.
            Engine::Legs(_) | Engine::Rails(_) => {}
        }
    }

    /// Changes the external acceleration of the body.
    pub(super) fn set_push(&mut self, push: Push) {
        match self {
            Engine::Wheels(wheels) => wheels.set_push(push),
            Engine::Bicycle(bicycle) => bicycle.set_push(push),
            // People on foot stand firm, and carried bodies go where they are
            // commanded.
            Engine::Legs(_) | Engine::Rails(_) => {}
        }
    }

    /// Returns the path from `start` for the next `dt_s`.
    ///
    /// No point of the body is farther than `arm_m` from the fixed point.
    #[inline]
    pub(super) fn path(&self, start: Anchor, arm_m: f64, dt_s: f64) -> BodyPath {
        match self {
            Engine::Wheels(wheels) => wheels.path(start, arm_m, dt_s),
            Engine::Bicycle(bicycle) => bicycle.path(start, arm_m, dt_s),
            Engine::Legs(legs) => legs.path(start),
            Engine::Rails(rails) => rails.path(start, arm_m, dt_s),
        }
    }

    /// Returns the motion of the fixed point.
    #[inline]
    pub(super) fn motion(&self, at: &Anchor) -> AnchorMotion {
        match self {
            Engine::Wheels(_) | Engine::Bicycle(_) => Wheels::motion(at),
            Engine::Legs(_) => Legs::motion(at),
            Engine::Rails(_) => PlaybackPose::motion(at),
        }
    }
}

impl BodyPath {
    /// Returns the state of the fixed point after a time.
    #[inline]
    pub(super) fn at(&self, after_s: f64) -> Anchor {
        match self.kind {
            PathKind::Arc(drive) => Wheels::after(self.start, drive, after_s),
            PathKind::Ride(step) => Bicycle::after(self.start, &step, after_s),
            PathKind::Ramp(ramp) => Legs::after(self.start, ramp, after_s),
            PathKind::Even => PlaybackPose::after(self.start, after_s),
        }
    }
}
