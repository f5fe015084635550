//! Starts that draw the width of lanes and the radii of arcs: each start has its own
//! road, in the run, for the ego, in pictures and in exported files.

use std::sync::{Arc, Mutex};

use brakecheck::crashes::Regressions;
use brakecheck::ego::{Briefing, Command, Controller, Fault, Percept};
use brakecheck::run_dir::Counterexample;
use brakecheck::scene::Start;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, Episode, Testbench, play};
use brakecheck::world::PlantKind;
use brakecheck::world::{Change, Scenario};
use brakecheck_crashes::crashes::export::openx;

const MERGE: &str = include_str!("../../worlds/merge.ron");
const PLANTS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];
/// Axes of `merge.ron`: the speed of the ego, and headway and speed of the ado.
const OTHERS: usize = 3;
const RANGES: [&str; 3] = ["(3.2, 3.8)", "(60.0, 120.0)", "(-90.0, -70.0)"];

/// `merge.ron` on a bent road, with this lane width and these radii.
fn text([lane_width_m, first_m, second_m]: [&str; 3]) -> String {
    let road = format!(
        "Curved(lanes: 2, lane_width_m: {lane_width_m}, friction: 0.9, pieces: [\
         Line(length_m: 20.0), Arc(length_m: 40.0, radius_m: {first_m}), \
         Arc(length_m: 40.0, radius_m: {second_m})])"
    );
    let straight = "Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9)";
    assert!(MERGE.contains(straight));
    MERGE
        .replace(straight, &road)
        .replace("(8.0, 25.0)", "(8.0, 14.0)")
}

fn world(numbers: [&str; 3]) -> Scenario {
    let text = text(numbers);
    Scenario::parse("merge.ron", &text).unwrap_or_else(|error| panic!("{error}"))
}

fn draw(bench: &Testbench, index: u64) -> Start {
    bench.draw(StartKey {
        purpose: Purpose::Calibration,
        seed: 5,
        index,
    })
}

/// An episode in which the ado brakes and moves to the right.
fn cut_in(bench: &mut Testbench, start: &Start) -> Episode {
    play(bench, start, 7, &mut Constant(3), Aftermath::Play)
}

/// The world with the numbers that a start draws, and its start.
fn with_drawn_numbers(start: &Start) -> (Scenario, Start) {
    let numbers: Vec<String> = start.0[OTHERS..]
        .iter()
        .map(|it| format!("{it:?}"))
        .collect();
    let numbers = [&numbers[0], &numbers[1], &numbers[2]].map(String::as_str);
    (world(numbers), Start(start.0[..OTHERS].to_vec()))
}

#[test]
fn an_episode_is_that_of_a_world_with_the_drawn_road() {
    let ranged = world(RANGES);
    let names: Vec<String> = ranged.axes().into_iter().map(|axis| axis.name).collect();
    let drawn = [
        "road.lane_width",
        "road.piece2.radius",
        "road.piece3.radius",
    ];
    assert_eq!(names[OTHERS..], drawn);
    let mut widths = Vec::new();
    for plant in PLANTS {
        let mut bench = ranged.on(plant).bench();
        for index in 0..4 {
            let start = draw(&bench, index);
            let played = cut_in(&mut bench, &start);
            let (fixed, others) = with_drawn_numbers(&start);
            let mut expected = fixed.on(plant).bench();
            assert_eq!(
                played.trace,
                cut_in(&mut expected, &others).trace,
                "{start:?}"
            );
            // The bench shows the road on which it plays.
            assert_eq!(bench.stage(), expected.stage());
            let begun = ranged.at_start(&start);
            assert_eq!(begun.bench().stage(), expected.stage());
            let lateral = played.trace.signal("ado.lateral").expect("published");
            assert!((lateral[0] - start.0[OTHERS]).abs() < 1e-3, "{start:?}");
            widths.push(start.0[OTHERS]);
        }
    }
    widths.dedup();
    assert!(widths.len() >= 4);
}

#[test]
fn a_road_of_fixed_numbers_is_the_road() {
    let number = world(["3.4", "80.0", "-75.0"]);
    let range = world(["(3.4, 3.4)", "(80.0, 80.0)", "(-75.0, -75.0)"]);
    assert_eq!(number.axes(), range.axes());
    let (mut a, mut b) = (number.bench(), range.bench());
    let start = draw(&a, 0);
    assert_eq!(start, draw(&b, 0));
    assert_eq!(cut_in(&mut a, &start), cut_in(&mut b, &start));
}

#[test]
fn a_kept_crash_has_its_road_and_so_has_its_export() {
    let ranged = world(RANGES);
    let mut bench = ranged.bench();
    let start = draw(&bench, 1);
    let episode = cut_in(&mut bench, &start);
    let kept = Counterexample::record(&ranged, "nominal", &Change::default(), "c", &episode);
    let dir = tempfile::tempdir().expect("a directory");
    let file = dir.path().join("crash.ron");
    kept.save(&file, &episode.trace).expect("written");
    let replayed = &Regressions::load(&file)
        .expect("kept")
        .replay_recorded()
        .expect("replayed")[0];
    assert!(replayed.is_reproduced());
    let texts = openx(&replayed.scenario, &replayed.episode, "crash", "nominal");
    let road = texts.expect("exported").road;
    let numbers = |key: &str| -> Vec<f64> {
        let begin = format!("{key}=\"");
        let parts = road.split(&begin).skip(1);
        let texts = parts.filter_map(|rest| rest.split('"').next());
        texts.filter_map(|text| text.parse().ok()).collect()
    };
    let curvatures = numbers("curvature");
    assert_eq!(curvatures.len(), 2);
    for (curvature, radius_m) in curvatures.iter().zip(&start.0[OTHERS + 1..]) {
        assert!(
            (curvature * radius_m - 1.0).abs() < 1e-9,
            "{curvature} {radius_m}"
        );
    }
    let width_m = start.0[OTHERS];
    // The left edge of two lanes is one and a half lanes from the middle of lane 0.
    let has = |value: f64| numbers("a").iter().any(|a| (a - value).abs() < 1e-9);
    assert!(has(width_m) && has(1.5 * width_m), "{width_m}: {road}");
}

/// Keeps its speed, and notes every road of which it is informed.
struct Listener(Arc<Mutex<Vec<Briefing>>>);

impl Controller for Listener {
    fn brief(&mut self, briefing: &Briefing) {
        self.0.lock().expect("sound").push(briefing.clone());
    }

    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
        Ok(Command::default())
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        None
    }
}

#[test]
fn the_ego_learns_of_every_road() {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let listener = {
        let heard = Arc::clone(&heard);
        move || Box::new(Listener(Arc::clone(&heard))) as Box<dyn Controller>
    };
    let ranged = world(RANGES).with_ego("listener", Arc::new(listener));
    let mut bench = ranged.bench();
    for index in 0..3 {
        let start = draw(&bench, index);
        cut_in(&mut bench, &start);
        let heard = heard.lock().expect("sound");
        let road = &heard.last().expect("a road").road;
        assert_eq!(road.lane_width_m, start.0[OTHERS]);
        assert_eq!(road.pieces[1].curvature_per_m, 1.0 / start.0[OTHERS + 1]);
    }
}

#[test]
fn roads_that_cannot_be_laid_at_an_end_are_refused() {
    let cases = [
        (
            ["(0.5, 3.5)", "60.0", "-70.0"],
            "0.5 is outside of 1 ..= 20",
        ),
        (
            ["3.5", "(120.0, 60.0)", "-70.0"],
            "the range (120, 60) is reversed",
        ),
        (
            ["3.5", "(-60.0, 60.0)", "-70.0"],
            "radii from -60 to 60 m turn both ways",
        ),
        (
            ["3.5", "60.0", "(-90.0, -6.0)"],
            "a radius of -6 m folds the lanes over",
        ),
        // Wide lanes with the narrow arc of another start.
        (
            ["(3.5, 7.0)", "(13.0, 60.0)", "-70.0"],
            "a radius of 13 m folds the lanes over",
        ),
        // Half a circle at the narrow end.
        (["3.5", "(12.0, 60.0)", "-70.0"], "a piece of 40 m"),
        // Cars beside each other do not fit.
        (
            ["(1.5, 3.5)", "60.0", "-70.0"],
            "may start inside each other",
        ),
    ];
    for (numbers, says) in cases {
        let text = text(numbers).replace("headway_m: (6.0, 40.0)", "headway_m: (3.0, 40.0)");
        let error = Scenario::parse("merge.ron", &text)
            .expect_err(says)
            .to_string();
        assert!(error.contains(says), "{numbers:?}: {error}");
    }
}

#[test]
fn named_roads_share_the_drawn_width_unless_they_state_their_own() {
    let roads = "roads: { \"side\": (at: (x_m: 90.0, y_m: -80.0, heading_rad: 1.5707963), lanes: 2), \
                 \"own\": (at: (x_m: 300.0, y_m: -80.0, heading_rad: 1.5707963), lane_width_m: 3.0) },\n    agents: [\n\
                 Vehicle(name: \"other\", body: \"sedan\", road: \"side\", lane: 1, \
                 start: At(x_m: -60.0, speed_mps: 1.0), drive: Scripted(ConstantSpeed)),";
    let parsed = |width: &str| {
        let text = text([width, "100.0", "-80.0"]).replacen("agents: [", roads, 1);
        Scenario::parse("merge.ron", &text).unwrap_or_else(|error| panic!("{error}"))
    };
    let ranged = parsed("(3.2, 3.8)");
    let start = draw(&ranged.bench(), 2);
    let width_m = start.0[OTHERS];
    let begun = ranged.at_start(&start);
    let driving = begun.drive().expect("a road");
    let widths: Vec<f64> = driving
        .spec()
        .roads
        .values()
        .map(|it| it.road.lane_width_m())
        .collect();
    assert_eq!(widths, [width_m, 3.0]);
    let fixed = parsed(&format!("{width_m:?}"));
    let others = Start(start.0[..OTHERS].to_vec());
    let played = cut_in(&mut ranged.bench(), &start);
    assert_eq!(played.trace, cut_in(&mut fixed.bench(), &others).trace);
}
