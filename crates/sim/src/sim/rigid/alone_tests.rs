//! Bodies that move alone have the bits that rapier gives them, and keep them when they
//! begin to collide.

use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::DefaultQueryDispatcher;
use proptest::prelude::*;
use rapier3d::control::{DynamicRayCastVehicleController, WheelTuning};
use rapier3d::math::{Pose, Rotation, Vector};
use rapier3d::prelude::{
    ColliderBuilder, IntegrationParameters, MassProperties, PhysicsWorld, QueryFilter,
    QueryPipelineMut, RigidBodyHandle, SharedShape,
};

use super::chassis::{Chassis, ChassisId};
use super::chassis_motion::{ChassisMotion, vector};
use super::collision_world::CollisionWorld;
use super::shape::CollisionShape;
use super::wheels::Wheel;
use crate::sim::{Body, GRAVITY_MPS2};

/// Steps that both ways of moving take.
const STEPS: usize = 60;

/// Bits of a motion, zeros with their signs.
fn bits(motion: &ChassisMotion) -> Vec<u32> {
    let ChassisMotion {
        pose,
        linear,
        angular,
    } = motion;
    let numbers = pose.translation.to_array().into_iter();
    numbers
        .chain(pose.rotation.to_array())
        .chain(linear.to_array())
        .chain(angular.to_array())
        .map(f32::to_bits)
        .collect()
}

/// The same body moved by rapier's pipeline, and its car by rapier's controller.
struct OwnReference {
    world: PhysicsWorld,
    handle: RigidBodyHandle,
    ground: Bvh,
    car: DynamicRayCastVehicleController,
}

impl OwnReference {
    fn new(chassis: &Chassis, wheels: &[Wheel; 4]) -> OwnReference {
        let mut world = PhysicsWorld::new();
        world.gravity = vector(0.0, 0.0, -GRAVITY_MPS2);
        world.integration_parameters.num_solver_iterations = 1;
        let ground = ColliderBuilder::new(SharedShape::halfspace(Vector::Z)).build();
        let aabb = ground.compute_aabb();
        let (leaf, _) = world.colliders.insert(ground).into_raw_parts();
        let handle = world.bodies.insert(chassis.rigid_body());
        world.bodies[handle].recompute_mass_properties_from_colliders(&world.colliders);
        let mut car = DynamicRayCastVehicleController::new(handle);
        car.index_up_axis = 2;
        for wheel in wheels {
            let tuning = WheelTuning {
                suspension_stiffness: wheel.stiffness,
                suspension_compression: wheel.damping,
                suspension_damping: wheel.damping,
                max_suspension_travel: wheel.travel_m,
                side_friction_stiffness: wheel.side_stiffness,
                friction_slip: wheel.friction,
                max_suspension_force: 1e6,
            };
            let (down, axle) = (vector(0.0, 0.0, -1.0), vector(0.0, -1.0, 0.0));
            let made = car.add_wheel(wheel.hub, down, axle, wheel.rest_m, wheel.radius_m, &tuning);
            (made.engine_force, made.steering) = (wheel.engine_n, wheel.steering_rad);
        }
        OwnReference {
            world,
            handle,
            ground: Bvh::from_iter(BvhBuildStrategy::Binned, [(leaf as usize, aabb)]),
            car,
        }
    }

    fn roll(&mut self, dt_s: f32) {
        let queries = QueryPipelineMut {
            dispatcher: &DefaultQueryDispatcher,
            bvh: &self.ground,
            bodies: &mut self.world.bodies,
            colliders: &mut self.world.colliders,
            filter: QueryFilter::new(),
        };
        self.car.update_vehicle(dt_s, queries);
    }

    fn step(&mut self, dt_s: f32) {
        self.world.integration_parameters.dt = dt_s;
        self.world.step();
    }

    fn motion(&self) -> ChassisMotion {
        let body = &self.world.bodies[self.handle];
        ChassisMotion {
            pose: *body.position(),
            linear: body.linvel(),
            angular: body.angvel(),
        }
    }
}

fn turned(height_m: f32, tilt_rad: [f32; 3]) -> Pose {
    let rotation = Rotation::from_scaled_axis(Vector::from_array(tilt_rad));
    Pose::from_parts(Vector::new(1.5, -0.25, height_m), rotation)
}

fn wheels(numbers: [f32; 6], steering_rad: [f32; 2], engine_n: [f32; 2]) -> [Wheel; 4] {
    let [
        hub_m,
        stiffness,
        damping,
        side_stiffness,
        friction,
        travel_m,
    ] = numbers;
    core::array::from_fn(|index| {
        let (ahead_m, axle) = if index < 2 { (1.35, 0) } else { (-1.35, 1) };
        let left_m = if index % 2 == 0 { 0.8 } else { -0.8 };
        Wheel {
            hub: Vector::new(ahead_m, left_m, hub_m),
            rest_m: 0.35,
            travel_m,
            radius_m: 0.33,
            stiffness,
            damping,
            side_stiffness,
            friction,
            engine_n: engine_n[axle],
            steering_rad: if axle == 0 { steering_rad[index] } else { 0.0 },
            load_n: 0.0,
        }
    })
}

fn chassis(pose: Pose, velocity: [f32; 6]) -> Chassis {
    let inertia = Vector::new(700.0, 2800.0, 2980.0);
    let properties = MassProperties::new(Vector::new(0.1, 0.0, 0.55), 1500.0, inertia);
    let mut chassis = Chassis::new(properties, pose, Vector::ZERO);
    chassis.place(&ChassisMotion {
        pose,
        linear: Vector::new(velocity[0], velocity[1], velocity[2]),
        angular: Vector::new(velocity[3], velocity[4], velocity[5]),
    });
    chassis
}

fn parameters(dt_s: f32) -> IntegrationParameters {
    IntegrationParameters {
        dt: dt_s,
        num_solver_iterations: 1,
        ..Default::default()
    }
}

/// Moves a car both ways and compares every step, with the loads of its wheels.
fn moves_alike(
    mut chassis: Chassis,
    mut wheels: [Wheel; 4],
    force_n: Vector,
    dt_s: f32,
) -> Result<(), TestCaseError> {
    chassis.set_force(force_n);
    let mut reference = OwnReference::new(&chassis, &wheels);
    for step in 0..STEPS {
        chassis.roll(&mut wheels, dt_s);
        reference.roll(dt_s);
        prop_assert_eq!(
            bits(&chassis.motion()),
            bits(&reference.motion()),
            "wheels, step {}",
            step
        );
        for (wheel, theirs) in wheels.iter().zip(reference.car.wheels()) {
            prop_assert_eq!(
                wheel.load_n.to_bits(),
                theirs.wheel_suspension_force.to_bits()
            );
        }
        chassis.step(&parameters(dt_s));
        reference.step(dt_s);
        prop_assert_eq!(
            bits(&chassis.motion()),
            bits(&reference.motion()),
            "step {}",
            step
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn cars_on_their_wheels_move_as_in_rapier(
        height_m in -0.1f32..0.1,
        tilt_rad in [-0.05f32..0.05, -0.05f32..0.05, -3.1f32..3.1],
        velocity in [-5f32..40.0, -5f32..5.0, -1f32..1.0, -0.5f32..0.5, -0.5f32..0.5, -1f32..1.0],
        numbers in [0.3f32..0.7, 5f32..40.0, 0.5f32..4.0, 0.0f32..1.2, 0.02f32..1.2, 0.05f32..0.3],
        steering_rad in [prop_oneof![Just(0.0f32), -0.5f32..0.5], prop_oneof![Just(0.0f32), -0.5f32..0.5]],
        engine_n in [prop_oneof![Just(0.0f32), -9e3f32..9e3], prop_oneof![Just(0.0f32), -9e3f32..9e3]],
        force_n in [-3e3f32..3e3, -3e3f32..3e3],
        dt_s in 0.002f32..0.05,
    ) {
        let chassis = chassis(turned(height_m, tilt_rad), velocity);
        let force_n = Vector::new(force_n[0], force_n[1], 0.0);
        moves_alike(chassis, wheels(numbers, steering_rad, engine_n), force_n, dt_s)?;
    }

    /// On the roof, in the air, in the ground, and faster than rapier allows.
    #[test]
    fn cars_in_any_pose_move_as_in_rapier(
        height_m in -2f32..3.0,
        tilt_rad in [-3.1f32..3.1, -3.1f32..3.1, -3.1f32..3.1],
        velocity in [-500f32..500.0, -20f32..20.0, -20f32..20.0, -90f32..90.0, -9f32..9.0, -9f32..9.0],
        numbers in [0.3f32..0.7, 5f32..40.0, 0.5f32..4.0, 0.0f32..1.2, 0.02f32..1.2, 0.05f32..0.3],
        steering_rad in [-0.5f32..0.5, -0.5f32..0.5],
        engine_n in [-9e3f32..9e3, -9e3f32..9e3],
        dt_s in 0.002f32..0.05,
    ) {
        let chassis = chassis(turned(height_m, tilt_rad), velocity);
        moves_alike(chassis, wheels(numbers, steering_rad, engine_n), Vector::ZERO, dt_s)?;
    }
}

#[test]
fn cars_at_rest_keep_the_signs_of_zeros() {
    let numbers = [0.6, 20.0, 2.0, 0.5, 0.9, 0.2];
    for tilt_rad in [0.0, 0.5, core::f32::consts::PI] {
        for zero in [0.0, -0.0] {
            let chassis = chassis(turned(0.0, [0.0, 0.0, tilt_rad]), [zero; 6]);
            let wheels = wheels(numbers, [zero; 2], [zero; 2]);
            moves_alike(chassis, wheels, Vector::ZERO, 0.0125).expect("alike");
        }
    }
}

#[test]
fn bodies_with_numbers_that_are_not_finite_stop_as_in_rapier() {
    let numbers = [0.6, 20.0, 2.0, 0.5, 0.9, 0.2];
    for force_n in [f32::INFINITY, f32::NAN, 1e38] {
        let chassis = chassis(turned(0.0, [0.0; 3]), [20.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let wheels = wheels(numbers, [0.1; 2], [100.0; 2]);
        moves_alike(chassis, wheels, Vector::X * force_n, 0.0125).expect("alike");
    }
}

/// Tumbling boxes in rows above the ground.
fn tumbling(index: usize) -> Chassis {
    let (row, column) = ((index / 4) as f32, (index % 4) as f32);
    let mut pose = turned(0.8 + 0.1 * column, [0.05 * column, 0.0, 0.1 * row]);
    pose.translation += Vector::new(4.4 * row, 1.7 * column, 0.0);
    let ahead_mps = 6.0 - 3.0 * row;
    let mut chassis = chassis(pose, [ahead_mps, 0.0, 1.0, 0.3, -0.2, 0.1 * column]);
    chassis.set_force(Vector::new(300.0 * column, -200.0, 0.0));
    chassis
}

/// Lets bodies collide for a second and returns the bits of all motions.
fn collide(mut world: CollisionWorld, bodies: usize) -> Vec<Vec<u32>> {
    let sedan = Body::shipped("sedan").expect("shipped").expect("valid");
    let shape = CollisionShape::of(&sedan);
    world.set_friction(0.9);
    for id in 0..bodies {
        world.add_colliders(ChassisId(id), &sedan, shape.colliders(0.15));
    }
    let mut all = Vec::new();
    for _ in 0..300 {
        world.step(0.003);
        all.extend((0..bodies).map(|id| bits(&world.motion(ChassisId(id)))));
    }
    all
}

#[test]
fn bodies_that_begin_to_collide_go_on_as_if_rapier_had_moved_them_before() {
    const BODIES: usize = 12;
    for steps in [0, 1, 20] {
        let mut alone: Vec<Chassis> = (0..BODIES).map(tumbling).collect();
        let mut stepped = CollisionWorld::new(&alone, &[], parameters(0.0125));
        for _ in 0..steps {
            stepped.step(0.0125);
            alone
                .iter_mut()
                .for_each(|one| one.step(&parameters(0.0125)));
        }
        let made = CollisionWorld::new(&alone, &[], parameters(0.0125));
        let made = collide(made, BODIES);
        let moved = made.first() != made.last();
        assert!(moved && made == collide(stepped, BODIES), "{steps} steps");
    }
}
