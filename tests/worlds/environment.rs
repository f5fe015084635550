//! Starts that draw friction and sensors: the values are those of the start, in every
//! run, on every bench and from every file.

use brakecheck::crashes::Regressions;
use brakecheck::run_dir::Counterexample;
use brakecheck::scene::Start;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, Episode, Testbench, play};
use brakecheck::world::PlantKind;
use brakecheck::world::{Change, Scenario};
use brakecheck_crashes::crashes::export::openx;

const ACC: &str = include_str!("../../worlds/acc.ron");
const PLANTS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];
/// Axes of `acc.ron`: the speed of the ego, and headway and speed of the ado.
const OTHERS: usize = 3;
const RANGES: [&str; 4] = ["(0.3, 0.9)", "(0.0, 0.3)", "(0.0, 0.5)", "(0.1, 0.4)"];
const SAMPLE_S: f64 = 0.05;

/// `acc.ron` with harder braking and this friction, delay and noise, without its family.
fn text([friction, delay_s, position_sd_m, speed_sd_mps]: [&str; 4]) -> String {
    let (head, _) = ACC.split_once("    train_against:").expect("a family");
    let sensors = format!(
        "sensors: (delay_s: {delay_s}, position_sd_m: {position_sd_m}, speed_sd_mps: {speed_sd_mps}),\n    agents: ["
    );
    let changed = head
        .replace("friction: 0.9)", &format!("friction: {friction})"))
        .replace("agents: [", &sensors)
        .replace("[-3.0, 0.0, 3.0]", "[-8.0, 0.0, 3.0]");
    format!("{changed})")
}

fn world(numbers: [&str; 4]) -> Scenario {
    let text = text(numbers);
    Scenario::parse("acc.ron", &text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn draw(bench: &Testbench, index: u64) -> Start {
    bench.draw(StartKey {
        purpose: Purpose::Calibration,
        seed: 3,
        index,
    })
}

fn braking(bench: &mut Testbench, start: &Start) -> Episode {
    play(bench, start, 7, &mut Constant(0), Aftermath::Play)
}

/// The world with the numbers that a start draws, and its start.
fn with_drawn_numbers(start: &Start) -> (Scenario, Start) {
    let numbers: Vec<String> = start.0[OTHERS..]
        .iter()
        .map(|it| format!("{it:?}"))
        .collect();
    let numbers = [&numbers[0], &numbers[1], &numbers[2], &numbers[3]].map(String::as_str);
    (world(numbers), Start(start.0[..OTHERS].to_vec()))
}

#[test]
fn the_environment_is_drawn_after_all_other_values() {
    let (plain, ranged) = (world(["0.9", "0.0", "0.0", "0.0"]), world(RANGES));
    let names: Vec<String> = ranged.axes().into_iter().map(|axis| axis.name).collect();
    let drawn = [
        "road.friction",
        "sensors.delay",
        "sensors.position_sd",
        "sensors.speed_sd",
    ];
    assert_eq!(names[OTHERS..], drawn);
    let (plain, again, ranged) = (plain.bench(), world(RANGES).bench(), ranged.bench());
    let (mut frictions, mut delays) = (Vec::new(), Vec::new());
    for index in 0..200 {
        let start = draw(&ranged, index);
        assert_eq!(start, draw(&again, index));
        assert_eq!(start.0[..OTHERS], draw(&plain, index).0);
        let [friction, delay_s, position_sd_m, speed_sd_mps] = start.0[OTHERS..] else {
            panic!("{start:?}");
        };
        assert!((0.0..=0.5).contains(&position_sd_m) && (0.1..=0.4).contains(&speed_sd_mps));
        frictions.push(friction);
        let samples = (delay_s / SAMPLE_S).round();
        assert!((delay_s - samples * SAMPLE_S).abs() < 1e-9, "{delay_s}");
        delays.push(samples as usize);
    }
    frictions.sort_by(f64::total_cmp);
    assert!(frictions[0] >= 0.3 && frictions[199] <= 0.9);
    assert!(
        frictions[0] < 0.35 && frictions[199] > 0.85,
        "{frictions:?}"
    );
    let count = |samples: usize| delays.iter().filter(|it| **it == samples).count();
    // 200 starts on seven delays.
    assert!((0..=6).all(|samples| count(samples) > 10), "{delays:?}");
}

#[test]
fn an_episode_is_that_of_a_world_with_the_drawn_numbers() {
    let ranged = world(RANGES);
    for plant in PLANTS {
        // One bench plays all starts, so nothing of an earlier one may remain.
        let mut bench = ranged.on(plant).bench();
        let mut robustness = Vec::new();
        for index in 0..6 {
            let start = draw(&bench, index);
            let played = braking(&mut bench, &start);
            let (fixed, others) = with_drawn_numbers(&start);
            let expected = braking(&mut fixed.on(plant).bench(), &others);
            assert_eq!(played.trace, expected.trace, "{plant:?} {start:?}");
            assert_eq!(played.verdict, expected.verdict);
            assert_eq!(played.contact, expected.contact);
            robustness.push(played.robustness);
            assert_eq!(ranged.at_start(&start).on(plant).axes(), ranged.axes());
        }
        robustness.dedup();
        assert!(robustness.len() > 1);
        let first = draw(&bench, 0);
        let again = braking(&mut bench, &first);
        assert_eq!(again, braking(&mut ranged.on(plant).bench(), &first));
    }
}

#[test]
fn friction_limits_the_braking_of_every_start() {
    let ranged = world(["(0.3, 0.7)", "0.0", "0.0", "0.0"]).on(PlantKind::Kinematic);
    let mut bench = ranged.bench();
    for index in 0..10 {
        let start = draw(&bench, index);
        let played = braking(&mut bench, &start);
        let speed = played.trace.signal("ado.speed").expect("published");
        let braked_mps2 = (speed[1] - speed[5]) / (4.0 * SAMPLE_S);
        let expected_mps2 = 9.81 * start.0[OTHERS];
        assert!(
            (braked_mps2 - expected_mps2).abs() < 0.02,
            "{start:?}: {braked_mps2}"
        );
    }
}

#[test]
fn a_range_of_one_value_is_that_value() {
    let number = world(["0.6", "0.1", "0.2", "0.3"]);
    let range = world(["(0.6, 0.6)", "(0.1, 0.1)", "(0.2, 0.2)", "(0.3, 0.3)"]);
    assert_eq!(number.axes(), range.axes());
    let (mut a, mut b) = (number.bench(), range.bench());
    for index in 0..5 {
        let start = draw(&a, index);
        assert_eq!(start, draw(&b, index));
        assert_eq!(braking(&mut a, &start), braking(&mut b, &start));
    }
}

#[test]
fn a_kept_crash_has_its_friction_and_so_has_its_export() {
    let ranged = world(RANGES);
    let mut bench = ranged.bench();
    let starts = (0..50).map(|index| draw(&bench, index)).collect::<Vec<_>>();
    let mut all = starts.iter().map(|start| braking(&mut bench, start));
    let crash = all.find(|it| it.verdict.is_success()).expect("a crash");
    let friction = crash.start.0[OTHERS];
    let kept = Counterexample::record(&ranged, "nominal", &Change::default(), "constant", &crash);
    assert_eq!(kept.start["road.friction"], friction);
    let dir = tempfile::tempdir().expect("a directory");
    let file = dir.path().join("crash.ron");
    kept.save(&file, &crash.trace).expect("written");
    let replayed = &Regressions::load(&file)
        .expect("kept")
        .replay_recorded()
        .expect("replayed")[0];
    assert!(replayed.is_reproduced());
    assert_eq!(replayed.episode, crash);
    let texts = openx(&replayed.scenario, &replayed.episode, "crash", "nominal");
    let text = texts.expect("exported").replay;
    let (_, rest) = text
        .split_once("frictionScaleFactor=\"")
        .expect("a surface");
    let (written, _) = rest.split_once('"').expect("its end");
    let written: f64 = written.parse().expect("a number");
    assert!((written - friction).abs() < 1e-9, "{written} {friction}");
}

#[test]
fn a_changed_ego_has_its_own_friction_and_sensors() {
    let ranged = world(RANGES);
    let start = draw(&ranged.bench(), 0);
    let (fixed, others) = with_drawn_numbers(&start);
    for name in ["wet road", "late sensors", "softer brakes"] {
        let change = &ranged.reuse()[name];
        let (changed, expected) = (ranged.with(change), fixed.with(change));
        let (changed, expected) = (changed.expect("it fits"), expected.expect("it fits"));
        assert_eq!(changed.axes(), ranged.axes());
        let played = braking(&mut changed.bench(), &start);
        assert_eq!(
            played.trace,
            braking(&mut expected.bench(), &others).trace,
            "{name}"
        );
    }
}

#[test]
fn ranges_that_cannot_be_drawn_are_refused_by_name() {
    let refused = |text: &str, says: &str| {
        let error = Scenario::parse("acc.ron", text)
            .expect_err(says)
            .to_string();
        assert!(error.contains(says), "{error}");
    };
    let cases = [
        (
            ["(0.9, 0.3)", "0.0", "0.0", "0.0"],
            "the range (0.9, 0.3) is reversed",
        ),
        (
            ["(0.0, 0.9)", "0.0", "0.0", "0.0"],
            "0 is outside of 0.01 ..= 2",
        ),
        (
            ["(0.5, 2.5)", "0.0", "0.0", "0.0"],
            "2.5 is outside of 0.01 ..= 2",
        ),
        (
            ["0.9", "(0.0, 0.12)", "0.0", "0.0"],
            "`delay_s` = 0.12 s is no multiple",
        ),
        (
            ["0.9", "(-0.1, 0.1)", "0.0", "0.0"],
            "-0.1 is outside of 0 ..= 5",
        ),
        (
            ["0.9", "0.0", "(0.0, 11.0)", "0.0"],
            "11 is outside of 0 ..= 10",
        ),
        (
            ["0.9", "0.0", "0.0", "(0.3, 0.1)"],
            "the range (0.3, 0.1) is reversed",
        ),
    ];
    for (numbers, says) in cases {
        refused(&text(numbers), says);
    }
    // A family that varies the delay as well.
    let sensors = "sensors: (delay_s: (0.0, 0.2)),\n    agents: [";
    let twice = ACC.replace("agents: [", sensors);
    refused(&twice, "the starts of this world draw `delay_s` already");
    // A table of starts with a delay between two samples.
    let points = "agents: [";
    let table =
        |delay_s: &str| {
            let rows = format!(
            "points: (axes: [\"ego.speed\", \"ado.headway\", \"ado.speed\", \"sensors.delay\"], \
             rows: [(10.0, 30.0, 10.0, {delay_s})]),\n    agents: ["
        ).replace("[(", "[[").replace(")]", "]]");
            text(["0.9", "(0.0, 0.2)", "0.0", "0.0"]).replace(points, &rows)
        };
    refused(&table("0.12"), "`delay_s` = 0.12 s is no multiple");
    assert!(Scenario::parse("acc.ron", &table("0.15")).is_ok());
}
