//! World of rapier in which bodies collide, from the first contact on.

use rapier3d::math::Vector;
use rapier3d::prelude::{
    CCDSolver, CoefficientCombineRule, ColliderBuilder, ColliderSet, DefaultBroadPhase,
    ImpulseJointSet, IntegrationParameters, IslandManager, LockedAxes, MultibodyJointSet,
    NarrowPhase, PhysicsPipeline, RigidBody, RigidBodyHandle, RigidBodySet, RigidBodyVelocity,
    SharedShape, SoftBodySet,
};

use super::chassis::{Chassis, ChassisId};
use super::chassis_motion::{ChassisMotion, vector};
use super::wheels::{Carried, Wheel, roll};
use crate::sim::planar::Rect;
use crate::sim::{Body, GRAVITY_MPS2};

/// Iterations of rapier's solver over all contacts, once bodies collide.
const CONTACT_ITERATIONS: usize = 16;
/// Sets of rapier, without its events and hooks.
pub(super) struct CollisionWorld {
    /// Bodies in the order of their numbers.
    handles: Vec<RigidBodyHandle>,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    islands: IslandManager,
    broad_phase: DefaultBroadPhase,
    narrow_phase: NarrowPhase,
    impulse_joints: ImpulseJointSet,
    multibody_joints: MultibodyJointSet,
    soft_bodies: SoftBodySet,
    ccd_solver: CCDSolver,
    parameters: IntegrationParameters,
    /// Workspace only, so a fork starts with a fresh pipeline.
    pipeline: PhysicsPipeline,
}

impl CollisionWorld {
    /// Creates the world of bodies that moved alone so far, some of which were removed.
    ///
    /// rapier's sets have the bodies as if they had been there from the beginning. A step
    /// of 0 s registers them, and a removed body leaves its place to the next one.
    pub(super) fn new(
        chassis: &[Chassis],
        removed: &[ChassisId],
        parameters: IntegrationParameters,
    ) -> CollisionWorld {
        let mut colliders = ColliderSet::new();
        colliders.insert(ColliderBuilder::new(SharedShape::halfspace(Vector::Z)));
        let mut world = CollisionWorld {
            handles: Vec::with_capacity(chassis.len()),
            bodies: RigidBodySet::new(),
            colliders,
            islands: IslandManager::new(),
            broad_phase: DefaultBroadPhase::default(),
            narrow_phase: NarrowPhase::new(),
            impulse_joints: ImpulseJointSet::new(),
            multibody_joints: MultibodyJointSet::new(),
            soft_bodies: SoftBodySet::new(),
            ccd_solver: CCDSolver::new(),
            parameters,
            pipeline: PhysicsPipeline::new(),
        };
        for one in chassis {
            world.insert(one);
        }
        world.step(0.0);
        for id in removed {
            world.remove(*id);
        }
        // More substeps of the solver would apply the restitution more than once.
        world.parameters.num_internal_pgs_iterations = CONTACT_ITERATIONS;
        world
    }

    /// Sets the friction of the ground for bodies that slide on it.
    pub(super) fn set_friction(&mut self, friction: f64) {
        for (_, ground) in self.colliders.iter_mut() {
            ground.set_friction(friction as f32);
            ground.set_friction_combine_rule(CoefficientCombineRule::Min);
        }
    }

    /// Inserts a body.
    pub(super) fn insert(&mut self, chassis: &Chassis) -> ChassisId {
        let handle = self.bodies.insert(chassis.rigid_body());
        // Otherwise the first step would find a body without mass.
        self.bodies[handle].recompute_mass_properties_from_colliders(&self.colliders);
        self.handles.push(handle);
        ChassisId(self.handles.len() - 1)
    }

    /// Removes a body.
    pub(super) fn remove(&mut self, id: ChassisId) {
        self.bodies.remove(
            self.handles[id.0],
            &mut self.islands,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.soft_bodies,
            true,
        );
    }

    /// Gives a body its collision shape, without changing its mass.
    pub(super) fn add_colliders(
        &mut self,
        id: ChassisId,
        body: &Body,
        parts: Vec<(Vector, SharedShape)>,
    ) {
        let handle = self.handles[id.0];
        for (middle, shape) in parts {
            let collider = ColliderBuilder::new(shape)
                .translation(middle)
                .density(0.0)
                .restitution(body.restitution as f32)
                .friction(body.body_friction as f32);
            self.colliders
                .insert_with_parent(collider, handle, &mut self.bodies);
        }
        // Otherwise a body could pass through a thin one within one step.
        self.bodies[handle].enable_ccd(true);
    }

    /// Returns the pairs of bodies between which rapier's last step exerted a force.
    pub(super) fn colliding(&self) -> Vec<(ChassisId, ChassisId)> {
        let parent = |collider| {
            let parent = self.colliders.get(collider)?.parent()?;
            let number = self.handles.iter().position(|handle| *handle == parent)?;
            Some(ChassisId(number))
        };
        let pairs = self.narrow_phase.contact_pairs().filter(|pair| {
            let manifolds = pair.solver_manifolds().iter();
            let mut points = manifolds.flat_map(|manifold| manifold.points.iter());
            points.any(|point| point.data.impulse > 0.0)
        });
        pairs
            .filter_map(|pair| Some((parent(pair.collider1)?, parent(pair.collider2)?)))
            .collect()
    }

    /// Holds a body upright, or lets it fall.
    pub(super) fn hold_upright(&mut self, id: ChassisId, held: bool) {
        let locked = if held {
            LockedAxes::ROTATION_LOCKED_X | LockedAxes::ROTATION_LOCKED_Y
        } else {
            LockedAxes::empty()
        };
        self.body(id).set_locked_axes(locked, true);
    }

    /// Sets the velocity of a body on the ground.
    pub(super) fn move_at(&mut self, id: ChassisId, rect: &Rect) {
        let body = self.body(id);
        let up_mps = body.linvel().z;
        let along = vector(rect.vx_mps, rect.vy_mps, 0.0);
        body.set_linvel(Vector::new(along.x, along.y, up_mps), true);
        body.set_angvel(vector(0.0, 0.0, rect.yaw_rate_rad_per_s), true);
    }

    pub(super) fn set_force(&mut self, id: ChassisId, force_n: Vector) {
        let body = self.body(id);
        if body.user_force() != force_n {
            body.reset_forces(true);
            body.add_force(force_n, true);
        }
    }

    /// Returns the velocity of a body's centre of mass on the ground.
    pub(super) fn velocity_mps(&self, id: ChassisId) -> [f64; 2] {
        let velocity = self.bodies[self.handles[id.0]].linvel();
        [f64::from(velocity.x), f64::from(velocity.y)]
    }

    pub(super) fn roll(&mut self, id: ChassisId, wheels: &mut [Wheel; 4], dt_s: f32) {
        let body = self.body(id);
        let mut velocity = *body.vels();
        let mut carried = Carried {
            pose: body.position(),
            mass: body.mass_properties(),
            velocity: &mut velocity,
        };
        roll(wheels, &mut carried, dt_s);
        set_velocity(body, velocity);
    }

    pub(super) fn push(&mut self, id: ChassisId, impulse: Vector, angular: Vector) {
        let body = self.body(id);
        body.apply_impulse(impulse, true);
        body.apply_torque_impulse(angular, true);
    }

    /// Runs one step of rapier.
    pub(super) fn step(&mut self, dt_s: f32) {
        self.parameters.dt = dt_s;
        self.pipeline.step(
            vector(0.0, 0.0, -GRAVITY_MPS2),
            &self.parameters,
            &mut self.islands,
            &mut self.broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.soft_bodies,
            &mut self.ccd_solver,
            &(),
            &(),
        );
    }

    pub(super) fn motion(&self, id: ChassisId) -> ChassisMotion {
        let body = &self.bodies[self.handles[id.0]];
        ChassisMotion {
            pose: *body.position(),
            linear: body.linvel(),
            angular: body.angvel(),
        }
    }

    pub(super) fn place(&mut self, id: ChassisId, motion: &ChassisMotion) {
        let body = self.body(id);
        body.set_position(motion.pose, true);
        body.set_linvel(motion.linear, true);
        body.set_angvel(motion.angular, true);
    }

    fn body(&mut self, id: ChassisId) -> &mut RigidBody {
        &mut self.bodies[self.handles[id.0]]
    }
}

impl Clone for CollisionWorld {
    fn clone(&self) -> CollisionWorld {
        CollisionWorld {
            handles: self.handles.clone(),
            bodies: self.bodies.clone(),
            colliders: self.colliders.clone(),
            islands: self.islands.clone(),
            broad_phase: self.broad_phase.clone(),
            narrow_phase: self.narrow_phase.clone(),
            impulse_joints: self.impulse_joints.clone(),
            multibody_joints: self.multibody_joints.clone(),
            soft_bodies: self.soft_bodies.clone(),
            ccd_solver: self.ccd_solver.clone(),
            parameters: self.parameters,
            pipeline: PhysicsPipeline::new(),
        }
    }
}

/// Sets a velocity, with the signs of its zeros.
///
/// rapier's setters ignore equal numbers, and 0 equals -0.
fn set_velocity(body: &mut RigidBody, velocity: RigidBodyVelocity<f32>) {
    let other = RigidBodyVelocity {
        linvel: velocity.linvel + Vector::ONE,
        angvel: velocity.angvel + Vector::ONE,
    };
    body.set_vels(other, true);
    body.set_vels(velocity, true);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_velocity_is_set_with_the_signs_of_its_zeros() {
        let mut body = rapier3d::prelude::RigidBodyBuilder::dynamic().build();
        for zero in [-0.0f32, 0.0] {
            let velocity = RigidBodyVelocity::new(Vector::splat(zero), Vector::splat(zero));
            set_velocity(&mut body, velocity);
            let bits = |vector: Vector| vector.to_array().map(f32::to_bits);
            assert_eq!(bits(body.linvel()), [zero.to_bits(); 3]);
            assert_eq!(bits(body.angvel()), [zero.to_bits(); 3]);
        }
    }
}
