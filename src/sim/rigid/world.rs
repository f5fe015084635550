//! rapier world below the rigid plant, the only place that computes in f32.
//!
//! The world holds the chassis and the ground, and nothing in it collides. A
//! contact ends the plant's motion before rapier would have to resolve it.
//! Chassis therefore carry no colliders, and the wheels' rays see only the
//! ground, through a bounding volume hierarchy of one leaf. The ground is the
//! same everywhere, so each car has an origin of its own, which follows it. f32
//! positions stay as fine as 1 µm wherever the car drives.

use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::DefaultQueryDispatcher;
use rapier3d::control::DynamicRayCastVehicleController;
use rapier3d::math::{Pose, Rotation, Vector};
use rapier3d::prelude::{
    CCDSolver, ColliderBuilder, ColliderSet, DefaultBroadPhase, ImpulseJointSet,
    IntegrationParameters, IslandManager, MassProperties, MultibodyJointSet, NarrowPhase,
    PhysicsPipeline, QueryFilter, QueryPipelineMut, RigidBodyBuilder, RigidBodyHandle,
    RigidBodySet, SharedShape, SoftBodySet,
};

use crate::sim::planar::Rect;
use crate::sim::{Body, GRAVITY_MPS2, Placement};

/// Grid of the cars' origins. Shifts by it are exact in f32.
const GRID_M: f64 = 8.0;

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
        let (l, w, h) = (body.length_m, body.width_m, body.height_m);
        // Moments of inertia of a uniform box.
        let twelfth = body.mass_kg / 12.0;
        let inertia = vector(
            twelfth * (w * w + h * h),
            twelfth * (l * l + h * h),
            twelfth * (l * l + w * w),
        );
        let com = vector(body.com_ahead_m, 0.0, body.com_height_m);
        // Half-angle formulas avoid the platform's sine.
        let half_cos = (0.5 * (1.0 + rect.cos)).max(0.0).sqrt();
        let half_sin = (0.5 * (1.0 - rect.cos)).max(0.0).sqrt().copysign(rect.sin);
        let rotation = Rotation::from_xyzw(0.0, 0.0, half_sin as f32, half_cos as f32).normalize();
        let origin_m = (on_grid(rect.x_m), on_grid(rect.y_m));
        let translation = vector(rect.x_m - origin_m.0, rect.y_m - origin_m.1, 0.0);
        let chassis = RigidBodyBuilder::dynamic()
            .pose(Pose::from_parts(translation, rotation))
            .linvel(vector(rect.vx_mps, rect.vy_mps, 0.0))
            .additional_mass_properties(MassProperties::new(com, body.mass_kg as f32, inertia))
            .can_sleep(false);
        let handle = self.bodies.insert(chassis);
        // Otherwise the first step would find a body without mass.
        self.bodies[handle].recompute_mass_properties_from_colliders(&self.colliders);
        (handle, origin_m)
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
        let (ahead_x, ahead_y) = (f64::from(ahead.x), f64::from(ahead.y));
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

fn on_grid(value_m: f64) -> f64 {
    libm::round(value_m / GRID_M) * GRID_M
}

/// Converts to rapier's f32 vector.
pub(super) fn vector(x: f64, y: f64, z: f64) -> Vector {
    Vector::new(x as f32, y as f32, z as f32)
}
