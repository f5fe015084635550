//! One test per fault, named after what happened or would happen.

use super::*;

#[test]
fn a_spawned_car_neither_drops_nor_bounces() {
    // Springs start compressed, and rays see the ground before the first step.
    for name in ["sedan", "van", "truck", "motorcycle"] {
        let mut car = Alone::new(PlantKind::Rigid, DRY, name, 20.0);
        let height_m = 0.5 * body(name).height_m;
        for _ in 0..40 {
            car.run(drive(0.0, 0.0), SAMPLE_S);
            close(
                car.plant.placement(BodyId(0)).centre_m[2],
                height_m,
                1e-4,
                name,
            );
        }
    }
}

#[test]
fn solver_iterations_give_a_standing_car_no_phantom_velocity() {
    // Four iterations at 0.05 s showed 0.18 m/s downwards.
    for substeps in [1, 2, 4, 8] {
        let mut car = Alone::new(PlantKind::Rigid, DRY, "sedan", 0.0);
        for _ in 0..200 {
            car.plant.advance(SAMPLE_S, substeps);
            close(
                car.plant.placement(BodyId(0)).centre_m[2],
                0.725,
                1e-4,
                "height",
            );
            close(car.state().speed_mps, 0.0, 1e-6, "speed");
        }
    }
}

#[test]
fn a_car_that_stood_for_a_minute_drives_off() {
    for (accel_mps2, speed_mps) in [(2.0, 2.0), (0.1, 0.1)] {
        let mut car = Alone::new(PlantKind::Rigid, DRY, "sedan", 0.0);
        car.run(drive(-5.0, 0.0), 60.0);
        car.run(drive(accel_mps2, 0.0), 1.0);
        close(car.state().speed_mps, speed_mps, 1e-3, "it fell asleep");
    }
}

#[test]
fn grip_is_not_twice_the_friction() {
    // rapier halves forward impulses before it compares them with the grip.
    for friction in [0.2, 0.5, 1.0] {
        let ground = Ground { friction };
        for accel_mps2 in [-15.0, 15.0] {
            let mut car = Alone::new(PlantKind::Rigid, ground, "sedan", 2.0);
            car.run(drive(accel_mps2, 0.0), 0.1);
            let want_mps2 = friction * GRAVITY_MPS2 * accel_mps2.signum();
            close(car.state().accel_mps2, want_mps2, 1e-3, "grip");
        }
    }
}

#[test]
fn braking_works_right_after_full_throttle() {
    // A leftover engine force would override rapier's brake.
    let mut car = Alone::new(PlantKind::Rigid, DRY, "sedan", 20.0);
    car.run(drive(4.0, 0.0), 1.0);
    car.run(drive(-8.0, 0.0), SAMPLE_S);
    close(car.state().accel_mps2, -8.0, 1e-3, "brake");
}

#[test]
fn braking_force_does_not_depend_on_the_step() {
    // rapier's brake is an impulse per step, not a force.
    for substeps in [1, 4, 10] {
        let mut car = Alone::new(PlantKind::Rigid, DRY, "sedan", 20.0);
        car.plant.command(BodyId(0), drive(-3.0, 0.0));
        (0..20).for_each(|_| assert_eq!(car.plant.advance(SAMPLE_S, substeps), None));
        close(car.state().speed_mps, 17.0, 1e-3, "speed after 1 s");
    }
}

#[test]
fn curvature_hardly_depends_on_the_step() {
    // Side grip is a velocity correction per step, so slip grows with the step.
    for substeps in [3, 4, 5, 10] {
        let mut car = Alone::new(PlantKind::Rigid, DRY, "sedan", 15.0);
        car.plant.command(BodyId(0), drive(0.0, 0.03));
        (0..100).for_each(|_| assert_eq!(car.plant.advance(SAMPLE_S, substeps), None));
        close(
            car.lateral_g(),
            225.0 * 0.03 / GRAVITY_MPS2,
            0.005,
            "lateral acceleration",
        );
    }
}

#[test]
fn front_wheels_do_not_fight_each_other_in_a_tight_turn() {
    // Steered in parallel, they lost 12 % of the curvature at 28° of lock.
    let mut car = Alone::new(PlantKind::Rigid, DRY, "sedan", 5.0);
    car.run(drive(0.0, 0.19), 5.0);
    close(
        car.state().yaw_rate_rad_per_s,
        5.0 * 0.19,
        0.015,
        "yaw rate",
    );
}

#[test]
fn pitching_brings_no_bumper_nearer() {
    // The nose dives under full braking; gap and headway are of upright boxes.
    let mut plant = plant(PlantKind::Rigid, DRY);
    let sedan = body("sedan");
    let rear = plant.spawn(&sedan, Pose::default(), 20.0);
    let front = plant.spawn(&sedan, at(40.0, 0.0, 0.0), 0.0);
    plant.command(rear, drive(-9.0, 0.0));
    for _ in 0..20 {
        plant.advance(SAMPLE_S, 4);
        let headway_m = plant.state(front).pose.x_m - plant.state(rear).pose.x_m;
        close(plant.gap_m(rear, front), headway_m - 4.54, 1e-5, "gap");
    }
    let pitch = plant.placement(rear).rotation.j;
    assert!(pitch > 0.005, "but in pictures it does dive: {pitch}");
}

#[test]
fn wheels_do_not_climb_on_other_bodies() {
    // Rays that hit a neighbour or the own chassis would lift the car.
    let mut plant = plant(PlantKind::Rigid, DRY);
    let sedan = body("sedan");
    for lane in 0..4 {
        plant.spawn(&sedan, at(0.0, 1.81 * f64::from(lane), 0.0), 20.0);
    }
    for _ in 0..40 {
        assert_eq!(plant.advance(SAMPLE_S, 4), None);
        for lane in 0..4 {
            close(
                plant.placement(BodyId(lane)).centre_m[2],
                0.725,
                1e-4,
                "height",
            );
        }
    }
}

#[test]
fn far_from_the_origin_cars_still_move_smoothly() {
    // Absolute f32 positions drifted by 8 mm in 2 s at 700 m from the origin.
    let mut plant = plant(PlantKind::Rigid, DRY);
    let id = plant.spawn(&body("sedan"), at(9500.0, -9500.0, 0.3), 10.0);
    for _ in 0..100 {
        plant.advance(SAMPLE_S, 4);
        close(plant.state(id).speed_mps, 10.0, 1e-3, "speed");
    }
    close(
        plant.state(id).pose.x_m,
        9500.0 + 50.0 * 0.3_f64.cos(),
        1e-3,
        "x",
    );
    close(
        plant.state(id).pose.y_m,
        -9500.0 + 50.0 * 0.3_f64.sin(),
        1e-3,
        "y",
    );
}

#[test]
fn braking_positions_are_not_half_a_step_ahead() {
    // rapier alone puts a car ½·dt·Δv too far: 6 ms on every contact.
    for substeps in [1, 4, 20] {
        let mut car = Alone::new(PlantKind::Rigid, DRY, "sedan", 25.0);
        car.plant.command(BodyId(0), drive(-5.0, 0.0));
        (0..80).for_each(|_| assert_eq!(car.plant.advance(SAMPLE_S, substeps), None));
        close(car.state().pose.x_m, 60.0, 1e-3, "distance after 4 s");
    }
}

#[test]
fn a_long_truck_steers_neutrally() {
    // Equal side grip on unequal loads made it turn 2 % too much.
    let mut car = Alone::new(PlantKind::Rigid, DRY, "truck", 20.0);
    car.run(drive(0.0, 0.01), 5.0);
    close(car.state().yaw_rate_rad_per_s, 0.2, 0.0005, "yaw rate");
}
