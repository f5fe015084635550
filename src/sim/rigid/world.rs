//! rapier world below the rigid plant, the only place that computes in f32.
//!
//! The world holds the chassis and the ground. Up to the first contact nothing in
//! it collides, and chassis carry no colliders. From [`RapierWorld::solid`] on they
//! do, and rapier resolves collisions. The wheels' rays see only the ground,
//! through a bounding volume hierarchy of one leaf. The ground is the same
//! everywhere, so each car has an origin of its own, which follows it. f32
//! positions stay as fine as 1 µm wherever the car drives.

use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::DefaultQueryDispatcher;
use rapier3d::control::DynamicRayCastVehicleController;
use rapier3d::math::{Pose, Rotation, Vector};
use rapier3d::prelude::{
    CCDSolver, CoefficientCombineRule, ColliderBuilder, ColliderSet, DefaultBroadPhase,
    ImpulseJointSet, IntegrationParameters, IslandManager, LockedAxes, MassProperties,
    MultibodyJointSet, NarrowPhase, PhysicsPipeline, QueryFilter, QueryPipelineMut,
    RigidBodyBuilder, RigidBodyHandle, RigidBodySet, SharedShape, SoftBodySet,
};

use crate::sim::planar::Rect;
use crate::sim::{Body, GRAVITY_MPS2, Placement};

/// Iterations of rapier's solver over all contacts, once bodies collide.
const CONTACT_ITERATIONS: usize = 16;
/// Grid of the cars' origins. Shifts by it are exact in f32.
const GRID_M: f64 = 8.0;

/// Squared horizontal part of a heading below which a body stands on its nose.
const UPENDED: f64 = 1e-4;

/// Sets of rapier, without its events and hooks.
pub(super) struct RapierWorld {
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
    ground: Bvh,
}

/// Pose and velocity of a chassis at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ChassisMotion {
    pose: Pose,
    linear: Vector,
    angular: Vector,
}

impl RapierWorld {
    /// Creates flat ground at height 0, without bodies.
    pub(super) fn new() -> RapierWorld {
        let mut colliders = ColliderSet::new();
        let ground = ColliderBuilder::new(SharedShape::halfspace(Vector::Z)).build();
        let aabb = ground.compute_aabb();
        let (leaf, _) = colliders.insert(ground).into_raw_parts();
        RapierWorld {
            bodies: RigidBodySet::new(),
            colliders,
            islands: IslandManager::new(),
            broad_phase: DefaultBroadPhase::default(),
            narrow_phase: NarrowPhase::new(),
            impulse_joints: ImpulseJointSet::new(),
            multibody_joints: MultibodyJointSet::new(),
            soft_bodies: SoftBodySet::new(),
            ccd_solver: CCDSolver::new(),
            // More solver iterations give a car at rest a phantom velocity.
            parameters: IntegrationParameters {
                num_solver_iterations: 1,
                ..Default::default()
            },
            pipeline: PhysicsPipeline::new(),
            ground: Bvh::from_iter(BvhBuildStrategy::Binned, [(leaf as usize, aabb)]),
        }
    }

    /// Puts a chassis on the ground and returns it with its origin.
    ///
    /// The frame of the chassis lies on the ground, below the middle of the box.
    pub(super) fn insert(&mut self, body: &Body, rect: &Rect) -> (RigidBodyHandle, (f64, f64)) {
        let origin_m = origin_near((rect.x_m, rect.y_m));
        (self.insert_at(body, rect, origin_m), origin_m)
    }

    /// Puts a body on the ground, relative to a given origin.
    pub(super) fn insert_at(
        &mut self,
        body: &Body,
        rect: &Rect,
        origin_m: (f64, f64),
    ) -> RigidBodyHandle {
        let (l, w, h) = (body.length_m, body.width_m, body.height_m);
        // Moments of inertia of a uniform box.
        let twelfth = body.mass_kg / 12.0;
        let inertia = vector(
            twelfth * (w * w + h * h),
            twelfth * (l * l + h * h),
            body.yaw_inertia_kg_m2(),
        );
        let com = vector(body.com_ahead_m, 0.0, body.com_height_m);
        // Half-angle formulas avoid the platform's sine.
        let half_cos = (0.5 * (1.0 + rect.cos)).max(0.0).sqrt();
        let half_sin = (0.5 * (1.0 - rect.cos)).max(0.0).sqrt().copysign(rect.sin);
        let rotation = Rotation::from_xyzw(0.0, 0.0, half_sin as f32, half_cos as f32).normalize();
        let translation = vector(rect.x_m - origin_m.0, rect.y_m - origin_m.1, 0.0);
        let chassis = RigidBodyBuilder::dynamic()
            .pose(Pose::from_parts(translation, rotation))
            .linvel(vector(rect.vx_mps, rect.vy_mps, 0.0))
            .additional_mass_properties(MassProperties::new(com, body.mass_kg as f32, inertia))
            .can_sleep(false);
        let handle = self.bodies.insert(chassis);
        // Otherwise the first step would find a body without mass.
        self.bodies[handle].recompute_mass_properties_from_colliders(&self.colliders);
        handle
    }

    /// Lets rapier resolve contacts from now on.
    ///
    /// Bodies that slide on the ground have its friction or theirs, whichever is less.
    pub(super) fn solid(&mut self, friction: f64) {
        // More substeps of the solver would apply the restitution more than once.
        self.parameters.num_internal_pgs_iterations = CONTACT_ITERATIONS;
        for (_, ground) in self.colliders.iter_mut() {
            ground.set_friction(friction as f32);
            ground.set_friction_combine_rule(CoefficientCombineRule::Min);
        }
    }

    /// Gives a body its collision shape, without changing its mass.
    pub(super) fn add_colliders(
        &mut self,
        handle: RigidBodyHandle,
        body: &Body,
        parts: Vec<(Vector, SharedShape)>,
    ) {
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
    pub(super) fn colliding(&self) -> Vec<(RigidBodyHandle, RigidBodyHandle)> {
        let parent = |collider| self.colliders.get(collider)?.parent();
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
    pub(super) fn hold_upright(&mut self, handle: RigidBodyHandle, held: bool) {
        let locked = if held {
            LockedAxes::ROTATION_LOCKED_X | LockedAxes::ROTATION_LOCKED_Y
        } else {
            LockedAxes::empty()
        };
        self.bodies[handle].set_locked_axes(locked, true);
    }

    /// Sets the velocity of a body on the ground.
    pub(super) fn move_at(&mut self, handle: RigidBodyHandle, rect: &Rect) {
        let body = &mut self.bodies[handle];
        let up_mps = body.linvel().z;
        let along = vector(rect.vx_mps, rect.vy_mps, 0.0);
        body.set_linvel(Vector::new(along.x, along.y, up_mps), true);
        body.set_angvel(vector(0.0, 0.0, rect.yaw_rate_rad_per_s), true);
    }

    /// Sets the external force at a body's centre of mass, along world x and y.
    pub(super) fn set_force(&mut self, handle: RigidBodyHandle, (x_n, y_n): (f64, f64)) {
        let (force, body) = (vector(x_n, y_n, 0.0), &mut self.bodies[handle]);
        if body.user_force() != force {
            body.reset_forces(true);
            body.add_force(force, true);
        }
    }

    /// Returns the velocity of a body's centre of mass on the ground.
    pub(super) fn velocity_mps(&self, handle: RigidBodyHandle) -> [f64; 2] {
        let velocity = self.bodies[handle].linvel();
        [f64::from(velocity.x), f64::from(velocity.y)]
    }

    /// Moves a body to another origin without moving it in the world.
    pub(super) fn move_origin(
        &mut self,
        handle: RigidBodyHandle,
        from_m: (f64, f64),
        to_m: (f64, f64),
    ) {
        let mut motion = self.motion(handle);
        motion.pose.translation += vector(from_m.0 - to_m.0, from_m.1 - to_m.1, 0.0);
        self.place(handle, &motion);
    }

    /// Removes a chassis.
    pub(super) fn remove(&mut self, handle: RigidBodyHandle) {
        self.bodies.remove(
            handle,
            &mut self.islands,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.soft_bodies,
            true,
        );
    }

    /// Lets a car's wheels act on its chassis for a step.
    pub(super) fn roll(&mut self, car: &mut DynamicRayCastVehicleController, dt_s: f64) {
        let queries = QueryPipelineMut {
            dispatcher: &DefaultQueryDispatcher,
            bvh: &self.ground,
            bodies: &mut self.bodies,
            colliders: &mut self.colliders,
            filter: QueryFilter::new(),
        };
        car.update_vehicle(dt_s as f32, queries);
    }

    /// Pushes a body on the ground with an impulse at its centre of mass and an angular
    /// impulse about it, both in the frame of its heading.
    pub(super) fn push(
        &mut self,
        handle: RigidBodyHandle,
        (cos, sin): (f64, f64),
        (along, across): (f64, f64),
        [roll, pitch, yaw]: [f64; 3],
    ) {
        let turned = |x: f64, y: f64, z: f64| vector(x * cos - y * sin, x * sin + y * cos, z);
        let body = &mut self.bodies[handle];
        body.apply_impulse(turned(along, across, 0.0), true);
        body.apply_torque_impulse(turned(roll, pitch, yaw), true);
    }

    /// Runs one step of rapier.
    pub(super) fn step(&mut self, dt_s: f64) {
        self.parameters.dt = dt_s as f32;
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

    /// Returns the pose and velocity of a chassis.
    pub(super) fn motion(&self, handle: RigidBodyHandle) -> ChassisMotion {
        let chassis = &self.bodies[handle];
        ChassisMotion {
            pose: *chassis.position(),
            linear: chassis.linvel(),
            angular: chassis.angvel(),
        }
    }

    /// Moves a car's origin to the car once the car is far from it.
    pub(super) fn recentre(&mut self, handle: RigidBodyHandle, origin_m: &mut (f64, f64)) {
        let Vector { x, y, .. } = self.bodies[handle].translation();
        // Two grid cells of slack, so that a car near a cell border does not shift
        // at every step.
        if x.abs().max(y.abs()) <= 2.0 * GRID_M as f32 {
            return;
        }
        let (shift_x_m, shift_y_m) = (on_grid(f64::from(x)), on_grid(f64::from(y)));
        let mut motion = self.motion(handle);
        motion.pose.translation -= vector(shift_x_m, shift_y_m, 0.0);
        self.place(handle, &motion);
        *origin_m = (origin_m.0 + shift_x_m, origin_m.1 + shift_y_m);
    }

    /// Sets the pose and velocity of a chassis.
    pub(super) fn place(&mut self, handle: RigidBodyHandle, motion: &ChassisMotion) {
        let chassis = &mut self.bodies[handle];
        chassis.set_position(motion.pose, true);
        chassis.set_linvel(motion.linear, true);
        chassis.set_angvel(motion.angular, true);
    }
}

impl Clone for RapierWorld {
    fn clone(&self) -> RapierWorld {
        RapierWorld {
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
            ground: self.ground.clone(),
        }
    }
}

impl ChassisMotion {
    /// Returns the upright footprint.
    ///
    /// It is placed by the centre of mass, about which the chassis pitches and rolls.
    pub(super) fn rect(&self, (origin_x_m, origin_y_m): (f64, f64), body: &ComOffset) -> Rect {
        let ahead = self.pose.rotation * Vector::X;
        let (mut ahead_x, mut ahead_y) = (f64::from(ahead.x), f64::from(ahead.y));
        // A body that a collision stood on its nose has the heading of its sides.
        if ahead_x * ahead_x + ahead_y * ahead_y < UPENDED {
            let left = self.pose.rotation * Vector::Y;
            (ahead_x, ahead_y) = (f64::from(left.y), -f64::from(left.x));
        }
        // Pitch shortens the horizontal part of the heading, so normalise it.
        let scale = 1.0 / (ahead_x * ahead_x + ahead_y * ahead_y).sqrt();
        let (cos, sin) = (ahead_x * scale, ahead_y * scale);
        let com = self.pose * body.local;
        let yaw_rate_rad_per_s = f64::from(self.angular.z);
        Rect {
            x_m: origin_x_m + f64::from(com.x) - body.ahead_m * cos,
            y_m: origin_y_m + f64::from(com.y) - body.ahead_m * sin,
            cos,
            sin,
            // From the centre of mass to the centre of the box, which swings in a turn.
            vx_mps: f64::from(self.linear.x) + yaw_rate_rad_per_s * body.ahead_m * sin,
            vy_mps: f64::from(self.linear.y) - yaw_rate_rad_per_s * body.ahead_m * cos,
            yaw_rate_rad_per_s,
        }
    }

    /// Returns the centre of the bounding box, with pitch and roll.
    pub(super) fn placement(&self, origin_m: (f64, f64), height_m: f64) -> Placement {
        let centre = self.pose * vector(0.0, 0.0, 0.5 * height_m);
        let (x_m, y_m) = (f64::from(centre.x), f64::from(centre.y));
        let rotation = self.pose.rotation;
        Placement::from_parts(
            [origin_m.0 + x_m, origin_m.1 + y_m, f64::from(centre.z)],
            [rotation.x, rotation.y, rotation.z, rotation.w].map(f64::from),
        )
    }

    /// Returns the velocity gained since an earlier instant, along world x and y.
    pub(super) fn gain_mps(&self, before: &ChassisMotion) -> (f64, f64) {
        let gain = self.linear - before.linear;
        (f64::from(gain.x), f64::from(gain.y))
    }

    /// Interpolates towards another motion by a share.
    pub(super) fn towards(&self, end: &ChassisMotion, share: f64) -> ChassisMotion {
        let share = share as f32;
        ChassisMotion {
            pose: Pose::from_parts(
                self.pose.translation.lerp(end.pose.translation, share),
                self.pose.rotation.lerp(end.pose.rotation, share),
            ),
            linear: self.linear.lerp(end.linear, share),
            angular: self.angular.lerp(end.angular, share),
        }
    }
}

/// Position of the centre of mass in the frame of the chassis.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComOffset {
    local: Vector,
    ahead_m: f64,
}

impl ComOffset {
    pub(super) fn of(body: &Body) -> ComOffset {
        let local = vector(body.com_ahead_m, 0.0, body.com_height_m);
        ComOffset {
            local,
            ahead_m: body.com_ahead_m,
        }
    }
}

/// Returns the grid point next to a position.
pub(super) fn origin_near((x_m, y_m): (f64, f64)) -> (f64, f64) {
    (on_grid(x_m), on_grid(y_m))
}

fn on_grid(value_m: f64) -> f64 {
    libm::round(value_m / GRID_M) * GRID_M
}

/// Converts to rapier's f32 vector.
pub(super) fn vector(x: f64, y: f64, z: f64) -> Vector {
    Vector::new(x as f32, y as f32, z as f32)
}
