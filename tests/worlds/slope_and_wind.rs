//! Grades of the road, wind and the range of sensors: by hand, drawn, and their mistakes.

use brakecheck::crashes::ExportRefusal;
use brakecheck::openx::OpenXError;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Testbench, play};
use brakecheck::world::Scenario;
use brakecheck_crashes::crashes::export::openx;
use brakecheck_sim::sim::{GRAVITY_MPS2, PlantKind};

const PLANTS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];
const COASTS: &str = "Coast(accel_mps2: 0.0, lag_s: 0.0)";
const FOLLOWS: &str = "Idm(desired_speed_mps: 20.0, time_gap_s: 1.0, min_gap_m: 2.0, \
    max_accel_mps2: 1.5, comfort_brake_mps2: 2.0, max_brake_mps2: 6.0, lag_s: 0.0)";

/// A car at 20 m/s, 100 m before a parked one.
fn text(ego: &str, body: &str, fields: &str) -> String {
    format!(
        "Scenario(name: \"slope\", question: \"?\", \
         clock: (horizon_s: 4.0, decision_s: 0.5, sample_s: 0.05, substeps: 4), \
         judge: UntilContact, \
         road: Straight(lanes: 1, lane_width_m: 3.5, friction: 0.9), {fields}, \
         bodies: {{ \"dragged\": (name: \"dragged\", kind: Vehicle(wheelbase_m: 2.7, \
         track_m: 1.5, front_overhang_m: 0.9, wheel_radius_m: 0.33, power_w: 1.0e5, \
         drag_area_m2: 2.0), length_m: 4.5, width_m: 1.8, height_m: 1.5, \
         mass_kg: 1000.0, com_height_m: 0.5) }}, \
         agents: [\
         Vehicle(name: \"ego\", body: \"{body}\", \
         start: At(x_m: 0.0, speed_mps: 20.0), drive: Ego({ego})),\
         Obstacle(name: \"queue\", body: \"sedan\", s_m: 100.0, lateral_m: 0.0)], \
         ego_spec: \"always (ego.queue.gap >= 0 and ego.s >= -1 and ego.lateral >= -9)\")"
    )
}

fn world(text: &str) -> Scenario {
    Scenario::parse("slope.ron", text).unwrap_or_else(|error| panic!("{error}"))
}

fn driven(world: &Scenario, start: &[f64]) -> Testbench {
    let mut bench = world.bench();
    bench.begin(&Start(start.to_vec()), 7, Aftermath::Skip);
    (0..8).for_each(|_| bench.decide(0));
    bench
}

#[test]
fn a_car_gains_g_sin_from_the_station_on_at_which_the_road_falls() {
    let falling = world(&text(
        COASTS,
        "sedan",
        "grades: [(0.0, 0.0), (20.0, -0.06)]",
    ));
    for plant in PLANTS {
        let bench = driven(&falling.on(plant), &[]);
        let speeds = bench.trace().signal("ego.speed").expect("recorded");
        // 20 m at 20 m/s: 20 samples, and the slope acts from row 21 on.
        for (sample, speed_mps) in speeds.iter().enumerate() {
            let down_s = 0.05 * sample.saturating_sub(20) as f64;
            let expected_mps = 20.0 + GRAVITY_MPS2 * 0.06 / 1.0036_f64.sqrt() * down_s;
            let off_mps = (speed_mps - expected_mps).abs();
            // The wheels of the rigid car reach the edge one axle after the other.
            let most_mps = match plant {
                PlantKind::Kinematic => 0.04,
                PlantKind::Rigid => 0.045,
            };
            assert!(off_mps < most_mps, "{plant:?} {sample}: {off_mps}");
        }
    }
}

#[test]
fn a_head_wind_brakes_by_its_air_drag_and_only_bodies_that_have_some() {
    let wind = "wind: (speed_mps: 10.0, from_rad: 0.0)";
    for plant in PLANTS {
        let free = driven(&world(&text(COASTS, "sedan", wind)).on(plant), &[]);
        let speeds = free.trace().signal("ego.speed").expect("recorded");
        assert!(speeds.iter().all(|mps| (mps - 20.0).abs() < 1e-3));
        let dragged = driven(&world(&text(COASTS, "dragged", wind)).on(plant), &[]);
        let speeds = dragged.trace().signal("ego.speed").expect("recorded");
        // Against 30 m/s of air: ½ · 1.225 · 2 / 1000 · (v + 10)². From w' = −k w² follows
        // w = 30 / (1 + 30 k t).
        let per_m = 0.5 * 1.225 * 2.0 / 1000.0;
        for (sample, mps) in speeds.iter().enumerate() {
            let time_s = 0.05 * sample as f64;
            let expected_mps = 30.0 / (1.0 + 30.0 * per_m * time_s) - 10.0;
            assert!(
                (mps - expected_mps).abs() < 0.02,
                "{plant:?} {sample} {mps}"
            );
        }
    }
}

#[test]
fn a_gust_from_the_left_moves_a_rigid_car_to_the_right_while_it_lasts() {
    // μ = 0.1 gives 0.98 m/s². The gust gives up to ½ · 1.225 · 4.54 · 1.45 · 30² / 1500
    // = 2.42 m/s².
    let gust = "wind: (speed_mps: 0.0, from_rad: 1.5707963, \
        gust: (peak_mps: 30.0, begin_s: 1.0, duration_s: 2.0))";
    let icy = text(COASTS, "sedan", gust).replace("friction: 0.9", "friction: 0.1");
    let bench = driven(&world(&icy).on(PlantKind::Rigid), &[]);
    let laterals = bench.trace().signal("ego.lateral").expect("recorded");
    assert!(laterals[..=20].iter().all(|m| m.abs() < 1e-3));
    // The gust exceeds the grip where (1 − cos)² / 4 > 0.405, for 0.82 s, by 0.8 m/s² in
    // the mean. So the car slides by 0.3 m in it, and on until the tyres stop it.
    let least_m = laterals.iter().copied().fold(0.0, f64::min);
    assert!((-2.0..-0.2).contains(&least_m), "{least_m}");
    let bench = driven(&world(&icy).on(PlantKind::Kinematic), &[]);
    let laterals = bench.trace().signal("ego.lateral").expect("recorded");
    assert!(laterals.iter().all(|m| *m == 0.0));
}

#[test]
fn grades_winds_and_ranges_of_sensors_are_axes_of_the_start() {
    let fields = "grades: [(0.0, (-0.06, 0.06))], sensors: (range_m: (20.0, 90.0)), \
        wind: (speed_mps: (0.0, 5.0), from_rad: 0.0, \
        gust: (peak_mps: (0.0, 9.0), begin_s: (0.5, 2.0), duration_s: 1.0))";
    let ranged = world(&text(FOLLOWS, "dragged", fields));
    let names: Vec<String> = ranged.axes().into_iter().map(|axis| axis.name).collect();
    let expected = [
        "sensors.range",
        "road.grade1",
        "wind.speed",
        "wind.gust_peak",
        "wind.gust_begin",
    ];
    assert_eq!(names, expected);
    let start = [43.0, 0.05, 4.0, 7.0, 1.25];
    let fields = "grades: [(0.0, 0.05)], sensors: (range_m: 43.0), \
        wind: (speed_mps: 4.0, from_rad: 0.0, \
        gust: (peak_mps: 7.0, begin_s: 1.25, duration_s: 1.0))";
    let fixed = world(&text(FOLLOWS, "dragged", fields));
    for plant in PLANTS {
        let drawn = driven(&ranged.on(plant), &start);
        assert_eq!(*drawn.trace(), *driven(&fixed.on(plant), &[]).trace());
        for (axis, other) in [(0, 90.0), (1, -0.05), (2, 0.0), (3, 0.0), (4, 2.0)] {
            let mut changed = start;
            changed[axis] = other;
            let changed = driven(&ranged.on(plant), &changed);
            assert_ne!(drawn.trace(), changed.trace(), "{plant:?} {axis}");
        }
    }
}

#[test]
fn the_ego_perceives_a_parked_car_from_the_sample_in_range_on() {
    let near = world(&text(FOLLOWS, "sedan", "sensors: (range_m: 50.0)"));
    for plant in PLANTS {
        let bench = driven(&near.on(plant), &[]);
        let accels = bench.trace().signal("ego.accel").expect("recorded");
        // Its rear is at 95.46 m: 50.46 m away at row 45 and 49.46 m at row 46.
        let first = accels.iter().position(|accel| *accel < -0.1);
        assert_eq!(first, Some(47), "{plant:?}");
    }
}

fn crash_of(fields: &str) -> (Scenario, brakecheck::testbench::Episode) {
    let world = world(&text(COASTS, "sedan", fields).replace("s_m: 100.0", "s_m: 40.0"));
    let mut bench = world.bench();
    let start = Start(vec![]);
    let crash = play(&mut bench, &start, 3, &mut Constant(0), Aftermath::Skip);
    assert!(crash.contact.is_some());
    (world, crash)
}

#[test]
fn files_of_other_tools_refuse_wind_by_name() {
    let (world, crash) = crash_of("wind: (speed_mps: 3.0, from_rad: 0.0)");
    let refused = openx(&world, &crash, "crash", "nominal");
    let Err(ExportRefusal::OpenX(OpenXError::BanksOrWind { what: "wind" })) = refused else {
        panic!("exported");
    };
}

#[test]
fn files_of_other_tools_have_the_heights_of_the_grades() {
    let (world, crash) = crash_of("grades: [(0.0, 0.0), (20.0, -0.06)]");
    let files = openx(&world, &crash, "crash", "nominal").expect("exported");
    // The road is flat from 50 m behind the first body up to 20 m, and falls from there.
    let numbers = |text: &str, element: &str, name: &str| -> Vec<f64> {
        let elements = text.split('<').filter(|it| it.starts_with(element));
        let value = |it: &str| {
            let from = it.find(&format!(" {name}=\""))? + name.len() + 3;
            it[from..].split('"').next()?.parse().ok()
        };
        elements.filter_map(value).collect()
    };
    let slopes = numbers(&files.road, "elevation ", "b");
    assert!(
        slopes[0].abs() < 1e-12 && (slopes[1] + 0.06).abs() < 1e-9,
        "{slopes:?}"
    );
    let (xs, zs) = (
        numbers(&files.replay, "WorldPosition", "x"),
        numbers(&files.replay, "WorldPosition", "z"),
    );
    assert!(xs.len() > 10 && xs.iter().any(|x_m| *x_m > 30.0));
    for (x_m, z_m) in xs.iter().zip(&zs) {
        let height_m = -0.06 * (x_m - 20.0).max(0.0);
        assert!((z_m - height_m).abs() < 1e-6, "{x_m}: {z_m}");
    }
    let pitches = numbers(&files.replay, "WorldPosition", "p");
    assert!(pitches.iter().any(|it| (it - 0.06_f64.atan()).abs() < 1e-6));
}

#[test]
fn mistakes_in_grades_wind_and_range_are_one_message_each() {
    let gust = "wind: (speed_mps: 3.0, from_rad: 0.0, gust: (peak_mps: 5.0, begin_s: 1.0, duration_s: 0.0))";
    let cases = [
        ("grades: [(0.0, 0.5)]", "0.5 is outside of -0.3 ..= 0.3"),
        (
            "grades: [(0.0, (0.2, 0.1))]",
            "the range (0.2, 0.1) is reversed",
        ),
        (
            "grades: [(50.0, 0.1), (20.0, 0.0)]",
            "the grade from 20.0 m on follows that from 50.0 m on",
        ),
        (
            "wind: (speed_mps: 90.0, from_rad: 0.0)",
            "90 is outside of -60 ..= 60",
        ),
        ("wind: (speed_mps: 9.0, from_rad: 90.0)", "90 is outside of"),
        (gust, "0 is outside of 0.1 ..= 60"),
        ("sensors: (range_m: 0.0)", "0 is outside of 1 ..= 10000"),
    ];
    for (fields, says) in cases {
        let error = Scenario::parse("slope.ron", &text(COASTS, "sedan", fields))
            .expect_err(says)
            .to_string();
        assert!(error.contains(says), "{fields}: {error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}
