//! Walkers, cyclists and carried bodies once bodies collide, as rigid bodies.

use parry3d_f64::math::Pose;
use rapier3d::math::Vector;

use super::chassis_motion::ComOffset;
use super::motor::Motor;
use super::shape::CollisionShape;
use super::world::{ChassisId, RapierWorld};
use crate::sim::planar::Rect;
use crate::sim::{Body, BodyCommand, Placement};

/// Rigid body without wheels.
///
/// Until it collides it keeps its velocity and heading and stays upright. Then it
/// is free.
#[derive(Clone)]
pub(super) struct LooseBody {
    id: ChassisId,
    origin_m: (f64, f64),
    com: ComOffset,
    /// Velocity to keep, `None` once it collided.
    held: Option<Rect>,
}

impl LooseBody {
    /// Puts a body into the world with its motion.
    pub(super) fn new(
        world: &mut RapierWorld,
        body: &Body,
        shape: &CollisionShape,
        rect: &Rect,
        origin_m: (f64, f64),
    ) -> LooseBody {
        let id = world.insert_at(body, shape, rect, origin_m);
        world.hold_upright(id, true);
        LooseBody {
            id,
            origin_m,
            com: ComOffset::of(body),
            held: Some(Rect {
                // A turn would leave the direction of a constant velocity.
                yaw_rate_rad_per_s: 0.0,
                ..*rect
            }),
        }
    }

    /// Returns the body in the world.
    pub(super) fn id(&self) -> ChassisId {
        self.id
    }
}

impl Motor for LooseBody {
    /// Accepts every command and follows none.
    fn command(&mut self, _: BodyCommand) -> bool {
        // A refused command would make the plant unsound.
        true
    }

    fn is_carried(&self) -> bool {
        true
    }

    fn join(&mut self, _: &mut RapierWorld, _: (f64, f64)) -> Option<ChassisId> {
        Some(self.id)
    }

    fn release(&mut self, world: &mut RapierWorld) {
        // A second collision must not unlock the axes again.
        if self.held.take().is_none() {
            return;
        }
        world.hold_upright(self.id, false);
    }

    fn act(&mut self, world: &mut RapierWorld, _: &Rect, _: f64) {
        if let Some(held) = &self.held {
            world.move_at(self.id, held);
        }
    }

    /// Never called: a plant whose bodies collide does not move back.
    fn rewind(&mut self, _: &mut RapierWorld, _: f64) {}

    fn rect(&self, world: &RapierWorld) -> Rect {
        world
            .motion(self.id)
            .rect(self.origin_m, &self.com, Vector::Z)
    }

    fn pose(&self, world: &RapierWorld, _: &Rect) -> Pose {
        world.motion(self.id).pose_in_world(self.origin_m)
    }

    fn placement(&self, world: &RapierWorld, height_m: f64) -> Placement {
        world.motion(self.id).placement(self.origin_m, height_m)
    }

    fn fork(&self) -> Box<dyn Motor> {
        Box::new(self.clone())
    }
}
