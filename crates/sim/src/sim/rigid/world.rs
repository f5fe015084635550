//! World of rapier that moves all chassis, the only place that computes in f32.
//!
//! Every body is in rapier's sets from its first step to its last. Until
//! [`RapierWorld::solid`] bodies collide with the ground only, and on a plane not even
//! with it: wheels carry them, and rapier looks for no contacts. On a plane each car has
//! an origin of its own, which follows it: f32 positions stay as fine as 1 µm wherever
//! the car drives. From the contact on, and on a surface, all bodies have a common one.

use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::DefaultQueryDispatcher;
use rapier3d::control::DynamicRayCastVehicleController;
use rapier3d::math::{Pose, Rotation, Vector};
use rapier3d::prelude::{
    CCDSolver, CoefficientCombineRule, ColliderBuilder, ColliderHandle, ColliderSet,
    DefaultBroadPhase, Group, ImpulseJointSet, IntegrationParameters, InteractionGroups,
    InteractionTestMode, IslandManager, LockedAxes, MassProperties, MultibodyJointSet, NarrowPhase,
    PhysicsPipeline, QueryFilter, QueryPipelineMut, RigidBody, RigidBodyBuilder, RigidBodyHandle,
    RigidBodySet, SharedShape, SoftBodySet,
};

use super::chassis_motion::{ChassisMotion, Impulse, vector};
use super::shape::CollisionShape;
use super::surface::{GroundSurface, SurfacePoint};
use crate::sim::planar::Rect;
use crate::sim::{Body, GRAVITY_MPS2};

/// Grid of the cars' origins. Shifts by it are exact in f32.
const GRID_M: f64 = 8.0;
/// Height at which the collider of a vehicle begins, because wheels carry it.
const CLEARANCE_M: f64 = 0.15;
/// Iterations of rapier's solver over all contacts, once bodies collide.
///
/// More substeps of the solver would apply the restitution more than once.
const CONTACT_ITERATIONS: usize = 16;

/// Depth of the plane below a surface, which catches bodies beside its mesh.
const BASE_M: f32 = 1.0;

const GROUND: Group = Group::GROUP_1;
const BODY: Group = Group::GROUP_2;

/// Body of a world, numbered in the order of insertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChassisId(pub usize);

/// Sets of rapier, without its events and hooks.
pub(super) struct RapierWorld {
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
    /// A plane, or the mesh of a surface and a plane below it.
    ground: Vec<ColliderHandle>,
    surface: Option<GroundSurface>,
    friction: f64,
    /// Tree for the rays of wheels, which only the ground may stop.
    ray_targets: Bvh,
    is_solid: bool,
    steps: u64,
}

impl RapierWorld {
    /// Creates flat ground at height 0, without bodies.
    pub(super) fn new(friction: f64) -> RapierWorld {
        let mut world = RapierWorld {
            handles: Vec::new(),
            bodies: RigidBodySet::new(),
            colliders: ColliderSet::new(),
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
                // Bodies do not meet before `solid`.
                max_ccd_substeps: 0,
                ..Default::default()
            },
            pipeline: PhysicsPipeline::new(),
            ground: Vec::new(),
            surface: None,
            friction,
            ray_targets: Bvh::new(),
            is_solid: false,
            steps: 0,
        };
        world.lay(None);
        world
    }

    /// Replaces the ground by a surface, or by the plane at height 0.
    pub(super) fn lay(&mut self, surface: Option<GroundSurface>) {
        for handle in self.ground.drain(..) {
            self.colliders.remove(
                handle,
                &mut self.islands,
                &mut self.bodies,
                &mut self.soft_bodies,
                true,
            );
        }
        let mut shapes = Vec::with_capacity(2);
        let mut base_m = 0.0;
        if let Some(surface) = &surface {
            shapes.push((surface.shape.clone(), 0.0));
            base_m = surface.heights_m.0 - BASE_M;
        }
        // A body that leaves a surface falls on this plane instead of for ever.
        shapes.push((SharedShape::halfspace(Vector::Z), base_m));
        let mut leaves = Vec::with_capacity(2);
        for (shape, z_m) in shapes {
            let ground = ColliderBuilder::new(shape)
                .translation(Vector::new(0.0, 0.0, z_m))
                .friction(self.friction as f32)
                .friction_combine_rule(CoefficientCombineRule::Min)
                .collision_groups(groups(GROUND, GROUND | BODY))
                .build();
            let aabb = ground.compute_aabb();
            let handle = self.colliders.insert(ground);
            leaves.push((handle.into_raw_parts().0 as usize, aabb));
            self.ground.push(handle);
        }
        self.ray_targets = Bvh::from_iter(BvhBuildStrategy::Binned, leaves);
        self.surface = surface;
    }

    /// Returns whether the ground is no plane.
    pub(super) fn has_surface(&self) -> bool {
        self.surface.is_some()
    }

    /// Returns the surface below a point of the plane.
    ///
    /// `None` on a plane. Beside its mesh a surface counts as level at height 0.
    pub(super) fn surface_at(&self, x_m: f64, y_m: f64) -> Option<SurfacePoint> {
        let surface = self.surface.as_ref()?;
        let level = SurfacePoint {
            z_m: 0.0,
            normal: nalgebra::Vector3::z(),
        };
        Some(surface.at(x_m, y_m).unwrap_or(level))
    }

    /// Returns the upwards direction of the ground below a footprint.
    pub(super) fn up_at(&self, rect: &Rect) -> Vector {
        let point = self.surface_at(rect.x_m, rect.y_m);
        point.map_or(Vector::Z, |point| {
            vector(point.normal.x, point.normal.y, point.normal.z)
        })
    }

    /// Returns the height of the ground at a point of the plane.
    pub(super) fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.surface_at(x_m, y_m).map_or(0.0, |point| point.z_m)
    }

    /// Returns the number of steps of rapier's pipeline so far.
    pub(super) fn steps(&self) -> u64 {
        self.steps
    }

    /// Sets the friction of the ground for bodies that slide on it.
    ///
    /// They have its friction or theirs, whichever is less.
    pub(super) fn set_friction(&mut self, friction: f64) {
        self.friction = friction;
        for handle in &self.ground {
            if let Some(ground) = self.colliders.get_mut(*handle) {
                ground.set_friction(friction as f32);
            }
        }
    }

    /// Puts a body on the ground and returns it with its origin.
    ///
    /// The frame of the body lies on the ground, below the middle of the box.
    pub(super) fn insert(
        &mut self,
        body: &Body,
        shape: &CollisionShape,
        rect: &Rect,
    ) -> (ChassisId, (f64, f64)) {
        let origin_m = self.origin_near(rect.x_m, rect.y_m);
        (self.insert_at(body, shape, rect, origin_m), origin_m)
    }

    /// Puts a body on the ground, relative to a given origin.
    pub(super) fn insert_at(
        &mut self,
        body: &Body,
        shape: &CollisionShape,
        rect: &Rect,
        origin_m: (f64, f64),
    ) -> ChassisId {
        // Half-angle formulas avoid the platform's sine.
        let half_cos = (0.5 * (1.0 + rect.cos)).max(0.0).sqrt();
        let half_sin = (0.5 * (1.0 - rect.cos)).max(0.0).sqrt().copysign(rect.sin);
        let rotation = Rotation::from_xyzw(0.0, 0.0, half_sin as f32, half_cos as f32).normalize();
        let mut pose = Pose::from_parts(
            vector(rect.x_m - origin_m.0, rect.y_m - origin_m.1, 0.0),
            rotation,
        );
        let mut velocity = of_com(body, rect);
        if let Some(point) = self.surface_at(rect.x_m, rect.y_m) {
            let [x, y, z, w]: [f64; 4] = point.rotation(rect).coords.into();
            pose.translation.z = point.z_m as f32;
            pose.rotation = Rotation::from_xyzw(x as f32, y as f32, z as f32, w as f32).normalize();
            // The body moves along the surface.
            let up = pose.rotation * Vector::Z;
            velocity.z = -(velocity.x * up.x + velocity.y * up.y) / up.z;
        }
        let handle = self.bodies.insert(
            RigidBodyBuilder::dynamic()
                .pose(pose)
                .linvel(velocity)
                .angvel(vector(0.0, 0.0, rect.yaw_rate_rad_per_s))
                .additional_mass_properties(mass_properties(body))
                .ccd_enabled(self.is_solid)
                // A sleeping body would ignore the forces of its tyres.
                .can_sleep(false),
        );
        self.add_colliders(handle, body, shape);
        // Otherwise wheels that act before the first step would find a body without mass.
        self.bodies[handle].recompute_mass_properties_from_colliders(&self.colliders);
        self.handles.push(handle);
        ChassisId(self.handles.len() - 1)
    }

    /// Gives a body its collision shape, without changing its mass.
    fn add_colliders(&mut self, handle: RigidBodyHandle, body: &Body, shape: &CollisionShape) {
        let clearance_m = body.vehicle().map_or(0.0, |_| CLEARANCE_M);
        for (middle, part) in shape.colliders(clearance_m) {
            // In the frame of the body this is no mass at the origin, which rapier ignores
            // to the bit. A density of 0 would have a centre of mass of its own.
            let no_mass = MassProperties {
                local_com: -middle,
                ..MassProperties::default()
            };
            let collider = ColliderBuilder::new(part)
                .translation(middle)
                .mass_properties(no_mass)
                .restitution(body.restitution as f32)
                .friction(body.body_friction as f32)
                .collision_groups(body_groups(self.is_solid))
                .enabled(self.is_solid || self.has_surface());
            self.colliders
                .insert_with_parent(collider, handle, &mut self.bodies);
        }
    }

    /// Lets bodies collide with each other from now on.
    pub(super) fn solid(&mut self) {
        self.is_solid = true;
        // Nothing could collide before, so one iteration was enough.
        self.parameters.num_internal_pgs_iterations = CONTACT_ITERATIONS;
        self.parameters.max_ccd_substeps = IntegrationParameters::default().max_ccd_substeps;
        for (handle, collider) in self.colliders.iter_mut() {
            if !self.ground.contains(&handle) {
                collider.set_collision_groups(body_groups(true));
                collider.set_enabled(true);
            }
        }
        for (_, body) in self.bodies.iter_mut() {
            // Otherwise a body could pass through a thin one within one step.
            body.enable_ccd(true);
        }
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
            // Pairs without an impulse are near each other and do not touch.
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
        self.body_mut(id).set_locked_axes(locked, true);
    }

    /// Sets the velocity of a body on the ground.
    pub(super) fn move_at(&mut self, id: ChassisId, rect: &Rect) {
        let body = self.body_mut(id);
        // The suspension owns the vertical motion.
        let up_mps = body.linvel().z;
        let along = vector(rect.vx_mps, rect.vy_mps, 0.0);
        body.set_linvel(Vector::new(along.x, along.y, up_mps), true);
        body.set_angvel(vector(0.0, 0.0, rect.yaw_rate_rad_per_s), true);
    }

    /// Returns the velocity of a body's centre of mass on the ground.
    pub(super) fn velocity_mps(&self, id: ChassisId) -> [f64; 2] {
        let velocity = self.body(id).linvel();
        [f64::from(velocity.x), f64::from(velocity.y)]
    }

    /// Sets the external force at a body's centre of mass, along world x and y.
    pub(super) fn set_force(&mut self, id: ChassisId, x_n: f64, y_n: f64) {
        let force_n = vector(x_n, y_n, 0.0);
        if self.body(id).user_force() != force_n {
            let body = self.body_mut(id);
            body.reset_forces(true);
            body.add_force(force_n, true);
        }
    }

    /// Lets a car's wheels act on its chassis for a step.
    pub(super) fn roll(&mut self, car: &mut DynamicRayCastVehicleController, dt_s: f64) {
        let queries = QueryPipelineMut {
            dispatcher: &DefaultQueryDispatcher,
            bvh: &self.ray_targets,
            bodies: &mut self.bodies,
            colliders: &mut self.colliders,
            filter: QueryFilter::new(),
        };
        car.update_vehicle(dt_s as f32, queries);
    }

    /// Returns a vehicle without wheels on a body.
    pub(super) fn vehicle(&self, id: ChassisId) -> DynamicRayCastVehicleController {
        let mut vehicle = DynamicRayCastVehicleController::new(self.handles[id.0]);
        vehicle.index_up_axis = 2;
        vehicle
    }

    /// Pushes a body on the ground.
    pub(super) fn push(&mut self, id: ChassisId, rect: &Rect, normal: Vector, impulse: &Impulse) {
        // On a plane nothing is multiplied, so its bits do not depend on slopes.
        let tilt = (normal != Vector::Z).then(|| Rotation::from_rotation_arc(Vector::Z, normal));
        let Rect { cos, sin, .. } = *rect;
        let turned = |x: f64, y: f64, z: f64| {
            let level = vector(x * cos - y * sin, x * sin + y * cos, z);
            tilt.map_or(level, |tilt| tilt * level)
        };
        let [roll, pitch, yaw] = impulse.angular_n_m_s;
        let body = self.body_mut(id);
        body.apply_impulse(turned(impulse.along_n_s, impulse.across_n_s, 0.0), true);
        body.apply_torque_impulse(turned(roll, pitch, yaw), true);
    }

    /// Moves all bodies for one step.
    pub(super) fn step(&mut self, dt_s: f64) {
        self.steps += 1;
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

    /// Returns the pose and velocity of a body.
    pub(super) fn motion(&self, id: ChassisId) -> ChassisMotion {
        let body = self.body(id);
        ChassisMotion {
            pose: *body.position(),
            linear: body.linvel(),
            angular: body.angvel(),
        }
    }

    /// Sets the pose and velocity of a body.
    pub(super) fn place(&mut self, id: ChassisId, motion: &ChassisMotion) {
        let body = self.body_mut(id);
        body.set_position(motion.pose, true);
        body.set_linvel(motion.linear, true);
        body.set_angvel(motion.angular, true);
    }

    /// Moves a body to another origin without moving it in the world.
    pub(super) fn move_origin(&mut self, id: ChassisId, from_m: (f64, f64), to_m: (f64, f64)) {
        let mut motion = self.motion(id);
        motion.pose.translation += vector(from_m.0 - to_m.0, from_m.1 - to_m.1, 0.0);
        self.place(id, &motion);
    }

    /// Moves a body in the plane.
    pub(super) fn shift(&mut self, id: ChassisId, x_m: f64, y_m: f64) {
        let body = self.body_mut(id);
        let mut pose = *body.position();
        pose.translation += vector(x_m, y_m, 0.0);
        body.set_position(pose, true);
    }

    /// Returns the origin for a body at a position.
    ///
    /// A surface has one place, so all bodies on it have the origin of the world.
    pub(super) fn origin_near(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        // The surface is a collider at the origin of the world.
        if self.has_surface() {
            return (0.0, 0.0);
        }
        (on_grid(x_m), on_grid(y_m))
    }

    /// Moves a car's origin to the car once the car is far from it.
    pub(super) fn recentre(&mut self, id: ChassisId, origin_m: &mut (f64, f64)) {
        if self.has_surface() {
            return;
        }
        let mut motion = self.motion(id);
        let Vector { x, y, .. } = motion.pose.translation;
        // Two grid cells of slack, so that a car near a cell border does not shift
        // at every step.
        if x.abs().max(y.abs()) <= 2.0 * GRID_M as f32 {
            return;
        }
        let (shift_x_m, shift_y_m) = (on_grid(f64::from(x)), on_grid(f64::from(y)));
        motion.pose.translation -= vector(shift_x_m, shift_y_m, 0.0);
        self.place(id, &motion);
        *origin_m = (origin_m.0 + shift_x_m, origin_m.1 + shift_y_m);
    }

    fn body(&self, id: ChassisId) -> &RigidBody {
        &self.bodies[self.handles[id.0]]
    }

    fn body_mut(&mut self, id: ChassisId) -> &mut RigidBody {
        &mut self.bodies[self.handles[id.0]]
    }
}

impl Clone for RapierWorld {
    fn clone(&self) -> RapierWorld {
        RapierWorld {
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
            // It holds buffers alone, which a step fills anew.
            pipeline: PhysicsPipeline::new(),
            ground: self.ground.clone(),
            surface: self.surface.clone(),
            friction: self.friction,
            ray_targets: self.ray_targets.clone(),
            is_solid: self.is_solid,
            steps: self.steps,
        }
    }
}

/// Returns mass, centre of mass and moments of inertia of a uniform box.
fn mass_properties(body: &Body) -> MassProperties {
    let (l, w, h) = (body.length_m, body.width_m, body.height_m);
    // Inertia of an even cuboid, except for a stated yaw inertia.
    let twelfth = body.mass_kg / 12.0;
    let inertia = vector(
        twelfth * (w * w + h * h),
        twelfth * (l * l + h * h),
        body.yaw_inertia_kg_m2(),
    );
    let com = vector(body.com_ahead_m, 0.0, body.com_height_m);
    MassProperties::new(com, body.mass_kg as f32, inertia)
}

/// Returns the velocity of the centre of mass of a body whose middle moves on the ground.
fn of_com(body: &Body, rect: &Rect) -> Vector {
    let swing_mps = rect.yaw_rate_rad_per_s * body.com_ahead_m;
    vector(
        rect.vx_mps - swing_mps * rect.sin,
        rect.vy_mps + swing_mps * rect.cos,
        0.0,
    )
}

fn groups(memberships: Group, filter: Group) -> InteractionGroups {
    InteractionGroups::new(memberships, filter, InteractionTestMode::And)
}

/// Returns the groups of a body, which collides with others only once bodies are solid.
fn body_groups(is_solid: bool) -> InteractionGroups {
    groups(BODY, if is_solid { GROUND | BODY } else { GROUND })
}

fn on_grid(value_m: f64) -> f64 {
    libm::round(value_m / GRID_M) * GRID_M
}
