//! Every plant meets the same vehicle checks.
//!
//! The checks here and in `contacts` and `bits` run on both plants; each of
//! those in `faults` guards one fault that a plant on rapier has had or easily has.

mod bits;
mod collisions;
mod contacts;
mod cyclists;
mod faults;
mod push;
mod shapes;
mod vehicle_validation;

use brakecheck::scene::{BodyCommand, BodyState, Pose};
use brakecheck::world::PlantKind;
use brakecheck_sim::sim::{
    Body, BodyError, BodyId, BodyKind, Contact, GRAVITY_MPS2, Ground, Plant, plant,
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

fn drive(accel_mps2: f64, curvature_per_m: f64) -> BodyCommand {
    BodyCommand::Drive {
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
    fn run(&mut self, command: BodyCommand, for_s: f64) -> Vec<BodyState> {
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
    // (deceleration, distance = v²/2a).
    for (brake_mps2, want_m) in [(9.65, 39.98), (3.0, 128.6)] {
        for kind in KINDS {
            let mut car = Alone::new(kind, DRY, "sedan", KMH_100_MPS);
            car.run(drive(-brake_mps2, 0.0), 12.0);
            close(
                car.state().pose.x_m,
                want_m,
                0.002 * want_m,
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
                plant.state(id).speed_mps >= 0.0,
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
                    assert!(state.speed_mps >= -1e-3, "{kind:?} {name}: {state:?}");
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

#[test]
fn a_walker_reaches_the_velocity_asked_for_at_its_acceleration() {
    for kind in KINDS {
        let mut walker = Alone::new(kind, DRY, "pedestrian", 0.0);
        let (x_mps, y_mps) = (0.0, 1.5);
        let states = walker.run(BodyCommand::Walk { x_mps, y_mps }, 2.0);
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
        walker.run(BodyCommand::Walk { x_mps, y_mps }, 3.0);
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
                let rotation = car.plant.placement(BodyId(0)).rotation;
                assert!(
                    libm::hypot(rotation.i, rotation.j) < 0.05,
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
        BodyCommand::Walk {
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
    let dir = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/vehicles");
    let files = std::fs::read_dir(dir)
        .expect("the bodies")
        .map(|file| file.expect("a file").path());
    let stem = |path: std::path::PathBuf| path.file_stem().map(|it| it.display().to_string());
    let mut files: Vec<String> = files.filter_map(stem).collect();
    files.sort();
    let mut names: Vec<String> = Body::shipped_names().map(String::from).collect();
    names.sort();
    assert_eq!(names, files);
    for name in Body::shipped_names() {
        let physics = include_str!("../../docs/background/physics.md");
        assert!(physics.contains(&format!("\n| `{name}.ron` |")), "{name}");
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

#[test]
fn both_plants_tell_the_same_story() {
    // ACC-like: the front car brakes and accelerates, the rear one too.
    let mut worst_m = 0.0_f64;
    let stories = KINDS.map(|kind| {
        let mut plant = plant(kind, Ground { friction: 0.9 });
        let sedan = body("sedan");
        plant.spawn(&sedan, Pose::default(), 15.0);
        plant.spawn(&sedan, at(60.0, 0.0, 0.0), 15.0);
        let mut gaps_m = Vec::new();
        for sample in 0..300 {
            let (slow, fast) = (f64::from(sample / 30), f64::from(sample / 10));
            plant.command(BodyId(0), drive(2.5 * (1.7 * fast).sin(), 0.0));
            plant.command(BodyId(1), drive(5.0 * (2.3 * slow).cos(), 0.0));
            assert_eq!(plant.advance(SAMPLE_S, 4), None);
            gaps_m.push(plant.gap_m(BodyId(0), BodyId(1)));
        }
        gaps_m
    });
    let [rigid, kinematic] = stories;
    for (rigid_m, kinematic_m) in rigid.into_iter().zip(kinematic) {
        worst_m = worst_m.max((rigid_m - kinematic_m).abs());
    }
    assert!(worst_m < 0.005, "the plants part by {worst_m} m in 15 s");
}

#[test]
fn a_narrow_body_that_would_fall_over_is_refused() {
    let mut it = body("motorcycle");
    let BodyKind::Vehicle(vehicle) = &mut it.kind else {
        panic!("the motorcycle is a vehicle")
    };
    vehicle.track_m = 0.3;
    assert_eq!(it.validate().expect_err("refused").field, "com_height_m");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

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

#[test]
fn a_changed_ground_brakes_from_the_next_advance_on() {
    for kind in KINDS {
        // Dry for a second, then wet, and the other way round.
        for (first, second) in [(DRY, WET), (WET, DRY)] {
            let mut car = Alone::new(kind, first, "sedan", 20.0);
            car.run(drive(-30.0, 0.0), 1.0);
            car.plant.set_ground(second);
            let states = car.run(drive(-30.0, 0.0), 6.0);
            let [before_mps2, after_mps2] = [first, second].map(|it| it.friction * GRAVITY_MPS2);
            let speed_mps = 20.0 - before_mps2;
            let way_m = 20.0 - 0.5 * before_mps2 + 0.5 * speed_mps * speed_mps / after_mps2;
            let end = states.last().expect("sampled");
            assert!(end.speed_mps.abs() < 1e-3, "{kind:?}");
            let off_m = (end.pose.x_m - way_m).abs();
            assert!(off_m < 0.01 * way_m, "{kind:?}: {off_m} of {way_m}");
        }
    }
}

#[test]
fn a_changed_ground_limits_the_next_corner() {
    for kind in KINDS {
        let mut car = Alone::new(kind, DRY, "sedan", 20.0);
        car.run(drive(0.0, 0.0), 0.5);
        car.plant.set_ground(WET);
        // 0.9 g is asked of tyres that have 0.4 g left.
        car.run(drive(0.0, 0.9 * GRAVITY_MPS2 / 400.0), 2.0);
        let lateral_g = car.lateral_g();
        assert!((lateral_g - 0.4).abs() < 0.03, "{kind:?}: {lateral_g}");
    }
}
