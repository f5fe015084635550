//! Roads that oppose and cross: oncoming traffic, crossings, things that stand.

use core::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use brakecheck::ego::{Command, Controller, Fault, Percept};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;

const PLANTS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];

/// Egos that follow a lead or watch their path, as worlds name them.
const BRAKING: [&str; 9] = [
    "Aeb(cruise_gain_per_s: 0.5, cruise_limit_mps2: 2.0, trigger_mps2: 4.0, max_brake_mps2: 7.0, margin_m: 1.5, side_m: 0.0, look_ahead_s: 2.0, lag_s: 0.3)",
    "Idm(desired_speed_mps: 18.0, time_gap_s: 1.2, min_gap_m: 2.0, max_accel_mps2: 1.5, comfort_brake_mps2: 2.5, max_brake_mps2: 7.0, lag_s: 0.3)",
    "Acc(kp_per_s2: 0.4, kd_per_s: 1.0, standstill_headway_m: 8.0, time_gap_s: 1.6, max_brake_mps2: 7.0, max_accel_mps2: 2.0, lag_s: 0.3)",
    "FilteredAcc(kp_per_s2: 0.4, kd_per_s: 1.0, standstill_headway_m: 8.0, time_gap_s: 1.6, max_brake_mps2: 7.0, max_accel_mps2: 2.0, filter_brake_mps2: 5.0, filter_margin_m: 2.0, filter_delay_s: 0.5, lag_s: 0.3)",
    "PoliteAcc(kp_per_s2: 0.4, kd_per_s: 1.0, standstill_headway_m: 8.0, time_gap_s: 1.6, max_brake_mps2: 7.0, max_accel_mps2: 2.0, soft_brake_mps2: 3.0, rear_gap_s: 0.5, lag_s: 0.3)",
    "IsoAcc(kp_per_s2: 0.4, kd_per_s: 1.0, standstill_headway_m: 8.0, time_gap_s: 1.6, aeb_trigger_mps2: 4.0, aeb_brake_mps2: 7.0, lag_s: 0.3)",
    "Gipps(desired_speed_mps: 18.0, reaction_s: 0.8, max_accel_mps2: 1.5, plan_brake_mps2: 4.0, leader_brake_mps2: 4.0, min_gap_m: 2.0, max_brake_mps2: 7.0, lag_s: 0.3)",
    "Fvdm(desired_speed_mps: 18.0, transition_m: 15.0, form: 1.5, sensitivity_per_s: 0.5, closing_gain_per_s: 0.6, min_gap_m: 2.0, max_accel_mps2: 2.0, max_brake_mps2: 7.0, lag_s: 0.3)",
    "Krauss(desired_speed_mps: 18.0, reaction_s: 0.8, max_accel_mps2: 1.5, plan_brake_mps2: 4.0, min_gap_m: 2.0, max_brake_mps2: 7.0, lag_s: 0.3)",
];

/// An ego, somebody far behind who learns, and others; two lanes of 3.5 m.
fn text(ego: &str, roads: &str, others: &str) -> String {
    format!(
        "Scenario(name: \"roads\", question: \"?\",
        clock: (horizon_s: 8.0, decision_s: 0.5, sample_s: 0.05, substeps: 4),
        road: Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9),
        roads: {{ {roads} }},
        agents: [
            Vehicle(name: \"ego\", body: \"sedan\",
                start: At(x_m: 0.0, speed_mps: (10.0, 15.0)), drive: Ego({ego})),
            {others}
            Vehicle(name: \"ado\", body: \"sedan\",
                start: At(x_m: -200.0, speed_mps: 5.0), drive: Ado(
                actions: Accelerations([0.0]), neutral: 0, observe: [\"time_left\"],
                rulebook: [Rule(name: \"any\", stl: \"always (ado.speed >= 0)\")])),
        ],
        ego_spec: \"always (ego.ado.gap >= 0.2 and ego.other.gap >= 0.2)\",
        allow: [])"
    )
}

fn parsed(text: &str) -> Result<Scenario, String> {
    Scenario::parse("roads.ron", text).map_err(|error| {
        let problem = &error.problems[0];
        let help = problem.help.as_deref().unwrap_or_default();
        format!("{}; {help}", problem.what)
    })
}

fn world(text: &str) -> Scenario {
    parsed(text).unwrap_or_else(|error| panic!("{error}"))
}

fn nth(world: &Scenario, index: u64) -> Episode {
    let mut bench = world.bench();
    let key = StartKey {
        purpose: Purpose::Test,
        seed: 1,
        index,
    };
    let start = bench.draw(key);
    play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play)
}

fn column<'a>(episode: &'a Episode, name: &str) -> &'a [f64] {
    let values = episode.trace.signal(name);
    values.unwrap_or_else(|| panic!("{name} is not published"))
}

/// How many of sixty starts end without the ego touching the other.
fn unharmed(world: &Scenario) -> usize {
    let held = |index: &u64| nth(world, *index).contact.is_none();
    (0..60).filter(held).count()
}

#[test]
fn a_car_across_the_lane_is_braked_for_in_sixty_of_sixty_starts() {
    // Its front in the next lane, in this one, or beyond it: the middle of the
    // front bumper says little of where such a car stands.
    for (lateral_m, heading_rad) in [(2.5, FRAC_PI_2), (-2.5, -FRAC_PI_2), (1.0, 2.2)] {
        let other = format!(
            "Obstacle(name: \"other\", body: \"sedan\", s_m: (70.0, 100.0), \
             lateral_m: {lateral_m:?}, heading_rad: {heading_rad:?}),"
        );
        for ego in BRAKING {
            let world = world(&text(ego, "", &other)).on(PlantKind::Kinematic);
            assert_eq!(unharmed(&world), 60, "{heading_rad}: {ego}");
        }
        let world = world(&text(BRAKING[0], "", &other)).on(PlantKind::Rigid);
        assert_eq!(unharmed(&world), 60, "{heading_rad}: rigid");
    }
}

#[test]
fn a_car_that_comes_along_the_ego_s_lane_is_braked_for_from_afar() {
    for lane in [0, 1] {
        let other = format!(
            "Vehicle(name: \"other\", body: \"sedan\", lane: {lane}, direction: Against, \
             start: At(x_m: 150.0, speed_mps: 5.0), drive: Scripted(ConstantSpeed)),"
        );
        for ego in BRAKING {
            let world = world(&text(ego, "", &other)).on(PlantKind::Kinematic);
            let episode = nth(&world, 0);
            let speed_mps = column(&episode, "ego.speed");
            let least_mps = speed_mps.iter().copied().fold(f64::INFINITY, f64::min);
            match lane {
                0 => assert!(least_mps < 0.4 * speed_mps[0], "{ego}: {least_mps}"),
                _ => assert!(speed_mps[0] - 1.0 < least_mps, "{ego}: {least_mps}"),
            }
        }
    }
}

#[test]
fn who_drives_against_the_road_keeps_its_lane_and_meets_the_ego_exactly() {
    let ego = "Idm(desired_speed_mps: 12.0, time_gap_s: 0.1, min_gap_m: 0.0, max_accel_mps2: 0.01, \
               comfort_brake_mps2: 9.0, max_brake_mps2: 0.0, lag_s: 0.0)";
    for plant in PLANTS {
        for (lane, touches) in [(0, true), (1, false)] {
            let other = format!(
                "Vehicle(name: \"other\", body: \"van\", lane: {lane}, direction: Against, \
                 start: At(x_m: 100.0, speed_mps: 8.0), drive: Scripted(ConstantSpeed)),"
            );
            let text = text(ego, "", &other)
                .replace("(10.0, 15.0)", "12.0")
                .replace("ego.ado.gap", "ego.other.ttc >= 0 and ego.ado.gap")
                .replace(
                    "ado.speed >= 0",
                    "ado.speed >= 0 and other.s <= 101 and other.lateral <= 9",
                );
            let episode = nth(&world(&text).on(plant), 0);
            assert_eq!(episode.contact.is_some(), touches, "{plant:?}");
            let lateral_m = column(&episode, "other.lateral");
            let kept_m = 3.5 * f64::from(lane);
            assert!(
                lateral_m.iter().all(|m| (m - kept_m).abs() < 0.02),
                "{plant:?}"
            );
            let heading = column(&episode, "other.heading")[0];
            assert!((heading.abs() - PI).abs() < 1e-3, "{heading}");
            // Fronts meet: the whole way over the sum of the speeds.
            let ttc_s = column(&episode, "ego.other.ttc")[0];
            assert!((ttc_s - 5.0).abs() < 0.01, "{plant:?} {ttc_s}");
            if let Some(touch) = &episode.contact {
                assert!((touch.time_s - 5.0).abs() < 0.01, "{plant:?} {touch:?}");
                assert!(
                    (touch.closing_speed_mps - 20.0).abs() < 0.05,
                    "{plant:?} {touch:?}"
                );
            }
        }
    }
}

/// A world with a road that crosses the ego's at x = 50, from the right or left.
fn crossing(from_right: bool, priority: &str) -> Scenario {
    let (y_m, heading_rad) = if from_right {
        (-40.0, FRAC_PI_2)
    } else {
        (40.0, -FRAC_PI_2)
    };
    let roads = format!(
        "\"side\": (at: (x_m: 50.0, y_m: {y_m:?}, heading_rad: {heading_rad:?}), priority: {priority})"
    );
    let other = "Vehicle(name: \"other\", body: \"sedan\", road: \"side\", \
                 start: At(x_m: 10.0, speed_mps: 6.0), drive: Scripted(ConstantSpeed)),";
    let text = text(BRAKING[0], &roads, other).replace(
        "ego.ado.gap",
        "(other.ego.priority or ego.other.priority) and ego.other.conflict >= -900 and other.ego.conflict >= -900 \
         and other.ego.conflict_time >= 0 and other.lateral >= -900 and ego.other.headway >= -900 and ego.ado.gap",
    );
    world(&text)
}

#[test]
fn a_crossing_is_where_both_ways_meet_whoever_asks() {
    for plant in PLANTS {
        let episode = nth(&crossing(true, "Yields").on(plant), 0);
        let first = |name: &str| column(&episode, name)[0];
        for (name, value) in [
            ("ego.other.conflict", 50.0),
            ("other.ego.conflict", 30.0),
            ("other.ego.conflict_time", 5.0),
            ("other.lateral", 0.0),
            ("ego.other.headway", 50.0),
            ("other.x", 50.0),
            ("other.y", -30.0),
        ] {
            let found = first(name);
            assert!((found - value).abs() < 0.01, "{plant:?} {name}: {found}");
        }
        let conflict_m = column(&episode, "other.ego.conflict");
        let y_m = column(&episode, "other.y");
        let mut both = conflict_m.iter().zip(y_m);
        assert!(both.all(|(way, y)| (way + y).abs() < 0.01), "{plant:?}");
    }
}

#[test]
fn the_road_s_priority_goes_before_the_right() {
    for (from_right, priority, other_first) in [
        (true, "Equal", true),
        (false, "Equal", false),
        (true, "Yields", false),
        (false, "Over", true),
    ] {
        let episode = nth(&crossing(from_right, priority), 0);
        let says = |name: &str| column(&episode, name)[0] == 1.0;
        let found = (says("other.ego.priority"), says("ego.other.priority"));
        assert_eq!(
            found,
            (other_first, !other_first),
            "{from_right} {priority}"
        );
    }
}

#[test]
fn who_turns_left_across_the_ego_s_way_meets_it_on_the_arc_and_yields() {
    let text = include_str!("../../worlds/turn_across.ron");
    let world = Scenario::parse("turn_across.ron", text).unwrap_or_else(|error| panic!("{error}"));
    let spec = world.drive().expect("a road").spec();
    let episode = nth(&world, 0);
    // The arc of 12 m around (72, −8.5) cuts y = 0 at x = 72 − √(144 − 72.25).
    let x_m = 72.0 - (144.0_f64 - 72.25).sqrt();
    let conflict_m = column(&episode, "ego.ado.conflict")[0];
    assert!((conflict_m - x_m).abs() < 0.01, "{conflict_m}");
    assert_eq!(column(&episode, "ego.ado.priority")[0], 1.0);
    assert_eq!(spec.roads["turn"].pieces.len(), 2);
}

#[test]
fn signals_of_crossings_exist_only_between_roads() {
    let side = "\"side\": (at: (x_m: 50.0, y_m: -40.0, heading_rad: 1.57))";
    let other = "Obstacle(name: \"other\", body: \"sedan\", s_m: 90.0, lateral_m: 6.0),";
    let text = text(BRAKING[0], side, other);
    let error = parsed(&text.replace("ego.ado.gap", "ego.ado.conflict >= 0 and ego.ado.gap"))
        .expect_err("both are on one road");
    assert!(error.contains("ego.ado.conflict"), "{error}");
}

#[test]
fn what_cannot_be_laid_or_driven_is_refused_by_name() {
    let side = "\"side\": (at: (x_m: 50.0, y_m: -40.0, heading_rad: 1.57)SIDE)";
    let other = "Vehicle(name: \"other\", body: \"sedan\", road: \"side\", lane: 0, \
                 start: At(x_m: 10.0, speed_mps: 6.0), drive: Scripted(ConstantSpeed)),";
    let sound = text(BRAKING[0], side, other);
    assert!(parsed(&sound.replace("SIDE", "")).is_ok());
    for (from, to, says) in [
        (
            "SIDE",
            ", pieces: [Clothoid(length_m: 20.0)]",
            "`Clothoid` is not known here",
        ),
        ("SIDE", ", roundabout: true", "unknown field `roundabout`"),
        (
            "SIDE",
            ", pieces: [Arc(length_m: 20.0, radius_m: 2.0)]",
            "folds the lanes over",
        ),
        ("SIDE", ", lanes: 0", "lanes, not 0"),
        ("road: \"side\"", "road: \"sid\"", "did you mean `side`"),
        ("lane: 0", "lane: 1", "lane 1 on a road of 1 lane"),
        ("speed_mps: 6.0", "speed_mps: -6.0", "start speeds are 0"),
        (
            "At(x_m: 10.0,",
            "Ahead(of: \"ego\", headway_m: 10.0,",
            "`ego` is on another road",
        ),
        ("x_m: 50.0, y", "x_m: 5e4, y", "outside of -5000"),
        (
            "body: \"sedan\",\n",
            "body: \"sedan\", road: \"side\",\n",
            "the ego drives on the world's own",
        ),
        (
            "body: \"sedan\",\n",
            "body: \"sedan\", direction: Against,\n",
            "turn the road round",
        ),
    ] {
        assert!(sound.contains(from), "no {from}");
        let error = parsed(&sound.replacen(from, to, 1).replace("SIDE", "")).expect_err(to);
        assert!(error.contains(says), "{to}: {error}");
    }
}

#[test]
fn whoever_begins_in_a_crossing_that_is_taken_is_told_so() {
    let side = "\"side\": (at: (x_m: 0.0, y_m: -40.0, heading_rad: 1.57))";
    let other = "Vehicle(name: \"other\", body: \"sedan\", road: \"side\", \
                 start: At(x_m: (38.0, 60.0), speed_mps: 6.0), drive: Scripted(ConstantSpeed)),";
    let text = text(BRAKING[0], side, other);
    let error = parsed(&text).expect_err("they overlap");
    assert!(error.contains("may start inside each other"), "{error}");
}

/// Says by how it accelerates whom it sees.
#[derive(Clone)]
struct Sees(&'static str);

impl Controller for Sees {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let sees = percept.others.iter().any(|seen| seen.name == self.0);
        Ok(Command::accelerate(if sees { -1.0 } else { 1.0 }))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

#[test]
fn who_is_behind_a_parked_van_is_not_seen_until_it_comes_out() {
    let text = include_str!("parked_cars.ron");
    let world = Scenario::parse("parked_cars.ron", text).unwrap_or_else(|error| panic!("{error}"));
    let everybody = world
        .with(&world.reuse()["sees everybody"])
        .expect("it fits");
    // At a standstill at first: whoever is seen at t = 0 is from the same place.
    for (world, name, action, seen_at_first, seen_later) in [
        (&world, "first", 0, true, true),
        (&world, "second", 0, true, true),
        (&world, "ado", 0, false, false),
        (&world, "ado", 2, false, true),
        (&everybody, "ado", 0, true, true),
    ] {
        let world = world.with_ego("sees", Arc::new(move || Box::new(Sees(name))));
        let mut bench = world.bench();
        let start = bench.draw(StartKey {
            purpose: Purpose::Test,
            seed: 1,
            index: 0,
        });
        let episode = play(
            &mut bench,
            &start,
            0,
            &mut Constant(action),
            Aftermath::Play,
        );
        let accel_mps2 = column(&episode, "ego.accel");
        let ahead_m = column(&episode, "ego.ado.headway");
        // Later: a second before the ego is beside it.
        let later = ahead_m
            .iter()
            .position(|m| *m < 12.0)
            .expect("it gets there");
        let sees = |sample: usize| accel_mps2[sample] < 0.0;
        let found = (sees(2), sees(later));
        assert_eq!(found, (seen_at_first, seen_later), "{name} {action}");
    }
}

#[test]
fn an_ego_that_steers_passes_whom_braking_alone_does_not_avoid() {
    let other = "Vehicle(name: \"other\", body: \"sedan\", lane: 0, direction: Against, \
                 start: At(x_m: 90.0, speed_mps: (9.0, 12.0)), drive: Scripted(ConstantSpeed)),";
    let aeb = BRAKING[0];
    let steers = aeb.replace("Aeb(", "PurePursuit(").replace(
        "lag_s",
        "evade_mps2: 4.0, preview_s: 0.9, preview_min_m: 6.0, side_limit_mps2: 5.0, lag_s",
    );
    for plant in PLANTS {
        let braking = world(&text(aeb, "", other)).on(plant);
        assert_eq!(
            unharmed(&braking),
            0,
            "{plant:?}: nobody can brake for this"
        );
        let steering = world(&text(&steers, "", other)).on(plant);
        assert_eq!(unharmed(&steering), 60, "{plant:?}");
    }
}

#[test]
fn an_ego_that_steers_keeps_its_lane_and_comes_back_to_it() {
    let steers = "PurePursuit(cruise_gain_per_s: 0.5, cruise_limit_mps2: 2.0, trigger_mps2: 4.0, \
        max_brake_mps2: 7.0, margin_m: 1.5, side_m: 0.2, look_ahead_s: 2.0, evade_mps2: 4.0, \
        preview_s: 0.9, preview_min_m: 6.0, side_limit_mps2: 5.0, lag_s: 0.1)";
    let other = "Vehicle(name: \"other\", body: \"motorcycle\", lane: 0, direction: Against, \
                 start: At(x_m: 100.0, speed_mps: 12.0), drive: Scripted(ConstantSpeed)),";
    for plant in PLANTS {
        let watched = text(steers, "", other).replace("ado.speed >= 0", "ego.lateral >= -90");
        let episode = nth(&world(&watched).on(plant), 0);
        assert!(episode.contact.is_none(), "{plant:?}");
        let lateral_m = column(&episode, "ego.lateral");
        let farthest_m = lateral_m.iter().fold(0.0, |most: f64, m| most.max(m.abs()));
        let last_m = lateral_m.last().expect("samples").abs();
        assert!(
            farthest_m > 1.0 && last_m < 0.2,
            "{plant:?} {farthest_m} {last_m}"
        );
    }
    let bend = "Curved(lanes: 2, lane_width_m: 3.5, friction: 0.9, \
                pieces: [Line(length_m: 30.0), Arc(length_m: 120.0, radius_m: 120.0)])";
    let far = "Obstacle(name: \"other\", body: \"sedan\", s_m: 900.0, lateral_m: 0.0),";
    for plant in PLANTS {
        let curved = text(steers, "", far)
            .replace("Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9)", bend)
            .replace("ado.speed >= 0", "ego.lateral >= -90");
        let episode = nth(&world(&curved).on(plant), 0);
        let lateral_m = column(&episode, "ego.lateral");
        let farthest_m = lateral_m.iter().fold(0.0, |most: f64, m| most.max(m.abs()));
        assert!(farthest_m < 0.3, "{plant:?} {farthest_m}");
    }
}

#[test]
fn every_road_is_exported_where_it_lies() {
    let scenario = crossing(true, "Yields");
    let episode = nth(&scenario, 0);
    let files = brakecheck_crashes::crashes::export::openx(&scenario, &episode, "it", "nominal");
    let road = files.expect("it is exported").road;
    let (_, side) = road
        .split_once("<road name=\"side\"")
        .expect("the side road");
    assert_eq!(road.matches("<road ").count(), 2);
    assert!(
        side.contains("id=\"2\"") && side.contains("hdg=\"1.57"),
        "{side}"
    );
    let number = |key: &str| -> f64 {
        let (_, rest) = side.split_once("<geometry").expect("a line");
        let (_, rest) = rest.split_once(&format!(" {key}=\"")).expect(key);
        let (value, _) = rest.split_once('"').expect("its end");
        value.parse().expect("a number")
    };
    // From a whole ten of metres at least 50 m behind the rearmost body.
    let behind_m = -40.0 - number("y");
    assert!((number("x") - 50.0).abs() < 1e-9, "{}", number("x"));
    assert!(behind_m >= 50.0 && behind_m % 10.0 < 1e-6, "{behind_m}");
}

#[test]
fn pages_have_the_outlines_of_all_roads() {
    let stage = crossing(true, "Yields").bench().stage();
    assert_eq!(
        (stage.lane_borders_m.len(), stage.side_roads_m.len()),
        (3, 1)
    );
    let side = &stage.side_roads_m[0];
    let x_m: Vec<f64> = side.iter().map(|border| border[0][0]).collect();
    let found: Vec<f64> = x_m.iter().map(|x| (x * 100.0).round() / 100.0).collect();
    assert_eq!(found, [51.75, 48.25]);
}
