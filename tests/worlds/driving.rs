//! Driving worlds of every kind: curves, lights, walkers, sensors, mistakes.

use std::sync::Arc;

use brakecheck::cli::{Failure, plain_theme};
use brakecheck::ego::Phase;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::PlantKind;
use brakecheck::world::{Change, Patch, Scenario};
use brakecheck_scene::testbench::film::film;

const ACC: &str = include_str!("../../worlds/acc.ron");
const MERGE: &str = include_str!("../../worlds/merge.ron");
const LIGHT: &str = include_str!("../../worlds/light_ado.ron");
const WALKER: &str = include_str!("../../worlds/pedestrian.ron");
const PLANTS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];

fn with(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the world no longer contains {from}");
    text.replacen(from, to, 1)
}

fn world(text: &str) -> Scenario {
    Scenario::parse("world.ron", text).unwrap_or_else(|error| panic!("{error}"))
}

fn episode(world: &Scenario, action: usize, noise: u64) -> Episode {
    let mut bench = world.bench();
    let key = StartKey {
        purpose: Purpose::Test,
        seed: 1,
        index: 0,
    };
    let start = bench.draw(key);
    play(
        &mut bench,
        &start,
        noise,
        &mut Constant(action),
        Aftermath::Skip,
    )
}

#[test]
fn cars_keep_their_lanes_around_curves() {
    let roads = [
        "Curved(lanes: 2, lane_width_m: 3.5, friction: 0.9, pieces: [\
         Line(length_m: 30.0), Arc(length_m: 80.0, radius_m: 90.0), Arc(length_m: 60.0, radius_m: -120.0)])",
        "Polyline(lanes: 2, lane_width_m: 3.5, friction: 0.9, corner_radius_m: 90.0, \
         points_m: [(0.0, 0.0), (80.0, 0.0), (160.0, 60.0), (400.0, 60.0)])",
    ];
    for road in roads {
        let straight = "Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9)";
        let text = with(MERGE, straight, road).replace("(8.0, 25.0)", "(8.0, 14.0)");
        for plant in PLANTS {
            let played = episode(&world(&text).on(plant), 1, 0);
            let turned = played.trace.signal("ado.heading").expect("published");
            assert!(turned.iter().any(|rad| rad.abs() > 0.3), "{plant:?}");
            let offset = played.trace.signal("ado.lateral").expect("published");
            let worst = offset.iter().map(|m| (m - 3.5).abs()).fold(0.0, f64::max);
            assert!(worst < 0.3, "{plant:?}: {worst} m off its lane on {road}");
        }
    }
}

#[test]
fn a_road_may_turn_back_beside_itself() {
    // A hairpin of half a circle, and a spiral that turns farther.
    let turns = [
        "[Line(length_m: 60.0), Arc(length_m: 62.8, radius_m: 20.0)]",
        "[Arc(length_m: 31.4, radius_m: 20.0), Arc(length_m: 54.9, radius_m: 35.0), \
         Arc(length_m: 40.0, radius_m: 50.0), \
         Arc(length_m: 90.0, radius_m: -50.0)]",
    ];
    for pieces in turns {
        let road = format!("Curved(lanes: 2, lane_width_m: 3.5, friction: 0.9, pieces: {pieces})");
        let text = with(
            MERGE,
            "Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9)",
            &road,
        );
        let world = world(&text.replace("(8.0, 25.0)", "(6.0, 8.0)"));
        let played = episode(&world.on(PlantKind::Kinematic), 1, 0);
        let s_m = played.trace.signal("ego.s").expect("published");
        let is_smooth = s_m
            .windows(2)
            .all(|two| (-0.01..3.0).contains(&(two[1] - two[0])));
        assert!(is_smooth, "{pieces}");
    }
}

#[test]
fn the_ego_may_be_put_into_a_body_of_the_world_s_own() {
    let limousine = "bodies: { \"limousine\": (name: \"limousine\", \
        kind: Vehicle(wheelbase_m: 4.2, track_m: 1.6, front_overhang_m: 0.9, wheel_radius_m: 0.35, power_w: 200000.0), \
        length_m: 6.4, width_m: 1.9, height_m: 1.5, mass_kg: 2500.0, com_height_m: 0.55) },\n    agents: [";
    let text = with(ACC, "agents: [", limousine);
    let text = with(
        &text,
        "\"wet road\":",
        "\"limousine\": Change(ego_body: \"limousine\"),\n        \"wet road\":",
    );
    let world = world(&text);
    let longer = world.with(&world.reuse()["limousine"]).expect("it fits");
    let ego = |world: &Scenario| world.bench().stage().agents[0].size_m[0];
    assert_eq!((ego(&world), ego(&longer)), (4.54, 6.4));
    for (name, what) in [("limosine", "no body"), ("pedestrian", "no vehicle")] {
        let change = format!("ego_body: \"{name}\"");
        let wrong = text.replace("ego_body: \"limousine\"", &change);
        let error = Scenario::parse("world.ron", &wrong).expect_err("no such body");
        assert!(error.to_string().contains(what), "{error}");
    }
}

#[test]
fn a_lane_change_takes_its_lag_and_no_more() {
    for plant in PLANTS {
        let played = episode(&world(MERGE).on(plant), 4, 0);
        let lateral = played.trace.signal("ado.lateral").expect("published");
        // After 1.5 s at 1.5 m/s, less the lag of 0.3 s, it has moved 1.8 m,
        // and the swing of the nose adds to it.
        let moved_m = 3.5 - lateral[30.min(lateral.len() - 1)];
        assert!((1.5..2.3).contains(&moved_m), "{plant:?}: {moved_m} m");
    }
}

#[test]
fn noise_is_a_function_of_its_seed_and_delay_is_not_random() {
    let noisy = world(&with(
        MERGE,
        "    agents: [",
        "    sensors: (delay_s: 0.1, position_sd_m: 0.5, speed_sd_mps: 0.3),\n    agents: [",
    ));
    let slow = world(&with(
        MERGE,
        "    agents: [",
        "    sensors: (delay_s: 0.3),\n    agents: [",
    ));
    let cut_in = 3;
    assert_eq!(episode(&noisy, cut_in, 7), episode(&noisy, cut_in, 7));
    let differ = (0..20)
        .any(|seed| episode(&noisy, cut_in, seed).trace != episode(&noisy, cut_in, seed + 1).trace);
    assert!(differ, "noise changes nothing");
    assert_eq!(
        episode(&slow, cut_in, 1).trace,
        episode(&slow, cut_in, 2).trace
    );
    assert_ne!(
        episode(&slow, cut_in, 1).trace,
        episode(&world(MERGE), cut_in, 1).trace
    );
}

#[test]
fn a_light_that_advances_breaks_its_minimum_times_and_is_filmed() {
    let world = world(LIGHT);
    let played = episode(&world, 1, 0);
    assert_eq!(played.verdict.word(), "foul");
    let frames = film(&mut world.bench(), &played);
    let stage = world.bench().stage();
    assert_eq!(stage.lights.len(), 1);
    assert_eq!(frames[0].phases, [Phase::Green]);
    assert!(frames.iter().any(|frame| frame.phases == [Phase::Yellow]));
    let coasting = episode(&world, 0, 0);
    assert_eq!(coasting.verdict.word(), "held");
}

#[test]
fn a_walker_crosses_at_the_speed_of_its_action() {
    for plant in PLANTS {
        let played = episode(&world(WALKER).on(plant), 2, 0);
        let across = played.trace.signal("ado.lateral_speed").expect("published");
        let top = across.iter().copied().fold(0.0, f64::max);
        assert!((top - 1.4).abs() < 1e-9, "{plant:?}: {top} m/s");
    }
}

/// A mistake: what it is, and the text of a world with it.
fn mistakes() -> Vec<(&'static str, String)> {
    vec![
        (
            "a lateral speed of none",
            with(MERGE, "lateral_mps: 1.5", "lateral_mps: 0.0"),
        ),
        (
            "an unknown lateral move",
            with(MERGE, "[Hold, Right]", "[Hold, Rihgt]"),
        ),
        (
            "walking for a car",
            with(
                MERGE,
                "        Vehicle(\n            name: \"ado\"",
                "        Vehicle(name: \"other\", body: \"sedan\", start: At(x_m: 200.0, speed_mps: 1.0), drive: Scripted(Walk([(0.0, 0.0, 1.0)]))),\n        Vehicle(\n            name: \"ado\"",
            ),
        ),
        (
            "driving for a walker",
            with(
                WALKER,
                "actions: Walks([(0.0, 0.0), (0.0, 0.7), (0.0, 1.4), (0.0, 2.0), (0.0, -1.0)])",
                "actions: Accelerations([0.0, 1.0])",
            ),
        ),
        (
            "a walker with the body of a car",
            with(
                WALKER,
                "name: \"ado\", lateral_m",
                "name: \"ado\", body: \"van\", lateral_m",
            ),
        ),
        (
            "a light that drives",
            with(
                LIGHT,
                "Phases([Hold, Advance])",
                "Accelerations([0.0, 1.0])",
            ),
        ),
        (
            "a schedule out of order",
            with(
                include_str!("../../worlds/yellow_light.ron"),
                "[(0.0, Yellow), (2.0, Red)]",
                "[(2.0, Yellow), (0.0, Red)]",
            ),
        ),
        (
            "a delay that is no multiple",
            with(
                MERGE,
                "    agents: [",
                "    sensors: (delay_s: 0.12),\n    agents: [",
            ),
        ),
        (
            "a curve that folds the lanes over",
            with(
                MERGE,
                "Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9)",
                "Curved(lanes: 2, lane_width_m: 3.5, friction: 0.9, pieces: [Arc(length_m: 9.0, radius_m: 6.0)])",
            ),
        ),
        (
            "a road that is a full circle",
            with(
                MERGE,
                "Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9)",
                "Curved(lanes: 2, lane_width_m: 3.5, friction: 0.9, pieces: [Arc(length_m: 54.5, radius_m: 17.4), Arc(length_m: 54.5, radius_m: 17.4)])",
            ),
        ),
        (
            "a polyline that crosses itself",
            with(
                MERGE,
                "Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9)",
                "Polyline(lanes: 2, lane_width_m: 3.5, friction: 0.9, corner_radius_m: 20.0, points_m: [(0.0, 0.0), (200.0, 0.0), (200.0, 100.0), (60.0, 100.0), (60.0, -100.0)])",
            ),
        ),
        (
            "a rule that cannot be kept",
            with(
                MERGE,
                "always[0, T] (ado.speed <= v_lim)",
                "eventually[1, 2] (ado.speed >= 60)",
            ),
        ),
        (
            "an unknown controller",
            with(MERGE, "drive: Ego(Merge(", "drive: Ego(Merger("),
        ),
        (
            "sensors in reuse that make no sense",
            with(
                MERGE,
                "Change(sensors: (delay_s: 0.1))",
                "Change(sensors: (delay_s: 9.0))",
            ),
        ),
    ]
}

#[test]
fn mistakes_in_driving_worlds_have_a_place_a_reason_and_a_cure() {
    let mut shown = String::new();
    for (what, text) in mistakes() {
        let Err(error) = Scenario::parse("world.ron", &text) else {
            panic!("{what}: accepted");
        };
        let rendered = Failure::from(error).render(plain_theme(), 100);
        shown.push_str(&format!("=== {what}\n{rendered}\n"));
    }
    insta::assert_snapshot!("driving_mistakes", shown);
}

#[test]
fn an_ego_written_in_rust_meets_the_lag_of_the_car_it_drives() {
    let mut lagged = 0;
    for (name, world) in super::shipped() {
        let lag_s = |lag_s| Change {
            ego: Patch([("lag_s".to_owned(), lag_s)].into()),
            ..Change::default()
        };
        let Ok(other) = world.with(&lag_s(0.7)) else {
            continue;
        };
        for world in [world, other] {
            let stock = world.controller().expect("a stock ego").controller;
            // The same law as a type of the user's: equal percepts, equal
            // wishes, so equal bits show the same actuator behind them.
            let mine = world.with_ego("mine", Arc::new(move || stock.build()));
            let played = episode(&world, 0, 5);
            assert_eq!(episode(&mine, 0, 5).trace, played.trace, "{name}");
            let prompt = world.with(&lag_s(0.0)).expect("a parameter");
            lagged += usize::from(episode(&prompt, 0, 5).trace != played.trace);
        }
    }
    assert!(lagged >= 10, "the lag decides in {lagged} worlds only");
}
