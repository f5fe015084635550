//! What the plants cost, beside bare rapier stepping of the same cars.
//!
//! `cargo bench --bench plants`; every line is one physics step of all cars,
//! unless it says otherwise. `bare_lean` steps the cars of the rigid plant with
//! rapier's pipeline and controller (rays against the ground only, no colliders);
//! `bare_usual` is rapier as one would set it up first, colliders included.

use brakecheck::rl::{Control, Env};
use brakecheck::scene::{BodyCommand, Pose};
use brakecheck::seed::Purpose;
use brakecheck::testbench::Gym;
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_sim::sim::{Body, BodyId, GRAVITY_MPS2, Ground, Kinematic, Plant, Rigid, plant};
use divan::{Bencher, black_box};
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::DefaultQueryDispatcher;
use rapier3d::control::{DynamicRayCastVehicleController, WheelTuning};
use rapier3d::prelude::*;

const STEP_S: f64 = 0.0125;
const DRY: Ground = Ground { friction: 0.9 };

fn main() {
    divan::main();
}

/// Cars 30 m apart, of which every other one brakes a little now and then.
fn pose(index: usize) -> Pose {
    Pose {
        x_m: 30.0 * index as f64,
        y_m: 0.0,
        heading_rad: 0.0,
    }
}

fn sedan() -> Body {
    Body::shipped("sedan").expect("shipped").expect("valid")
}

fn populate(plant: &mut dyn Plant, cars: usize) {
    let body = sedan();
    for index in 0..cars {
        plant.spawn(&body, pose(index), 20.0);
    }
}

/// One decision's worth of commands: accelerate and brake in turn.
fn commands(plant: &mut dyn Plant, cars: usize, sample: usize) {
    let accel_mps2 = if (sample / 20).is_multiple_of(2) {
        1.0
    } else {
        -1.0
    };
    for index in 0..cars {
        let command = BodyCommand::Drive {
            accel_mps2,
            curvature_per_m: 0.0,
        };
        plant.command(BodyId(index), command);
    }
}

/// Bare rapier: ray-cast cars and the pipeline, nothing else.
struct Bare {
    world: PhysicsWorld,
    cars: Vec<DynamicRayCastVehicleController>,
    lean_ground: Option<Bvh>,
}

impl Bare {
    fn new(cars: usize, lean: bool) -> Bare {
        let body = sedan();
        let vehicle = body.vehicle().expect("a car").clone();
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::Z * -(GRAVITY_MPS2 as f32);
        world.integration_parameters.num_solver_iterations = 1;
        world.integration_parameters.dt = STEP_S as f32;
        let ground = ColliderBuilder::new(SharedShape::halfspace(Vector::Z)).build();
        let aabb = ground.compute_aabb();
        let (leaf, _) = world.colliders.insert(ground).into_raw_parts();
        let lean_ground =
            lean.then(|| Bvh::from_iter(BvhBuildStrategy::Binned, [(leaf as usize, aabb)]));
        let half = Vector::new(2.27, 0.9, 0.6);
        let inertia = Vector::new(700.0, 2800.0, 2980.0);
        let com = Vector::new(0.0, 0.0, body.com_height_m as f32);
        let omega = core::f64::consts::TAU * vehicle.suspension_hz;
        let tuning = WheelTuning {
            suspension_stiffness: (0.25 * omega * omega) as f32,
            suspension_compression: (0.25 * omega) as f32,
            suspension_damping: (0.25 * omega) as f32,
            max_suspension_travel: 0.2,
            side_friction_stiffness: 1.0,
            friction_slip: 0.9,
            max_suspension_force: 1e6,
        };
        let hub_m = (vehicle.suspension_rest_m - vehicle.sag_m() + vehicle.wheel_radius_m) as f32;
        let mut controllers = Vec::new();
        for index in 0..cars {
            let chassis = RigidBodyBuilder::dynamic()
                .translation(Vector::new(30.0 * index as f32, 0.0, 0.0))
                .linvel(Vector::X * 20.0)
                .additional_mass_properties(MassProperties::new(com, body.mass_kg as f32, inertia))
                .can_sleep(false);
            let handle = world.bodies.insert(chassis);
            if !lean {
                let hull = ColliderBuilder::cuboid(half.x, half.y, half.z)
                    .translation(Vector::Z * 0.85)
                    .density(0.0);
                world
                    .colliders
                    .insert_with_parent(hull, handle, &mut world.bodies);
            }
            let mut car = DynamicRayCastVehicleController::new(handle);
            car.index_up_axis = 2;
            car.index_forward_axis = 0;
            for (x, y) in [(1.35, 0.78), (1.35, -0.78), (-1.35, 0.78), (-1.35, -0.78)] {
                let at = Vector::new(x, y, hub_m);
                car.add_wheel(at, -Vector::Z, -Vector::Y, 0.35, 0.33, &tuning);
            }
            controllers.push(car);
        }
        // Fills mass properties and the broad phase.
        world.step();
        Bare {
            world,
            cars: controllers,
            lean_ground,
        }
    }

    fn step(&mut self, force_n: f32) {
        for car in &mut self.cars {
            for wheel in car.wheels_mut() {
                wheel.engine_force = 0.25 * force_n;
            }
            let world = &mut self.world;
            let queries = match &self.lean_ground {
                Some(bvh) => QueryPipelineMut {
                    dispatcher: &DefaultQueryDispatcher,
                    bvh,
                    bodies: &mut world.bodies,
                    colliders: &mut world.colliders,
                    filter: QueryFilter::new(),
                },
                None => world.broad_phase.as_query_pipeline_mut(
                    &DefaultQueryDispatcher,
                    &mut world.bodies,
                    &mut world.colliders,
                    QueryFilter::exclude_dynamic().exclude_rigid_body(car.chassis),
                ),
            };
            car.update_vehicle(STEP_S as f32, queries);
        }
        self.world.step();
    }
}

/// Bare steps, 4 per sample as the plant is asked for.
fn bare(bencher: Bencher, cars: usize, lean: bool) {
    let mut bare = Bare::new(cars, lean);
    let mut sample = 0;
    bencher.counter(4_u32).bench_local(|| {
        sample += 1;
        let force_n = if (sample / 20) % 2 == 0 {
            1500.0
        } else {
            -1500.0
        };
        for _ in 0..4 {
            bare.step(force_n);
        }
    });
}

#[divan::bench(args = [2, 8])]
fn bare_usual(bencher: Bencher, cars: usize) {
    bare(bencher, cars, false);
}

#[divan::bench(args = [2, 8, 128])]
fn bare_lean(bencher: Bencher, cars: usize) {
    bare(bencher, cars, true);
}

/// A sample: commands, an `advance` of 4 steps, and all states.
fn sample(bencher: Bencher, plant: &mut dyn Plant, cars: usize, counted: u32) {
    populate(plant, cars);
    let mut index = 0;
    bencher.counter(counted).bench_local(|| {
        index += 1;
        // Start over before f32 positions grow coarse.
        if index % 400 == 0 {
            plant.clear(DRY);
            populate(plant, cars);
        }
        commands(plant, cars, index);
        black_box(plant.advance(4.0 * STEP_S, 4));
        for body in 0..cars {
            black_box(plant.state(BodyId(body)));
        }
    });
}

/// Counted in physics steps, like the bare lines.
#[divan::bench(args = [2, 8])]
fn rigid_advance(bencher: Bencher, cars: usize) {
    sample(bencher, &mut Rigid::new(DRY), cars, 4);
}

/// Counted in samples.
#[divan::bench(args = [2, 8])]
fn kinematic_sample(bencher: Bencher, cars: usize) {
    sample(bencher, &mut Kinematic::new(DRY), cars, 1);
}

/// Side by side: circles meet, so the separating axes decide every sample.
#[divan::bench]
fn kinematic_sample_abreast(bencher: Bencher) {
    let (mut plant, body) = (Kinematic::new(DRY), sedan());
    for y_m in [0.0, 3.5] {
        plant.spawn(
            &body,
            Pose {
                y_m,
                ..Pose::default()
            },
            20.0,
        );
    }
    let mut index = 0;
    bencher.counter(1_u32).bench_local(|| {
        index += 1;
        commands(&mut plant, 2, index);
        black_box(plant.advance(0.05, 4));
        black_box((plant.state(BodyId(0)), plant.state(BodyId(1))));
    });
}

#[divan::bench(args = [PlantKind::Rigid, PlantKind::Kinematic])]
fn clear_and_spawn_two(bencher: Bencher, kind: PlantKind) {
    let (mut plant, body) = (plant(kind, DRY), sedan());
    bencher.bench_local(|| {
        plant.clear(DRY);
        for index in 0..2 {
            plant.spawn(&body, pose(index), 20.0);
        }
    });
}

#[divan::bench(args = [PlantKind::Rigid, PlantKind::Kinematic])]
fn fork_two(bencher: Bencher, kind: PlantKind) {
    let mut plant = plant(kind, DRY);
    populate(plant.as_mut(), 2);
    plant.advance(0.05, 4);
    bencher.bench_local(|| plant.fork());
}

fn acc(kind: PlantKind) -> Scenario {
    let text = include_str!("../worlds/acc.ron");
    Scenario::parse("acc.ron", text).expect("a world").on(kind)
}

/// The environment of a learner: plant, ego, signals, monitors, judge and reward.
///
/// Counted in physics steps: compare with `bare_lean` and `bare_usual`.
#[divan::bench(args = [PlantKind::Rigid, PlantKind::Kinematic])]
fn environment(bencher: Bencher, kind: PlantKind) {
    let bench = acc(kind).bench();
    let neutral = bench.spaces().neutral;
    let steps = bench.clock().samples_per_decision() as u32 * bench.clock().substeps;
    let mut obs = vec![0.0; bench.spaces().observation];
    let mut gym = Gym::new(bench, Purpose::Train, 0);
    let mut episode = 0;
    gym.reset(episode, &mut obs);
    bencher.counter(steps).bench_local(|| {
        // Coasting runs nearly always to the horizon: full decisions.
        if gym.step(neutral, &mut obs).end.is_some() {
            episode += 1;
            gym.reset(episode, &mut obs);
        }
    });
}

/// Training with recipe R, learning included; counted in decisions.
#[divan::bench(args = [PlantKind::Kinematic, PlantKind::Rigid], sample_count = 3, sample_size = 1)]
fn training(bencher: Bencher, kind: PlantKind) {
    const DECISIONS: u64 = 40_000;
    let world = acc(kind);
    bencher.counter(DECISIONS).bench_local(|| {
        let config = world
            .learner()
            .clone()
            .with_decisions(DECISIONS)
            .expect("in range");
        let mut gym = Gym::new(world.bench(), Purpose::Train, 0);
        let mut learner = config.build(gym.spaces(), 0);
        learner.train(&mut gym, &mut |_| Control::Continue);
    });
}
