//! The bodies with brakes and tyres of their own, beside published figures.
//!
//! "Published" is a figure of a test or a regulation. "Reference" is what the multi-body
//! model of the CommonRoad vehicle models (version 3.0.2, vehicle 2) returns, integrated
//! with Runge-Kutta steps of 0.4 to 1 ms. Its parameters are those of `bmw_320i`, and
//! its wheels, springs and tyres (Pacejka's full formulas) are its own. It has no
//! antilock brakes: for the stops, each of its wheels was held at the slip of its peak.

use brakecheck_sim::sim::Vehicle;

use super::*;

const STEP_S: f64 = 0.01;
/// Wet friction as a share of dry friction: 0.65 of 0.85 at 50 km/h, new tyres in 0.2 mm
/// of water (Bosch, Automotive Handbook).
const WET_SHARE: f64 = 0.765;
const ICE: f64 = 0.15;

fn alone(name: &str, friction: f64, speed_kmh: f64) -> Alone {
    spawned(&body(name), friction, speed_kmh)
}

fn spawned(body: &Body, friction: f64, speed_kmh: f64) -> Alone {
    let mut plant = plant(PlantKind::Rigid, Ground { friction });
    plant.spawn(body, Pose::default(), speed_kmh / 3.6);
    Alone { plant }
}

impl Alone {
    /// Obeys one command for a step.
    fn step(&mut self, command: BodyCommand) -> BodyState {
        self.plant.command(BodyId(0), command);
        assert_eq!(self.plant.advance(STEP_S, 1), None);
        self.state()
    }

    /// Brakes with all it has and returns the distance from the command to the stop.
    fn stop_m(&mut self) -> f64 {
        let from_m = self.state().pose.x_m;
        while self.step(drive(-20.0, 0.0)).speed_mps > 0.0 {}
        close(self.state().pose.y_m, 0.0, 0.05, "straight on");
        self.state().pose.x_m - from_m
    }
}

fn stop_m(name: &str, friction: f64, speed_kmh: f64) -> f64 {
    alone(name, friction, speed_kmh).stop_m()
}

/// Compares with a share of tolerance.
fn near(got: f64, want: f64, share: f64, what: &str) {
    println!(
        "{what}: {got:.4} beside {want:.4} ({:+.1} %)",
        100.0 * (got / want - 1.0)
    );
    close(got, want, share * want, what);
}

#[test]
fn stops_of_the_bmw_are_those_of_the_reference() {
    for (friction, speed_kmh, want_m) in [
        (1.0, 50.0, 9.83),
        (1.0, 80.0, 23.84),
        (1.0, 100.0, 36.57),
        (WET_SHARE, 50.0, 12.03),
        (WET_SHARE, 80.0, 30.29),
        (WET_SHARE, 100.0, 47.80),
        (ICE, 50.0, 56.20),
        (ICE, 80.0, 143.65),
        (ICE, 100.0, 224.34),
    ] {
        let what = format!("stop from {speed_kmh} km/h at {friction}");
        near(stop_m("bmw_320i", friction, speed_kmh), want_m, 0.05, &what);
    }
}

#[test]
fn stops_of_the_bmw_are_those_of_tested_cars() {
    for (friction, speed_kmh, want_m, source) in [
        (1.0, 80.0, 23.2, "VW Golf, laden (ADAC 2015)"),
        (1.0, 80.0, 23.5, "BMW X3, laden (ADAC 2015)"),
        (1.0, 100.0, 36.0, "new tyres (Continental 2018)"),
        (1.0, 100.0, 35.6, "mean of Diesel cars (ADAC 2021)"),
        (WET_SHARE, 100.0, 48.0, "wet, new tyres (Continental 2018)"),
    ] {
        near(
            stop_m("bmw_320i", friction, speed_kmh),
            want_m,
            0.05,
            source,
        );
    }
}

#[test]
fn the_lorry_stops_later_than_the_car_and_within_the_law() {
    let lorry_m = stop_m("lorry_40t", 1.0, 80.0);
    near(lorry_m, 36.2, 0.05, "DAF XF, 40 t (ADAC 2015)");
    assert!(lorry_m > 1.4 * stop_m("bmw_320i", 1.0, 80.0));
    // UN R13, type 0: 0.15·v + v²/130. FMVSS 121: 250 ft from 60 mph.
    assert!(lorry_m < 0.15 * 80.0 + 80.0 * 80.0 / 130.0);
    assert!(stop_m("lorry_40t", 1.0, 96.56) < 250.0 * 0.3048);
    // UN R13-H: 0.1·v + 0.006·v².
    assert!(stop_m("bmw_320i", 1.0, 100.0) < 0.1 * 100.0 + 0.006 * 100.0 * 100.0);
}

/// Yaw rate of a steered step: steady state, and time from half the angle to 90 % of it.
fn step_steer(body: &Body, speed_kmh: f64, angle_rad: f64) -> (f64, f64) {
    let wheelbase_m = body.vehicle().expect("a car").wheelbase_m;
    let mut car = spawned(body, 1.0, speed_kmh);
    let command = drive(0.0, angle_rad.tan() / wheelbase_m);
    let rates: Vec<f64> = (0..400)
        .map(|_| car.step(command).yaw_rate_rad_per_s)
        .collect();
    let steady = rates[350..].iter().sum::<f64>() / 50.0;
    let after = rates.iter().position(|rate| *rate >= 0.9 * steady);
    let rise_s = STEP_S * (after.expect("a rise") + 1) as f64 - 0.5 * angle_rad / 0.4;
    (steady, rise_s)
}

#[test]
fn a_steered_step_turns_the_bmw_as_the_reference() {
    for (speed_kmh, angle_rad, want_rad_per_s, want_s) in [
        (50.0, 0.05343, 0.2898, 0.186),
        (80.0, 0.01044, 0.0918, 0.257),
        (80.0, 0.02089, 0.1825, 0.264),
        (80.0, 0.03132, 0.2697, 0.264),
        (100.0, 0.01337, 0.1472, 0.320),
        (100.0, 0.02005, 0.2158, 0.311),
    ] {
        let what = format!("step of {angle_rad} rad at {speed_kmh} km/h");
        let (steady, rise_s) = step_steer(&body("bmw_320i"), speed_kmh, angle_rad);
        near(steady, want_rad_per_s, 0.05, &format!("{what}, steady"));
        near(rise_s, want_s, 0.2, &format!("{what}, rise"));
    }
}

/// Yaw rate after some seconds of braking in a bend, over that of wheels without slip.
fn turn_in(body: &Body, case: (f64, f64, f64), after_s: f64) -> f64 {
    let (speed_kmh, angle_rad, brake_mps2) = case;
    let wheelbase_m = body.vehicle().expect("a car").wheelbase_m;
    let mut car = spawned(body, 1.0, speed_kmh);
    let curvature_per_m = angle_rad.tan() / wheelbase_m;
    for _ in 0..400 {
        car.step(drive(0.0, curvature_per_m));
    }
    for _ in 0..(after_s / STEP_S).round() as usize {
        car.step(drive(-brake_mps2, curvature_per_m));
    }
    let state = car.state();
    state.yaw_rate_rad_per_s / (state.speed_mps * curvature_per_m)
}

#[test]
fn braking_in_a_bend_turns_the_bmw_in_as_the_reference() {
    // The load moves to the front wheels, which then turn the car more than before.
    for (case, after_s, want) in [
        ((80.0, 0.02089, 4.0), 0.3, 1.428),
        ((80.0, 0.02089, 4.0), 0.75, 1.711),
        ((80.0, 0.02089, 6.0), 0.3, 1.573),
        ((80.0, 0.02089, 6.0), 0.75, 1.71),
        ((100.0, 0.01003, 5.0), 0.3, 1.704),
        ((100.0, 0.01003, 5.0), 0.75, 2.7),
    ] {
        let got = turn_in(&body("bmw_320i"), case, after_s);
        near(got, want, 0.2, &format!("{case:?} after {after_s} s"));
    }
}

/// The BMW with a changed body.
fn faulty(change: impl FnOnce(&mut Body)) -> Body {
    let mut it = body("bmw_320i");
    change(&mut it);
    it
}

/// The BMW with changed data of its kind.
fn faulty_vehicle(change: impl FnOnce(&mut Vehicle)) -> Body {
    faulty(|it| {
        let BodyKind::Vehicle(vehicle) = &mut it.kind else {
            panic!("a car")
        };
        change(vehicle);
    })
}

#[test]
fn the_checks_see_faults_of_the_model() {
    let stop_m = |body: &Body| spawned(body, 1.0, 80.0).stop_m();
    let off = |got: f64, want: f64| (got / want - 1.0).abs();
    let sudden = faulty_vehicle(|vehicle| vehicle.brakes = None);
    assert!(off(stop_m(&sudden), 23.84) > 0.05, "no build-up");
    let slack = faulty_vehicle(|vehicle| {
        if let Some(brakes) = &mut vehicle.brakes {
            brakes.delay_s = 0.1;
        }
    });
    assert!(off(stop_m(&slack), 23.84) > 0.05, "dead time");
    let weak = faulty_vehicle(|vehicle| {
        if let Some(tyres) = &mut vehicle.tyres {
            tyres.mu_along = 1.05;
        }
    });
    assert!(
        off(stop_m(&weak), 23.84) > 0.05,
        "the other direction's friction"
    );
    let low = faulty(|it| it.com_height_m = 0.02);
    let turned = turn_in(&low, (80.0, 0.02089, 4.0), 0.75);
    assert!(off(turned, 1.711) > 0.2, "no load transfer: {turned}");
    let stiff = faulty_vehicle(|vehicle| vehicle.tyres = None);
    let (_, rise_s) = step_steer(&stiff, 80.0, 0.02089);
    assert!(off(rise_s, 0.264) > 0.2, "no slip: {rise_s}");
    let front = faulty_vehicle(|vehicle| {
        if let Some(tyres) = &mut vehicle.tyres {
            tyres.cornering_per_rad.0 *= 0.8;
        }
    });
    let (steady, _) = step_steer(&front, 80.0, 0.02089);
    assert!(off(steady, 0.1825) > 0.05, "soft front tyres: {steady}");
}

#[test]
fn side_grip_is_limited_and_shared_with_the_brakes() {
    for (friction, share) in [(1.0, 1.0), (0.3, 0.3)] {
        let mut car = alone("bmw_320i", friction, 72.0);
        let tightest = (0..300).map(|_| {
            let state = car.step(drive(0.0, 0.1));
            state.speed_mps * state.yaw_rate_rad_per_s / GRAVITY_MPS2
        });
        let most_g = tightest.skip(100).fold(0.0, f64::max);
        assert!(most_g < 1.1 * 1.0489 * share, "{most_g} at {friction}");
        assert!(most_g > 0.7 * 1.0489 * share, "{most_g} at {friction}");
    }
    // All grip along leaves little across: the path of a braking car is straighter.
    let drift_m = |brake_mps2: f64| {
        let mut car = alone("bmw_320i", 0.3, 72.0);
        for _ in 0..100 {
            car.step(drive(-brake_mps2, 0.005));
        }
        car.state().pose.y_m
    };
    assert!(
        drift_m(20.0) < 0.7 * drift_m(0.0),
        "{} {}",
        drift_m(20.0),
        drift_m(0.0)
    );
}

#[test]
fn forks_of_slipping_cars_continue_bit_for_bit() {
    let stir = |plant: &mut dyn Plant, samples: core::ops::Range<usize>| {
        let mut states = Vec::new();
        for sample in samples {
            let wave = (sample as f64 * 0.2).sin();
            for index in 0..2 {
                plant.command(BodyId(index), drive(6.0 * wave - 2.0, 0.01 * wave));
            }
            plant.advance(SAMPLE_S, 4);
            states.extend((0..2).map(|index| plant.state(BodyId(index))));
        }
        assert!(plant.sound());
        states
    };
    let mut plant = plant(PlantKind::Rigid, WET);
    let spawn = |plant: &mut dyn Plant| {
        plant.spawn(&body("bmw_320i"), Pose::default(), 25.0);
        plant.spawn(&body("lorry_40t"), at(0.0, 8.0, 0.0), 20.0);
    };
    spawn(plant.as_mut());
    let first = stir(plant.as_mut(), 0..37);
    let mut fork = plant.fork();
    assert!(stir(plant.as_mut(), 37..80) == stir(fork.as_mut(), 37..80));
    // A cleared plant has brakes and steering at rest.
    plant.clear(WET);
    spawn(plant.as_mut());
    assert!(stir(plant.as_mut(), 0..37) == first);
}

#[test]
fn a_contact_rewinds_slipping_cars() {
    // Whatever the steps, the contact is at the same time and speed.
    let contacts = [1, 2, 4, 8].map(|substeps| {
        let mut plant = plant(PlantKind::Rigid, DRY);
        let behind = plant.spawn(&body("bmw_320i"), Pose::default(), 25.0);
        plant.spawn(&body("sedan"), at(24.54, 0.0, 0.0), 0.0);
        plant.command(behind, drive(-20.0, 0.0));
        for sample in 0..60 {
            if let Some(contact) = plant.advance(SAMPLE_S, substeps) {
                let time_s = f64::from(sample) * SAMPLE_S + contact.after_s;
                return (time_s, plant.state(behind).speed_mps);
            }
        }
        panic!("no contact")
    });
    let (want_s, want_mps) = contacts[3];
    for (time_s, speed_mps) in contacts {
        close(time_s, want_s, 0.01, "time of contact");
        close(speed_mps, want_mps, 0.2, "speed at contact");
    }
}

#[test]
fn slipping_bodies_stand_park_corner_and_stop() {
    for name in ["bmw_320i", "lorry_40t"] {
        let mut car = alone(name, 1.0, 0.0);
        for _ in 0..300 {
            let state = car.step(drive(-5.0, 0.05));
            close(state.speed_mps, 0.0, 1e-4, "standing");
            close(state.lateral_mps, 0.0, 1e-4, "standing");
        }
        // Off at walking pace, in a tight turn: no oscillation of the slip angles.
        let curvature_per_m = 0.05;
        for _ in 0..400 {
            car.step(drive(1.0, curvature_per_m));
        }
        for speed_mps in [4.0_f64, 2.0, 1.0] {
            while car.state().speed_mps > speed_mps {
                car.step(drive(-1.0, curvature_per_m));
            }
            for _ in 0..20 {
                let state = car.step(drive(0.0, curvature_per_m));
                let turned = state.yaw_rate_rad_per_s / (state.speed_mps * curvature_per_m);
                close(turned, 1.0, 0.1, &format!("{name} at {speed_mps} m/s"));
            }
        }
        // Full lock at speed: it slides, but neither tips over nor breaks.
        let mut car = alone(name, 1.0, 80.0);
        for command in [drive(0.0, 0.5), drive(-20.0, -0.5)] {
            for _ in 0..300 {
                car.step(command);
                let rotation = car.plant.placement(BodyId(0)).rotation;
                let tilt = libm::hypot(rotation.i, rotation.j);
                assert!(tilt < 0.1, "{name} tips over: {tilt}");
            }
        }
        assert!(car.plant.sound());
    }
}

#[test]
fn the_kinematic_plant_ignores_brakes_and_tyres() {
    let plain = faulty_vehicle(|vehicle| {
        (vehicle.brakes, vehicle.tyres) = (None, None);
        (vehicle.steer_rate_rad_per_s, vehicle.yaw_inertia_kg_m2) = (None, None);
    });
    let run = |body: &Body| {
        let mut plant = plant(PlantKind::Kinematic, DRY);
        plant.spawn(body, Pose::default(), 20.0);
        plant.command(BodyId(0), drive(-4.0, 0.01));
        plant.advance(1.0, 4);
        plant.state(BodyId(0))
    };
    assert!(run(&plain) == run(&body("bmw_320i")));
}
