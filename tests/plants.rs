//! Every plant meets the same vehicle checks.
//!
//! The checks of the first half run on both plants; those of the second half
//! each guard one fault that a plant on rapier has had or easily has.

use brakecheck::sim::{
    Body, BodyError, BodyId, BodyKind, BodyState, Command, Contact, GRAVITY_MPS2, Ground, Plant,
    PlantKind, Pose, plant,
};
use proptest::prelude::*;

const KINDS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];
const DRY: Ground = Ground { friction: 1.0 };
const WET: Ground = Ground { friction: 0.4 };
const SAMPLE_S: f64 = 0.05;
const KMH_100_MPS: f64 = 100.0 / 3.6;

fn body(name: &str) -> Body {
    Body::shipped(name)
        .expect("a shipped name")
        .expect("a valid file")
}

fn at(x_m: f64, y_m: f64, heading_rad: f64) -> Pose {
    Pose {
        x_m,
        y_m,
        heading_rad,
    }
}

fn drive(accel_mps2: f64, curvature_per_m: f64) -> Command {
    Command::Drive {
        accel_mps2,
        curvature_per_m,
    }
}

/// One body on its own, at the origin.
struct Alone {
    plant: Box<dyn Plant>,
}

impl Alone {
    fn new(kind: PlantKind, ground: Ground, name: &str, speed_mps: f64) -> Alone {
        let mut plant = plant(kind, ground);
        plant.spawn(&body(name), Pose::default(), speed_mps);
        Alone { plant }
    }

    fn state(&self) -> BodyState {
        self.plant.state(BodyId(0))
    }

    /// Obeys one command for a while and reports every sample.
    fn run(&mut self, command: Command, for_s: f64) -> Vec<BodyState> {
        self.plant.command(BodyId(0), command);
        let samples = (for_s / SAMPLE_S).round() as usize;
        let mut states = Vec::new();
        for _ in 0..samples {
            assert_eq!(self.plant.advance(SAMPLE_S, 4), None);
            states.push(self.state());
        }
        assert!(self.plant.sound());
        states
    }

    /// Acceleration across the path, in g.
    fn lateral_g(&self) -> f64 {
        self.state().speed_mps * self.state().yaw_rate_rad_per_s / GRAVITY_MPS2
    }
}

fn close(got: f64, want: f64, tolerance: f64, what: &str) {
    assert!(
        (got - want).abs() <= tolerance,
        "{what}: {got}, not {want} ± {tolerance}"
    );
}

#[test]
fn a_sedan_reaches_100_kmh_in_7_9_s() {
    for kind in KINDS {
        let mut car = Alone::new(kind, DRY, "sedan", 0.0);
        let states = car.run(drive(4.0, 0.0), 10.0);
        let samples = states
            .iter()
            .take_while(|state| state.speed_mps < KMH_100_MPS);
        close(samples.count() as f64 * SAMPLE_S, 7.9, 0.1, "0-100 km/h");
    }
}

#[test]
fn braking_from_100_kmh_takes_the_textbook_distance() {
    // (deceleration, distance); v²/2a, as PHYSICS measured it within 1.5 %.
    for (brake_mps2, want_m) in [(9.65, 39.98), (3.0, 128.6)] {
        for kind in KINDS {
            let mut car = Alone::new(kind, DRY, "sedan", KMH_100_MPS);
            car.run(drive(-brake_mps2, 0.0), 12.0);
            close(
                car.state().pose.x_m,
                want_m,
                0.005 * want_m,
                "braking distance",
            );
            assert_eq!(car.state().speed_mps, 0.0, "{kind:?}");
        }
    }
}

#[test]
fn cornering_holds_the_curvature_asked_for() {
    for kind in KINDS {
        for lateral_g in [0.3, 0.6, 0.9] {
            for speed_mps in [10.0, 20.0, 30.0] {
                let mut car = Alone::new(kind, DRY, "sedan", speed_mps);
                for side in [1.0, -1.0] {
                    let curvature = side * lateral_g * GRAVITY_MPS2 / (speed_mps * speed_mps);
                    car.run(drive(0.0, curvature), 4.0);
                    close(
                        car.lateral_g(),
                        side * lateral_g,
                        0.01 * lateral_g,
                        "cornering",
                    );
                    close(car.state().speed_mps, speed_mps, 0.002, "speed in a corner");
                }
            }
        }
    }
}

#[test]
fn a_turn_is_a_circle_of_the_radius_asked_for() {
    for kind in KINDS {
        let mut car = Alone::new(kind, DRY, "sedan", 10.0);
        // One revolution on a radius of 40 m takes 8π s.
        let states = car.run(
            drive(0.0, 1.0 / 40.0),
            8.0 * core::f64::consts::PI + 0.5 * SAMPLE_S,
        );
        let highest_m = states
            .iter()
            .map(|state| state.pose.y_m)
            .fold(0.0, f64::max);
        let bumper_m: f64 = 3.62; // ahead of the rear axle
        let radius_m = (40.0_f64.powi(2) + bumper_m.powi(2)).sqrt();
        close(
            highest_m,
            40.0 + radius_m,
            0.5,
            "farthest point of the circle",
        );
        close(car.state().pose.x_m, 0.0, 1.0, "back where it began");
        close(car.state().pose.y_m, 0.0, 1.0, "back where it began");
    }
}

#[test]
fn a_standing_car_stays_where_it_is() {
    for kind in KINDS {
        for command in [drive(0.0, 0.0), drive(-6.0, 0.0), drive(-3.0, 0.1)] {
            let mut car = Alone::new(kind, DRY, "sedan", 0.0);
            let before = car.plant.placement(BodyId(0)).centre_m;
            for state in car.run(command, 10.0) {
                close(state.speed_mps, 0.0, 1e-6, "phantom speed");
                close(state.lateral_mps, 0.0, 1e-6, "phantom lateral speed");
                close(state.accel_mps2, 0.0, 1e-4, "phantom acceleration");
            }
            let after = car.plant.placement(BodyId(0)).centre_m;
            for (before, after) in before.into_iter().zip(after) {
                close(after, before, 1e-4, "creep");
            }
        }
    }
}

#[test]
fn a_coasting_car_keeps_its_speed() {
    for kind in KINDS {
        for speed_mps in [0.5, 5.0, 25.0] {
            let mut car = Alone::new(kind, DRY, "sedan", speed_mps);
            for state in car.run(drive(0.0, 0.0), 30.0) {
                close(state.speed_mps, speed_mps, 1e-4, "coasting");
                close(state.pose.y_m, 0.0, 1e-3, "straight on");
            }
        }
    }
}

#[test]
fn drag_slows_only_bodies_that_declare_it() {
    let mut draggy = body("sedan");
    let BodyKind::Vehicle(vehicle) = &mut draggy.kind else {
        panic!("the sedan is a vehicle")
    };
    (vehicle.drag_area_m2, vehicle.rolling_resistance) = (0.65, 0.012);
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        let id = plant.spawn(&draggy, Pose::default(), 30.0);
        plant.command(id, drive(0.0, 0.0));
        plant.advance(SAMPLE_S, 4);
        // ½·1.225·0.65·30²/1500 + 0.012·9.81
        close(plant.state(id).accel_mps2, -0.3566, 0.002, "drag at 30 m/s");
        for _ in 0..4000 {
            plant.advance(SAMPLE_S, 4);
            assert!(
                0.0 <= plant.state(id).speed_mps,
                "rolling resistance reversed the car"
            );
        }
        close(plant.state(id).speed_mps, 0.0, 1e-6, "rolled out");
    }
}

#[test]
fn a_wet_road_limits_braking_and_cornering() {
    let limit_mps2 = WET.friction * GRAVITY_MPS2;
    for kind in KINDS {
        let mut car = Alone::new(kind, WET, "sedan", 25.0);
        car.run(drive(-8.0, 0.0), 10.0);
        let want_m = 25.0 * 25.0 / (2.0 * limit_mps2);
        close(
            car.state().pose.x_m,
            want_m,
            0.005 * want_m,
            "wet braking distance",
        );

        let mut car = Alone::new(kind, WET, "sedan", 20.0);
        for state in car.run(drive(0.0, 0.8 * GRAVITY_MPS2 / 400.0), 10.0) {
            assert!(state.speed_mps * state.yaw_rate_rad_per_s < 1.05 * limit_mps2);
        }
        close(car.lateral_g(), WET.friction, 0.02, "wet cornering");

        // Braking and turning share one circle: 3 along leaves 2.5 across.
        let mut car = Alone::new(kind, WET, "sedan", 25.0);
        car.run(drive(-3.0, 0.1), 2.0);
        close(car.state().accel_mps2, -3.0, 0.05, "braking in a wet turn");
        let left_g = (limit_mps2 * limit_mps2 - 9.0).sqrt() / GRAVITY_MPS2;
        close(
            car.lateral_g(),
            left_g,
            0.02,
            "turning while braking on a wet road",
        );
    }
}

#[test]
fn braking_stops_and_never_reverses() {
    for kind in KINDS {
        for name in ["sedan", "van", "truck", "motorcycle"] {
            for brake_mps2 in [0.5, 4.0, 20.0] {
                let mut car = Alone::new(kind, DRY, name, 7.3);
                let states = car.run(drive(-brake_mps2, 0.02), 20.0);
                let mut farthest_m = 0.0;
                for state in &states {
                    assert!(-1e-3 <= state.speed_mps, "{kind:?} {name}: {state:?}");
                    assert!(
                        farthest_m - 1e-3 <= state.pose.x_m,
                        "{kind:?} {name}: {state:?}"
                    );
                    farthest_m = state.pose.x_m;
                }
                close(car.state().speed_mps, 0.0, 1e-6, "stopped");
            }
        }
    }
}

#[test]
fn a_car_that_rolls_backwards_goes_on_doing_so_until_told_otherwise() {
    for kind in KINDS {
        let mut car = Alone::new(kind, DRY, "sedan", -2.0);
        car.run(drive(0.0, 0.0), 1.0);
        close(car.state().speed_mps, -2.0, 1e-4, "rolling backwards");
        car.run(drive(-1.0, 0.0), 1.0);
        close(car.state().speed_mps, -3.0, 1e-3, "reversing faster");
        car.run(drive(2.0, 0.0), 2.5);
        close(
            car.state().speed_mps,
            2.0,
            1e-3,
            "through zero into forward drive",
        );
    }
}

#[test]
fn engine_power_limits_acceleration() {
    for kind in KINDS {
        for (speed_mps, want_mps2) in [(30.0, 2.22), (40.0, 1.67), (10.0, 4.0)] {
            let mut car = Alone::new(kind, DRY, "sedan", speed_mps);
            car.run(drive(4.0, 0.0), SAMPLE_S);
            close(car.state().accel_mps2, want_mps2, 0.02, "acceleration");
        }
    }
}

#[test]
fn a_lane_change_at_25_mps_peaks_near_a_quarter_g() {
    for kind in KINDS {
        let mut car = Alone::new(kind, DRY, "sedan", 25.0);
        let mut peak_g = 0.0_f64;
        let samples = 60;
        for index in 0..samples {
            // One period of a sine moves the path by 3.5 m: a = 2π·D/T².
            let phase = core::f64::consts::TAU * (f64::from(index) + 0.5) / f64::from(samples);
            let across_mps2 = core::f64::consts::TAU * 3.5 / 9.0 * phase.sin();
            car.run(drive(0.0, across_mps2 / 625.0), SAMPLE_S);
            peak_g = peak_g.max(car.lateral_g().abs());
        }
        car.run(drive(0.0, 0.0), 1.0);
        close(peak_g, 0.245, 0.01, "peak of the lane change");
        close(car.state().pose.y_m, 3.5, 0.1, "width of the lane change");
        close(car.state().pose.heading_rad, 0.0, 0.003, "straight again");
    }
}

/// Two sedans on one line; returns the contact and the time at its sample's start.
fn chase(
    kind: PlantKind,
    gap_m: f64,
    speeds_mps: (f64, f64),
    accels_mps2: (f64, f64),
    start_m: f64,
) -> Option<(f64, Contact, Box<dyn Plant>)> {
    let mut plant = plant(kind, DRY);
    let sedan = body("sedan");
    let behind = plant.spawn(&sedan, at(start_m, 0.0, 0.0), speeds_mps.0);
    let front_m = start_m + sedan.length_m + gap_m;
    let ahead = plant.spawn(&sedan, at(front_m, 0.0, 0.0), speeds_mps.1);
    plant.command(behind, drive(accels_mps2.0, 0.0));
    plant.command(ahead, drive(accels_mps2.1, 0.0));
    for index in 0..400 {
        if let Some(contact) = plant.advance(SAMPLE_S, 4) {
            return Some((f64::from(index) * SAMPLE_S, contact, plant));
        }
    }
    None
}

#[test]
fn contact_time_and_closing_speed_match_the_closed_form() {
    // (gap, speeds, accelerations, time, closing speed)
    let cases = [
        (10.0, (20.0, 0.0), (0.0, 0.0), 0.5, 20.0),
        (10.03, (31.0, 0.0), (0.0, 0.0), 10.03 / 31.0, 31.0),
        (3.0, (12.0, 10.5), (0.0, 0.0), 2.0, 1.5),
        (8.0, (15.0, 15.0), (0.0, -4.0), 2.0, 8.0),
        (5.0, (10.0, 10.0), (1.0, -1.5), 2.0, 5.0),
        // The front car is at rest after 2 s and 10 m: 17 m in all at 10 m/s.
        (7.0, (10.0, 10.0), (0.0, -5.0), 1.7, 8.367),
        (30.0, (10.0, 10.0), (0.0, -5.0), 4.0, 10.0),
        (0.2, (5.0, 4.0), (0.0, 0.0), 0.2, 1.0),
    ];
    for kind in KINDS {
        for (gap_m, speeds, accels, mut want_s, mut want_mps) in cases {
            if gap_m == 7.0 {
                want_s = (2.0 * gap_m / 5.0_f64).sqrt();
                want_mps = 5.0 * want_s;
            }
            for start_m in [0.0, 700.0] {
                let (before_s, contact, plant) =
                    chase(kind, gap_m, speeds, accels, start_m).expect("a contact");
                let what = format!("{kind:?}, gap {gap_m} from {start_m}");
                close(
                    before_s + contact.after_s,
                    want_s,
                    0.002,
                    &format!("time, {what}"),
                );
                close(
                    contact.closing_speed_mps,
                    want_mps,
                    0.02,
                    &format!("closing, {what}"),
                );
                assert_eq!(contact.pair, (BodyId(0), BodyId(1)));
                close(
                    plant.gap_m(BodyId(0), BodyId(1)),
                    0.0,
                    2e-4,
                    &format!("gap, {what}"),
                );
                let front_m = plant.state(BodyId(0)).pose.x_m;
                close(contact.point_m[0], front_m, 1e-3, "between the bumpers");
                close(contact.point_m[1], 0.0, 1e-3, "in the middle of the lane");
            }
        }
    }
}

#[test]
fn contact_comes_exactly_when_the_bumpers_are_a_length_apart() {
    for kind in KINDS {
        let (.., plant) = chase(kind, 6.0, (20.0, 15.0), (2.0, -8.0), 0.0).expect("a contact");
        let headway_m = plant.state(BodyId(1)).pose.x_m - plant.state(BodyId(0)).pose.x_m;
        close(headway_m, 4.54, 2e-4, "headway at contact");
    }
}

#[test]
fn cars_in_adjacent_lanes_pass_without_contact() {
    for kind in KINDS {
        for lateral_m in [3.5, 1.82, 1.801] {
            for (speeds, heading_rad) in [((30.0, 5.0), 0.0), ((25.0, 25.0), core::f64::consts::PI)]
            {
                let mut plant = plant(kind, DRY);
                let sedan = body("sedan");
                plant.spawn(&sedan, at(0.0, 0.0, 0.0), speeds.0);
                plant.spawn(&sedan, at(20.0, lateral_m, heading_rad), speeds.1);
                let mut least_m = f64::INFINITY;
                for _ in 0..60 {
                    assert_eq!(plant.advance(SAMPLE_S, 4), None, "{kind:?} {lateral_m}");
                    least_m = least_m.min(plant.gap_m(BodyId(0), BodyId(1)));
                }
                close(least_m, lateral_m - 1.8, 2e-4, "clearance when abreast");
            }
        }
    }
}

#[test]
fn a_car_that_crosses_is_hit_in_the_flank() {
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        let sedan = body("sedan");
        plant.spawn(&sedan, at(-10.0, 0.0, 0.0), 20.0);
        plant.spawn(&sedan, at(2.0, -5.0, core::f64::consts::FRAC_PI_2), 10.0);
        // The flank at x = 2 − 0.9 is 11.1 m away; by then the other is across.
        let mut elapsed_s = 0.0;
        let contact = loop {
            match plant.advance(SAMPLE_S, 4) {
                Some(contact) => break contact,
                None => elapsed_s += SAMPLE_S,
            }
            assert!(elapsed_s < 1.0, "{kind:?}: no contact");
        };
        close(elapsed_s + contact.after_s, 0.555, 0.002, "time");
        close(contact.closing_speed_mps, 20.0, 0.01, "closing speed");
        close(contact.point_m[0], 1.1, 0.01, "on the flank");
    }
}

#[test]
fn gap_is_the_clearance_of_oriented_boxes() {
    let half_pi = core::f64::consts::FRAC_PI_2;
    let corner_m = (2.0_f64.powi(2) + 3.0_f64.powi(2)).sqrt();
    // (pose of the other front bumper, clearance from a sedan at the origin)
    let cases = [
        (at(14.54, 0.0, 0.0), 10.0),
        (at(-14.54, 0.0, 0.0), 10.0),
        (at(0.0, 3.5, 0.0), 1.7),
        (at(2.0 + 4.54, 1.8 + 3.0, 0.0), corner_m),
        (at(0.0, -3.0, half_pi), 2.1),
        (at(5.0, 0.0, core::f64::consts::PI), 5.0),
        (at(3.0, 0.0, 0.0), 0.0),
        (at(0.0, 0.0, 0.0), 0.0),
    ];
    for kind in KINDS {
        for (pose, want_m) in cases {
            let mut plant = plant(kind, DRY);
            let sedan = body("sedan");
            let (a, b) = (
                plant.spawn(&sedan, Pose::default(), 0.0),
                plant.spawn(&sedan, pose, 0.0),
            );
            close(
                plant.gap_m(a, b),
                want_m,
                1e-5,
                &format!("{kind:?} {pose:?}"),
            );
            assert_eq!(plant.gap_m(a, b), plant.gap_m(b, a));
        }
    }
}

#[test]
fn bodies_that_overlap_are_in_contact_at_once_and_stay() {
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        let sedan = body("sedan");
        let rear = plant.spawn(&sedan, Pose::default(), 5.0);
        plant.spawn(&sedan, at(4.0, 0.0, 0.0), 3.0);
        for _ in 0..2 {
            let contact = plant.advance(SAMPLE_S, 4).expect("overlap is contact");
            assert_eq!(contact.after_s, 0.0);
            close(contact.closing_speed_mps, 2.0, 1e-5, "closing speed");
            close(plant.state(rear).pose.x_m, 0.0, 1e-6, "nobody moves on");
        }
    }
}

/// A mixed scene: everything spawns, everybody gets commands of some interest.
fn mixed(kind: PlantKind) -> Box<dyn Plant> {
    let mut plant = plant(kind, Ground { friction: 0.8 });
    for (index, name) in ["sedan", "van", "truck", "motorcycle"]
        .into_iter()
        .enumerate()
    {
        let lane_m = 3.5 * index as f64;
        plant.spawn(&body(name), at(0.0, lane_m, 0.0), 10.0 + 2.0 * index as f64);
    }
    plant.spawn(&body("pedestrian"), at(60.0, -5.0, 1.57), 0.0);
    plant
}

fn stir(plant: &mut dyn Plant, samples: core::ops::Range<usize>) -> Vec<BodyState> {
    let mut states = Vec::new();
    for sample in samples {
        let wave = (sample as f64 * 0.13).sin();
        for index in 0..4 {
            plant.command(BodyId(index), drive(3.0 * wave, 0.002 * wave));
        }
        let (x_mps, y_mps) = (0.2, 1.5 * wave);
        plant.command(BodyId(4), Command::Walk { x_mps, y_mps });
        plant.advance(SAMPLE_S, 4);
        states.extend((0..5).map(|index| plant.state(BodyId(index))));
    }
    assert!(plant.sound());
    states
}

#[test]
fn equal_calls_give_equal_bits_on_any_thread() {
    for kind in KINDS {
        let run = move || stir(mixed(kind).as_mut(), 0..100);
        let want = run();
        let threads: Vec<_> = (0..2).map(|_| std::thread::spawn(run)).collect();
        for thread in threads {
            assert!(thread.join().expect("no panic") == want, "{kind:?}");
        }
    }
}

#[test]
fn a_fork_continues_bit_for_bit() {
    for kind in KINDS {
        let mut plant = mixed(kind);
        stir(plant.as_mut(), 0..37);
        let mut fork = plant.fork();
        let twice = fork.fork();
        assert!(
            stir(plant.as_mut(), 37..80) == stir(fork.as_mut(), 37..80),
            "{kind:?}"
        );
        let mut twice = twice;
        assert!(
            stir(twice.as_mut(), 37..80) == stir(mixed_at(kind, 37).as_mut(), 37..80),
            "{kind:?}"
        );
    }
}

fn mixed_at(kind: PlantKind, samples: usize) -> Box<dyn Plant> {
    let mut plant = mixed(kind);
    stir(plant.as_mut(), 0..samples);
    plant
}

#[test]
fn a_cleared_plant_is_as_good_as_new() {
    for kind in KINDS {
        let mut plant = mixed(kind);
        stir(plant.as_mut(), 0..50);
        plant.command(BodyId(0), drive(f64::NAN, 0.0));
        plant.clear(DRY);
        assert!(plant.sound());
        let id = plant.spawn(&body("sedan"), Pose::default(), 20.0);
        let mut fresh = Alone::new(kind, DRY, "sedan", 20.0);
        plant.command(id, drive(-3.0, 0.01));
        let states = fresh.run(drive(-3.0, 0.01), 1.0);
        for state in states {
            plant.advance(SAMPLE_S, 4);
            assert!(plant.state(id) == state, "{kind:?}");
        }
    }
}

#[test]
fn of_eight_cars_the_first_pair_to_touch_is_reported() {
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        let sedan = body("sedan");
        for index in 0..8 {
            plant.spawn(&sedan, at(-12.0 * f64::from(index), 0.0, 0.0), 20.0);
        }
        // Number 3 brakes, so number 4 runs into it; the others keep off.
        plant.command(BodyId(3), drive(-6.0, 0.0));
        let contact = (0..200)
            .find_map(|_| plant.advance(SAMPLE_S, 4))
            .expect("a contact");
        assert_eq!(contact.pair, (BodyId(3), BodyId(4)), "{kind:?}");
        close(
            contact.closing_speed_mps,
            (2.0 * 6.0 * 7.46_f64).sqrt(),
            0.1,
            "closing speed",
        );
    }
}

#[test]
fn a_walker_reaches_the_velocity_asked_for_at_its_acceleration() {
    for kind in KINDS {
        let mut walker = Alone::new(kind, DRY, "pedestrian", 0.0);
        let (x_mps, y_mps) = (0.0, 1.5);
        let states = walker.run(Command::Walk { x_mps, y_mps }, 2.0);
        // 0.5 s at 3 m/s², then 1.5 s at 1.5 m/s.
        close(states[4].lateral_mps, 0.75, 1e-9, "half way up the ramp");
        close(
            walker.state().pose.y_m,
            0.375 + 2.25,
            1e-9,
            "distance walked",
        );
        close(walker.state().pose.x_m, 0.0, 1e-9, "no drift");
        let (x_mps, y_mps) = (30.0, 40.0);
        walker.run(Command::Walk { x_mps, y_mps }, 3.0);
        close(
            walker.state().speed_mps,
            2.4,
            1e-9,
            "top speed, in the direction asked for",
        );
        close(
            walker.state().lateral_mps,
            3.2,
            1e-9,
            "top speed, in the direction asked for",
        );
    }
}

#[test]
fn a_car_hits_a_pedestrian_who_steps_out() {
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        plant.spawn(&body("sedan"), at(0.0, 0.0, 0.0), 15.0);
        let walker = plant.spawn(
            &body("pedestrian"),
            at(20.0, -2.0, core::f64::consts::FRAC_PI_2),
            0.0,
        );
        let (x_mps, y_mps) = (0.0, 2.0);
        plant.command(walker, Command::Walk { x_mps, y_mps });
        let mut elapsed_s = 0.0;
        let contact = loop {
            match plant.advance(SAMPLE_S, 4) {
                Some(contact) => break contact,
                None => elapsed_s += SAMPLE_S,
            }
            assert!(elapsed_s < 3.0, "{kind:?}: no contact");
        };
        // Facing across the lane, the walker is 0.6 m long along it.
        close(
            elapsed_s + contact.after_s,
            (20.0 - 0.3) / 15.0,
            0.002,
            "time",
        );
        close(contact.closing_speed_mps, 15.0, 0.01, "closing speed");
        assert_eq!(contact.pair, (BodyId(0), walker));
    }
}

#[test]
fn every_vehicle_drives_corners_and_stops() {
    for kind in KINDS {
        for name in ["sedan", "van", "truck", "motorcycle"] {
            let it = body(name);
            let grip = it.vehicle().expect("a vehicle").grip;
            let mut car = Alone::new(kind, DRY, name, 15.0);
            let height_m = car.plant.placement(BodyId(0)).centre_m[2];
            close(height_m, 0.5 * it.height_m, 1e-6, "stands on the ground");
            for fraction in [0.5, 0.9, -0.9, 3.0] {
                let curvature = fraction * grip * GRAVITY_MPS2 / 225.0;
                car.run(drive(0.0, curvature), 5.0);
                let want_g = grip * fraction.clamp(-1.0, 1.0);
                close(
                    car.lateral_g(),
                    want_g,
                    0.03 * grip,
                    &format!("{kind:?} {name} at {fraction}"),
                );
                let [x, y, _, _] = car.plant.placement(BodyId(0)).rotation;
                assert!(
                    (x * x + y * y).sqrt() < 0.05,
                    "{kind:?} {name} leans too much"
                );
                close(
                    car.plant.placement(BodyId(0)).centre_m[2],
                    height_m,
                    0.03,
                    "ride height",
                );
            }
            car.run(drive(0.0, 0.0), 2.0);
            close(car.state().speed_mps, 15.0, 0.05, "speed after the corners");
            let from = car.state();
            car.run(drive(-20.0, 0.0), 6.0);
            let to = car.state();
            let (dx, dy) = (to.pose.x_m - from.pose.x_m, to.pose.y_m - from.pose.y_m);
            let want_m = 225.0 / (2.0 * grip * GRAVITY_MPS2);
            close((dx * dx + dy * dy).sqrt(), want_m, 0.15, "braking distance");
        }
    }
}

#[test]
fn broken_commands_make_a_plant_unsound_not_panic() {
    let broken = [
        drive(f64::NAN, 0.0),
        drive(0.0, f64::INFINITY),
        Command::Walk {
            x_mps: 1.0,
            y_mps: 0.0,
        },
    ];
    for kind in KINDS {
        for command in broken {
            let mut plant = plant(kind, DRY);
            let id = plant.spawn(&body("sedan"), Pose::default(), 10.0);
            plant.command(id, command);
            plant.advance(SAMPLE_S, 4);
            assert!(!plant.sound(), "{kind:?} {command:?}");
            assert!(plant.state(id).pose.x_m.is_finite());
        }
        let mut plant = plant(kind, DRY);
        plant.spawn(&body("sedan"), at(2e6, 0.0, 0.0), 10.0);
        assert!(!plant.sound(), "{kind:?}: out of bounds");
    }
}

#[test]
fn shipped_bodies_parse_and_survive_a_round_trip() {
    assert_eq!(Body::shipped_names().count(), 5);
    for name in Body::shipped_names() {
        let it = body(name);
        assert_eq!(it.name, name);
        let options = ron::Options::default()
            .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
        let text = options.to_string(&it).expect("serialises");
        assert_eq!(Body::parse(&text), Ok(it), "{text}");
    }
    assert!(Body::shipped("unicycle").is_none());
}

#[test]
fn a_bad_body_is_refused_by_field() {
    let mut it = body("sedan");
    for (value, field) in [(f64::NAN, "mass_kg"), (-1.0, "mass_kg"), (0.0, "mass_kg")] {
        it.mass_kg = value;
        assert_eq!(it.validate().expect_err("refused").field, field);
    }
    let mut it = body("sedan");
    it.com_ahead_m = 2.0;
    let error = it.validate().expect_err("would tip over its bumper");
    assert_eq!(
        error.to_string(),
        "`com_ahead_m` is 2, but it must be between -1.08 and 1.08"
    );
    let unknown = "(name: \"x\", wings: 2)";
    assert!(matches!(Body::parse(unknown), Err(BodyError::Syntax(_))));
}

// Regressions: one per fault.

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
    let [_, pitch, ..] = plant.placement(rear).rotation;
    assert!(0.005 < pitch, "but in pictures it does dive: {pitch}");
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
fn a_touch_that_ended_may_be_driven_away_from() {
    // The contact leaves the bumpers at 0 ± 1e-4 m; parting is no new contact.
    for kind in KINDS {
        let (.., mut plant) = chase(kind, 1.0, (6.0, 5.0), (0.0, 0.0), 0.0).expect("a contact");
        plant.command(BodyId(0), drive(-9.0, 0.0));
        plant.command(BodyId(1), drive(4.0, 0.0));
        let again = plant.advance(SAMPLE_S, 4).expect("they are still closing");
        assert!(again.after_s < 1e-3, "{kind:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// The step at which boxes first overlap in fine sampling is the contact's.
    #[test]
    fn contacts_are_where_fine_sampling_sees_them(
        x_m in 5.0..15.0, y_m in -6.0..6.0, heading_rad in -3.1..3.1,
        speeds in (5.0..20.0, 0.0..20.0), curvatures in (-0.05..0.05, -0.05..0.05),
    ) {
        for kind in KINDS {
            let sedan = body("sedan");
            let spawned = || {
                let mut plant = plant(kind, DRY);
                plant.spawn(&sedan, Pose::default(), speeds.0);
                plant.spawn(&sedan, at(x_m, y_m, heading_rad), speeds.1);
                plant.command(BodyId(0), drive(0.0, curvatures.0));
                plant.command(BodyId(1), drive(-2.0, curvatures.1));
                plant
            };
            let mut coarse = spawned();
            let Some((before_s, contact)) = (0..40).find_map(|index| {
                let before_s = f64::from(index) * SAMPLE_S;
                coarse.advance(SAMPLE_S, 4).map(|contact| (before_s, contact))
            }) else { continue };
            let when_s = before_s + contact.after_s;
            prop_assert!(coarse.gap_m(BodyId(0), BodyId(1)) < 1e-3);
            prop_assert!(0.0 <= contact.closing_speed_mps && contact.closing_speed_mps <= speeds.0 + speeds.1 + 2.5);
            // The same run, stopped just before: close, but not in contact.
            if 0.002 < when_s {
                let mut fine = spawned();
                let whole = (before_s / SAMPLE_S).round() as usize;
                for _ in 0..whole { prop_assert!(fine.advance(SAMPLE_S, 4).is_none()); }
                let rest_s = when_s - before_s - 0.001;
                if 0.0 < rest_s {
                    prop_assert!(fine.advance(rest_s, 4).is_none(), "{kind:?}");
                    prop_assert!(fine.gap_m(BodyId(0), BodyId(1)) < 0.1, "{kind:?}");
                }
            }
        }
    }

    /// Turning and shifting the world turns and shifts what happens in it.
    #[test]
    fn physics_does_not_know_where_north_is(turn_rad in -3.1..3.1_f64, x_m in -200.0..200.0, accel in -5.0..3.0, curvature in -0.02..0.02) {
        for kind in KINDS {
            let run = |pose: Pose| {
                let mut plant = plant(kind, DRY);
                plant.spawn(&body("sedan"), pose, 15.0);
                plant.command(BodyId(0), drive(accel, curvature));
                for _ in 0..40 { plant.advance(SAMPLE_S, 4); }
                plant.state(BodyId(0))
            };
            let (plain, turned) = (run(Pose::default()), run(at(x_m, 0.0, turn_rad)));
            let (sin, cos) = turn_rad.sin_cos();
            let want_m = x_m + plain.pose.x_m * cos - plain.pose.y_m * sin;
            prop_assert!((turned.pose.x_m - want_m).abs() < 5e-3, "{kind:?} {want_m} {turned:?}");
            prop_assert!((turned.speed_mps - plain.speed_mps).abs() < 1e-3);
            prop_assert!((turned.yaw_rate_rad_per_s - plain.yaw_rate_rad_per_s).abs() < 1e-3);
        }
    }
}
