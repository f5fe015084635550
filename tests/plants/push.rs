//! Slopes and wind as external accelerations, on both plants, by hand.

use brakecheck_sim::sim::Push;

use super::*;

/// A slope of 6 %: its sine and cosine.
const SLOPE: (f64, f64) = (0.059_892_3, 0.998_204_8);

/// Downhill along the heading.
fn downhill() -> Push {
    Push {
        along_mps2: GRAVITY_MPS2 * SLOPE.0,
        left_mps2: 0.0,
        grade_mps2: [GRAVITY_MPS2 * SLOPE.0, 0.0],
        load_share: SLOPE.1,
    }
}

fn uphill() -> Push {
    Push {
        along_mps2: -GRAVITY_MPS2 * SLOPE.0,
        grade_mps2: [-GRAVITY_MPS2 * SLOPE.0, 0.0],
        ..downhill()
    }
}

fn on(kind: PlantKind, ground: Ground, name: &str, (speed_mps, push): (f64, Push)) -> Alone {
    let mut alone = Alone::new(kind, ground, name, speed_mps);
    alone.plant.push(BodyId(0), push);
    alone
}

#[test]
fn a_car_and_a_bicyclist_coast_down_by_g_sin_t() {
    for kind in KINDS {
        for (name, speed_mps) in [("sedan", 10.0), ("bicyclist", 4.0)] {
            let mut alone = on(kind, DRY, name, (speed_mps, downhill()));
            alone.run(drive(0.0, 0.0), 5.0);
            let expected_mps = speed_mps + GRAVITY_MPS2 * SLOPE.0 * 5.0;
            close(alone.state().speed_mps, expected_mps, 1e-3, name);
            let way_m = 5.0 * 0.5 * (speed_mps + expected_mps);
            close(alone.state().pose.x_m, way_m, 0.01, name);
        }
        // The rider keeps to the top speed of 10 m/s.
        let mut rider = on(kind, DRY, "bicyclist", (9.0, downhill()));
        rider.run(drive(0.0, 0.0), 5.0);
        close(rider.state().speed_mps, 10.0, 1e-9, "top speed");
    }
}

#[test]
fn full_braking_is_mu_g_cos_without_g_sin_downhill_and_with_it_uphill() {
    for kind in KINDS {
        for (push, sign) in [(downhill(), -1.0), (uphill(), 1.0)] {
            let mut car = on(kind, WET, "sedan", (20.0, push));
            car.run(drive(-20.0, 0.0), 2.0);
            let brake_mps2 = GRAVITY_MPS2 * (0.4 * SLOPE.1 + sign * SLOPE.0);
            let expected_mps = 20.0 - 2.0 * brake_mps2;
            close(car.state().speed_mps, expected_mps, 0.02, "braking");
        }
    }
}

#[test]
fn a_car_that_rolls_to_a_stop_uphill_is_held_there() {
    for kind in KINDS {
        let mut car = on(kind, DRY, "sedan", (2.0, uphill()));
        // 2 m/s at 0.5875 m/s²: 3.40 m in 3.4 s.
        car.run(drive(0.0, 0.0), 4.0);
        let at_m = car.state().pose.x_m;
        close(
            at_m,
            2.0 * 2.0 / (2.0 * GRAVITY_MPS2 * SLOPE.0),
            0.02,
            "way",
        );
        car.run(drive(0.0, 0.0), 4.0);
        close(car.state().pose.x_m, at_m, 0.01, "held");
        // The throttle overcomes the slope.
        car.run(drive(1.5, 0.0), 2.0);
        let expected_mps = 2.0 * (1.5 - GRAVITY_MPS2 * SLOPE.0);
        close(car.state().speed_mps, expected_mps, 0.02, "starts");
    }
}

#[test]
fn no_push_changes_no_bit() {
    for kind in KINDS {
        for name in ["sedan", "truck", "bicyclist"] {
            let mut still = Alone::new(kind, DRY, name, 5.0);
            let mut pushed = on(kind, DRY, name, (5.0, Push::NONE));
            for (accel_mps2, curvature_per_m) in [(1.0, 0.02), (-3.0, -0.01), (0.0, 0.0)] {
                let command = drive(accel_mps2, curvature_per_m);
                let states = still.run(command, 2.0);
                pushed.plant.push(BodyId(0), Push::NONE);
                assert_eq!(states, pushed.run(command, 2.0), "{kind:?} {name}");
            }
        }
    }
}

#[test]
fn a_side_push_beyond_the_grip_slides_a_rigid_car_and_no_kinematic_one() {
    // On ice of μ = 0.1 the tyres give 0.98 m/s² against 3 m/s².
    let ice = Ground { friction: 0.1 };
    let gust = Push {
        left_mps2: 3.0,
        ..Push::NONE
    };
    let mut car = on(PlantKind::Rigid, ice, "sedan", (15.0, gust));
    car.run(drive(0.0, 0.0), 1.0);
    let expected_m = 0.5 * (3.0 - 0.1 * GRAVITY_MPS2);
    close(car.state().pose.y_m, expected_m, 0.1 * expected_m, "slid");
    // With grip the tyres take up the push at once.
    let mut car = on(PlantKind::Rigid, DRY, "sedan", (15.0, gust));
    car.run(drive(0.0, 0.0), 1.0);
    let aside_m = car.state().pose.y_m;
    assert!(aside_m > 0.0 && aside_m < 0.2, "{aside_m}");
    let mut car = on(PlantKind::Kinematic, ice, "sedan", (15.0, gust));
    car.run(drive(0.0, 0.0), 1.0);
    assert_eq!(car.state().pose.y_m, 0.0);
}

#[test]
fn pushes_fork_and_end_with_the_bodies() {
    for kind in KINDS {
        let gust = Push {
            left_mps2: 2.0,
            ..downhill()
        };
        let mut car = on(kind, DRY, "sedan", (10.0, gust));
        car.run(drive(1.0, 0.01), 1.0);
        let mut fork = Alone {
            plant: car.plant.fork(),
        };
        let command = drive(-1.0, 0.0);
        assert_eq!(car.run(command, 1.0), fork.run(command, 1.0), "{kind:?}");
        car.plant.push(BodyId(0), Push::NONE);
        let speed_mps = car.state().speed_mps;
        car.run(drive(0.0, 0.0), 1.0);
        close(car.state().speed_mps, speed_mps, 1e-3, "flat again");
        car.plant.push(
            BodyId(0),
            Push {
                along_mps2: f64::NAN,
                ..Push::NONE
            },
        );
        assert!(!car.plant.sound(), "{kind:?}");
    }
}

#[test]
fn pedestrians_ignore_slopes() {
    for kind in KINDS {
        let walk = BodyCommand::Walk {
            x_mps: 1.5,
            y_mps: 0.0,
        };
        let mut flat = Alone::new(kind, DRY, "pedestrian", 0.0);
        let mut slope = on(kind, DRY, "pedestrian", (0.0, uphill()));
        assert_eq!(flat.run(walk, 2.0), slope.run(walk, 2.0));
    }
}
