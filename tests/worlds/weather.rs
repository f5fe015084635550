//! Weather as an ado: its effect on brakes and sight, by hand, and its mistakes.

use brakecheck::cli::{Failure, plain_theme};
use brakecheck::crashes::{ExportRefusal, Regressions};
use brakecheck::openx::OpenXError;
use brakecheck::preventability::NotApplicable;
use brakecheck::run_dir::Counterexample;
use brakecheck::scene::Start;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, Testbench, play};
use brakecheck::world::PlantKind;
use brakecheck::world::{Change, Scenario};
use brakecheck_crashes::crashes::export::openx;
use brakecheck_sim::sim::GRAVITY_MPS2;

const PLANTS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];
const SAMPLE_S: f64 = 0.05;
/// Samples between two decisions.
const DECISION: usize = 10;
/// An ego that wants to be slow, and therefore brakes as hard as the road allows.
const BRAKES: &str = "Idm(desired_speed_mps: 0.5, time_gap_s: 1.0, min_gap_m: 2.0, \
    max_accel_mps2: 1.5, comfort_brake_mps2: 2.0, max_brake_mps2: 20.0, lag_s: 0.0)";
const FOLLOWS: &str = "Idm(desired_speed_mps: 20.0, time_gap_s: 1.0, min_gap_m: 2.0, \
    max_accel_mps2: 1.5, comfort_brake_mps2: 2.0, max_brake_mps2: 6.0, lag_s: 0.0)";
const SHOWER: &str = "Weather(name: \"rain\", \
    bounds: (friction: (0.3, 0.9), visibility_m: (10.0, 80.0), noise_scale: (1.0, 4.0)), \
    start: (visibility_m: 50.0), \
    drive: Ado(actions: Rates([(friction_per_s: -0.4), (), (friction_per_s: 0.4), \
    (visibility_mps: -100.0), (noise_per_s: 1.0, visibility_mps: 20.0)]), neutral: 1, \
    rulebook: [Rule(name: \"lasts\", stl: \"always (rain.friction_rate >= -1)\")]))";

/// A car at 20 m/s, 100 m before a parked one.
fn text(ego: &str, weather: &str) -> String {
    format!(
        "Scenario(name: \"shower\", question: \"?\", \
         clock: (horizon_s: 6.0, decision_s: 0.5, sample_s: 0.05, substeps: 4), \
         judge: UntilContact, \
         road: Straight(lanes: 1, lane_width_m: 3.5, friction: 0.9), \
         sensors: (position_sd_m: 0.5), \
         agents: [\
         Vehicle(name: \"ego\", body: \"sedan\", \
         start: At(x_m: 0.0, speed_mps: 20.0), drive: Ego({ego})),\
         Obstacle(name: \"queue\", body: \"sedan\", s_m: 100.0, lateral_m: 0.0),\n{weather}], \
         ego_spec: \"always (ego.queue.gap >= 1)\")"
    )
}

fn world(text: &str) -> Scenario {
    Scenario::parse("shower.ron", text).unwrap_or_else(|error| panic!("{error}"))
}

fn begun(world: &Scenario) -> Testbench {
    let mut bench = world.bench();
    let key = StartKey {
        purpose: Purpose::Test,
        seed: 1,
        index: 0,
    };
    let start = bench.draw(key);
    bench.begin(&start, 7, Aftermath::Skip);
    bench
}

#[test]
fn brakes_lose_the_friction_that_the_rain_takes_sample_by_sample() {
    let world = world(&text(BRAKES, SHOWER));
    for plant in PLANTS {
        let mut bench = begun(&world.on(plant));
        // Down for 2 s and up for 1 s: 0.9 to 0.3, where the bound holds it, to 0.7.
        for action in [0, 0, 0, 0, 2, 2] {
            bench.decide(action);
        }
        let frictions = bench.trace().signal("rain.friction").expect("recorded");
        let speeds = bench.trace().signal("ego.speed").expect("recorded");
        let mut friction = 0.9;
        let mut speed_mps = 20.0;
        for (sample, (&shown, &driven)) in frictions.iter().zip(speeds).enumerate() {
            assert!((shown - friction).abs() < 1e-9, "{plant:?} {sample}");
            let off_mps = (driven - speed_mps).abs();
            assert!(off_mps < 0.02, "{plant:?} {sample}: {off_mps}");
            // The friction of a row holds until the next row.
            speed_mps = f64::max(speed_mps - friction * GRAVITY_MPS2 * SAMPLE_S, 0.0);
            let per_s = if sample < 4 * DECISION { -0.4 } else { 0.4 };
            friction = f64::clamp(friction + per_s * SAMPLE_S, 0.3, 0.9);
        }
        assert_eq!(frictions.len(), 6 * DECISION + 1);
        assert!(speed_mps > 4.0, "it still brakes at the end: {speed_mps}");
    }
}

#[test]
fn fog_shows_and_hides_the_parked_car_at_the_sample_worked_out_by_hand() {
    let calm = SHOWER
        .replace(", noise_scale: (1.0, 4.0)", "")
        .replace("noise_per_s: 1.0, ", "");
    let text = text(FOLLOWS, &calm).replace("sensors: (position_sd_m: 0.5), ", "");
    for plant in PLANTS {
        let mut bench = begun(&world(&text).on(plant));
        // Fog from 2.5 s on: 5 m less at each sample.
        for action in [1, 1, 1, 1, 1, 3] {
            bench.decide(action);
        }
        let accels = bench.trace().signal("ego.accel").expect("recorded");
        let reach_m = bench.trace().signal("rain.visibility").expect("recorded");
        assert_eq!(reach_m[50..53], [50.0, 45.0, 40.0]);
        // The rear of the parked car is at 95.46 m. At 1 m per sample it is 50.46 m away at
        // row 45 and 49.46 m at row 46, whose command acts on row 47.
        let first = accels.iter().position(|accel| *accel < -0.1);
        assert_eq!(first, Some(47), "{plant:?}");
        // It is at most 45.5 m away at row 51 and at least 43.4 m at row 52, and the row
        // after shows the free road: below its desired speed, it accelerates.
        let next = accels.iter().skip(47).position(|accel| *accel > 0.0);
        assert_eq!(next, Some(53 - 47), "{plant:?}");
    }
}

#[test]
fn an_episode_with_weather_forks_and_replays_bit_for_bit() {
    for plant in PLANTS {
        let world = world(&text(FOLLOWS, SHOWER)).on(plant);
        let mut bench = begun(&world);
        for action in [0, 4, 3] {
            bench.decide(action);
        }
        let mut fork = bench.fork().expect("a stock ego");
        for action in [2, 0, 1, 4, 3] {
            bench.decide(action);
            fork.decide(action);
        }
        assert_eq!(bench.trace(), fork.trace(), "{plant:?}");
        let noises = bench.trace().signal("rain.noise").expect("recorded");
        assert!(noises.iter().any(|noise| *noise > 1.4));
        // Noise is a function of the seed, and the weather scales it.
        let calm = |action: usize| {
            let mut bench = begun(&world);
            (0..8).for_each(|_| bench.decide(action));
            bench.trace().clone()
        };
        assert_eq!(calm(4), calm(4));
        let speeds = |action| calm(action).signal("ego.speed").map(<[f64]>::to_vec);
        assert_ne!(speeds(4), speeds(1), "{plant:?}");
    }
}

#[test]
fn a_kept_crash_in_rain_replays_and_is_refused_by_name_elsewhere() {
    let world =
        world(&text(BRAKES, SHOWER).replace("s_m: 100.0", "s_m: 45.0")).on(PlantKind::Kinematic);
    let mut bench = world.bench();
    let crash = play(
        &mut bench,
        &Start(vec![]),
        3,
        &mut Constant(0),
        Aftermath::Skip,
    );
    assert!(crash.verdict.is_success(), "{:?}", crash.verdict);
    assert!(crash.contact.is_some());
    let kept = Counterexample::record(&world, "nominal", &Change::default(), "constant", &crash);
    let dir = tempfile::tempdir().expect("a directory");
    let file = dir.path().join("crash.ron");
    kept.save(&file, &crash.trace).expect("written");
    let replayed = &Regressions::load(&file)
        .expect("kept")
        .replay_recorded()
        .expect("replayed")[0];
    assert!(replayed.is_reproduced());
    assert_eq!(replayed.episode, crash);
    let prevented = world.preventability(&crash);
    assert_eq!(
        prevented.not_applicable,
        Some(NotApplicable::ChangingWeather)
    );
    let refused = openx(&replayed.scenario, &replayed.episode, "crash", "nominal");
    let Err(ExportRefusal::OpenX(OpenXError::ChangingWeather { name })) = refused else {
        panic!("exported");
    };
    assert_eq!(name, "rain");
}

#[test]
fn a_changed_road_begins_beyond_the_bounds_and_only_comes_back() {
    let world = world(&text(BRAKES, SHOWER));
    let icy = Change {
        friction: Some(0.2),
        ..Change::default()
    };
    let mut bench = begun(&world.with(&icy).expect("a changed road"));
    for action in [0, 2] {
        bench.decide(action);
    }
    let frictions = bench.trace().signal("rain.friction").expect("recorded");
    assert_eq!(frictions[..=DECISION], [0.2; DECISION + 1]);
    assert!((frictions[2 * DECISION] - 0.4).abs() < 1e-9);
}

#[test]
fn the_first_visibility_is_drawn_as_an_axis() {
    let text = text(FOLLOWS, SHOWER);
    let ranged = world(&text.replace("visibility_m: 50.0", "visibility_m: (20.0, 60.0)"));
    let bench = ranged.bench();
    let axes: Vec<&str> = bench.axes().iter().map(|axis| axis.name.as_str()).collect();
    assert_eq!(axes, ["rain.visibility"]);
    let mut bench = ranged.bench();
    for metres in [20.0, 43.0] {
        bench.begin(&Start(vec![metres]), 1, Aftermath::Skip);
        let shown = bench.trace().signal("rain.visibility").expect("recorded");
        assert_eq!(shown[0], metres);
    }
}

#[test]
fn mistakes_in_weather_have_a_place_a_reason_and_a_cure() {
    let mistakes = [
        (
            "two weathers",
            format!("{SHOWER},\n{}", SHOWER.replace("rain", "fog")),
        ),
        (
            "reversed bounds",
            SHOWER.replace("(10.0, 80.0)", "(80.0, 10.0)"),
        ),
        ("no bounds", SHOWER.replace("friction: (0.3, 0.9), ", "")),
        ("a road outside", SHOWER.replace("(0.3, 0.9)", "(0.3, 0.8)")),
        ("bounds outside", SHOWER.replace("(0.3, 0.9)", "(0.0, 0.9)")),
        (
            "a start outside",
            SHOWER.replace("visibility_m: 50.0", "visibility_m: 500.0"),
        ),
        (
            "no start",
            SHOWER.replace("start: (visibility_m: 50.0), ", ""),
        ),
        ("a rate outside", SHOWER.replace("-100.0", "-5000.0")),
        (
            "another kind of action",
            SHOWER.replace(
                "Rates([(friction_per_s: -0.4), (), \
            (friction_per_s: 0.4), (visibility_mps: -100.0), \
            (noise_per_s: 1.0, visibility_mps: 20.0)])",
                "Phases([Hold, Advance])",
            ),
        ),
        ("no such action", SHOWER.replace("neutral: 1", "neutral: 5")),
        (
            "no noise from the start",
            SHOWER.replace("(1.0, 4.0)", "(2.0, 4.0)"),
        ),
    ];
    let mut shown = String::new();
    for (what, weather) in mistakes {
        assert_ne!(weather, SHOWER, "{what}");
        let Err(error) = Scenario::parse("shower.ron", &text(FOLLOWS, &weather)) else {
            panic!("{what}: accepted");
        };
        let rendered = Failure::from(error).render(plain_theme(), 100);
        shown.push_str(&format!("=== {what}\n{rendered}\n"));
    }
    insta::assert_snapshot!("weather_mistakes", shown);
}
