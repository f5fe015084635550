//! Planned motion of bodies that drive slower than their plan moves them sideways.

use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::{PlantKind, Scenario};

const PLANTS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];
const SAMPLE_S: f64 = 0.05;

/// A van on the right lane, far from an ego on the left one.
fn world(speed_mps: f64, drive: &str) -> Scenario {
    let text = format!(
        "Scenario(name: \"slow\", question: \"?\",
        clock: (horizon_s: 8.0, decision_s: 0.5, sample_s: {SAMPLE_S}, substeps: 5),
        judge: UntilContact,
        road: Straight(lanes: 3, lane_width_m: 3.5, friction: 0.9),
        agents: [
            Vehicle(name: \"ego\", body: \"sedan\", lane: 2,
                start: At(x_m: 0.0, speed_mps: 10.0), drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.0))),
            Vehicle(name: \"van\", body: \"van\", lane: 0,
                start: At(x_m: 200.0, speed_mps: {speed_mps:?}), drive: {drive}),
        ],
        ego_spec: \"always (ego.s >= -1 and van.s >= 0 and van.lateral >= -9 and van.heading >= -9 and van.speed >= -1)\")"
    );
    Scenario::parse("slow.ron", &text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn run(world: &Scenario, action: usize) -> Episode {
    let mut bench = world.bench();
    play(
        &mut bench,
        &Start(vec![]),
        0,
        &mut Constant(action),
        Aftermath::Play,
    )
}

fn column<'a>(episode: &'a Episode, name: &str) -> &'a [f64] {
    let values = episode.trace.signal(name);
    values.unwrap_or_else(|| panic!("{name} is not published"))
}

/// Rear axle at every sample, and the heading.
fn rear(episode: &Episode) -> Vec<(f64, f64, f64)> {
    let van = brakecheck_sim::sim::Body::shipped("van");
    let lever_m = van.expect("shipped").expect("a body").lever_m();
    let headings = column(episode, "van.heading").iter();
    let places = column(episode, "van.s")
        .iter()
        .zip(column(episode, "van.lateral"));
    let rears = places.zip(headings).map(|((s_m, lateral_m), heading_rad)| {
        let (sin, cos) = heading_rad.sin_cos();
        (s_m - lever_m * cos, lateral_m - lever_m * sin, *heading_rad)
    });
    rears.collect()
}

fn script(steps: &str) -> String {
    format!("Script([{steps}])")
}

#[test]
fn a_standing_body_keeps_its_place_and_its_heading() {
    let laws = [
        "LaneChange(by_m: 0.3, rate_mps: 0.2)",
        "LaneChange(by_m: -3.0, rate_mps: 2.0, shape: Linear)",
        "LaneChange(by_m: 3.5, rate_mps: 5000.0, shape: Linear)",
        "LaneChange(by_m: 3.5, rate_mps: 1.0, shape: Cubic)",
        "LaneOffset(to_m: 0.5, most_lateral_mps2: 0.3)",
    ];
    for (law, plant) in laws.iter().flat_map(|law| PLANTS.map(|plant| (law, plant))) {
        let drive = script(&format!("(after_s: 1.0, does: [{law}])"));
        let episode = run(&world(0.0, &drive).on(plant), 0);
        let places = rear(&episode);
        assert!(places.len() > 100);
        for place in &places {
            let off_m = (place.0 - places[0].0)
                .abs()
                .max((place.1 - places[0].1).abs());
            assert!(off_m < 1e-4 && place.2.abs() < 1e-5, "{law}: {place:?}");
        }
    }
}

#[test]
fn a_delayed_change_of_lane_goes_on_once_the_body_drives() {
    // It stands for 3 s, and the change of lane takes 1.75·π s from then on.
    let drive = script(
        "(after_s: 1.0, does: [LaneChange(by_m: 3.5, rate_mps: 1.0)], overlaps: true),
         (after_s: 2.0, does: [Speed(to_mps: 8.0)])",
    );
    let places = rear(&run(&world(0.0, &drive), 0));
    let at = |time_s: f64| places[(time_s / SAMPLE_S).round() as usize];
    assert!((at(3.0).1 - 0.0).abs() < 1e-4, "{:?}", at(3.0));
    let half_s = 0.5 * 1.75 * core::f64::consts::PI;
    let share = (6.0 - 3.0) / (2.0 * half_s);
    let expected_m = 1.75 * (1.0 - (core::f64::consts::PI * share).cos());
    assert!(
        (at(6.0).1 - expected_m).abs() < 2e-3,
        "{:?}, not {expected_m}",
        at(6.0)
    );
}

#[test]
fn no_body_moves_sideways_faster_than_it_drives_or_turns_on_the_spot() {
    let van = brakecheck_sim::sim::Body::shipped("van");
    let lever_m = van.expect("shipped").expect("a body").lever_m();
    let cases = [
        (
            0.2,
            "(after_s: 1.0, does: [LaneChange(by_m: 3.5, rate_mps: 1.0)])",
        ),
        (
            0.5,
            "(after_s: 1.0, does: [LaneOffset(to_m: 1.0, most_lateral_mps2: 2.0)])",
        ),
        (
            10.0,
            "(after_s: 0.5, does: [Brake(rate_mps2: 6.0), LaneChange(by_m: 3.5, rate_mps: 0.9)])",
        ),
        (
            10.0,
            "(after_s: 0.5, does: [LaneOffset(to_m: 1.0, most_lateral_mps2: 0.3)], overlaps: true),
             (after_s: 0.5, does: [Brake(rate_mps2: 6.0)])",
        ),
        (
            0.0,
            "(does: [Speed(to_mps: 6.0, rate_mps2: 1.0), LaneChange(by_m: 3.5, rate_mps: 3.0, shape: Linear)])",
        ),
    ];
    for ((speed_mps, steps), plant) in cases.iter().flat_map(|it| PLANTS.map(|plant| (it, plant))) {
        let episode = run(&world(*speed_mps, &script(steps)).on(plant), 0);
        let places = rear(&episode);
        let speeds = column(&episode, "van.speed");
        for (pair, speed) in places.windows(2).zip(speeds.windows(2)) {
            // A change of speed may begin anywhere in a sample.
            let way_m = speed[0].max(speed[1]) * SAMPLE_S + 1e-4;
            let aside_m = (pair[1].1 - pair[0].1).abs();
            assert!(aside_m <= way_m, "{steps}: {aside_m} m on {way_m} m");
            let turn_rad = (pair[1].2 - pair[0].2).abs();
            assert!(
                turn_rad <= way_m / lever_m + 1e-4,
                "{steps}: {turn_rad} rad"
            );
        }
    }
}

#[test]
fn a_jump_displaces_a_moving_body_without_turning_it() {
    let drive =
        script("(after_s: 1.0, does: [LaneChange(by_m: 0.3, rate_mps: 5000.0, shape: Linear)])");
    let places = rear(&run(&world(20.0, &drive), 0));
    let at = |sample: usize| places[sample];
    assert!((at(21).1 - at(19).1 - 0.3).abs() < 1e-3);
    assert!((at(40).0 - at(0).0 - 40.0).abs() < 1e-3, "{:?}", at(40));
    assert!(places.iter().all(|place| place.2.abs() < 1e-5));
}

#[test]
fn an_ado_that_stops_its_body_stops_its_plan_across_too() {
    let drive = "Ado(
        base: Script([(after_s: 0.1, does: [LaneChange(by_m: 3.5, rate_mps: 1.0)])]),
        actions: Deviate(accelerations: [-8.0, 0.0], lateral_mps: [0.0]), neutral: 1,
        rulebook: [Rule(name: \"r\", stl: \"always (van.s >= 0)\")])";
    let world = world(4.0, drive);
    let episode = run(&world, 0);
    let (places, speeds) = (rear(&episode), column(&episode, "van.speed"));
    let stands = speeds
        .iter()
        .position(|speed_mps| *speed_mps < 1e-9)
        .expect("it stops");
    for place in &places[stands + 1..] {
        let first = places[stands];
        let off_m = (place.0 - first.0).abs().max((place.1 - first.1).abs());
        assert!(
            off_m < 1e-4 && (place.2 - first.2).abs() < 1e-5,
            "{place:?}"
        );
    }
}
