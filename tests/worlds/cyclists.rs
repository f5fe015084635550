//! Bicyclists in worlds: as road users they drive like vehicles, and never as an ego.

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, play};
use brakecheck::world::Scenario;

const CYCLIST: &str = include_str!("../../worlds/cyclist.ron");

fn with(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1)
}

fn refusal(from: &str, to: &str) -> String {
    let text = with(CYCLIST, from, to);
    let error = Scenario::parse("cyclist.ron", &text).expect_err("refused");
    let all = error.problems.iter().map(|it| it.what.clone());
    all.collect::<Vec<String>>().join("\n")
}

#[test]
fn a_bicyclist_is_no_ego() {
    let what = refusal(
        r#"name: "ego", body: "sedan""#,
        r#"name: "ego", body: "bicyclist""#,
    );
    assert!(what.contains("`bicyclist` is a cyclist"), "{what}");
    let changed = r#"reuse: { "bike": Change(ego_body: "bicyclist"),"#;
    let what = refusal("reuse: {", changed);
    assert!(what.contains("`bicyclist` is no vehicle"), "{what}");
}

#[test]
fn a_bicyclist_starts_no_faster_than_it_rides() {
    let what = refusal("speed_mps: (3.0, 6.0)", "speed_mps: (3.0, 12.0)");
    assert!(what.contains("12 is outside of 0 ..= 10"), "{what}");
    let what = refusal("speed_mps: (3.0, 6.0)", "speed_mps: (-1.0, 6.0)");
    assert!(what.contains("-1 is outside of 0 ..= 10"), "{what}");
}

/// A bicyclist who leans first follows lateral moves as a car does, a little later.
#[test]
fn a_bicyclist_moves_over_at_the_lateral_speed_of_its_action() {
    let alone = with(
        CYCLIST,
        "s_m: (55.0, 75.0), lateral_m: -0.9",
        "s_m: 500.0, lateral_m: -0.9",
    );
    let alone = with(&alone, "headway_m: (15.0, 50.0)", "headway_m: 50.0");
    let alone = with(&alone, "offset_m: (-0.6, 0.0)", "offset_m: 0.0");
    let world = Scenario::parse("cyclist.ron", &alone).unwrap_or_else(|error| panic!("{error}"));
    let mut bench = world.bench();
    let start = bench.draw(StartKey {
        purpose: Purpose::Train,
        seed: 3,
        index: 0,
    });
    // Action 4: keeps its speed and moves left with 1 m/s.
    let episode = play(&mut bench, &start, 0, &mut Constant(4), Aftermath::Play);
    let signal = episode.trace.signal("rider.lateral").expect("recorded");
    let at = |row: usize| *signal.get(row).expect("a row so late");
    let speed_mps = (at(40) - at(20)) / 1.0;
    assert!((speed_mps - 1.0).abs() < 0.15, "{speed_mps}");
    assert!(at(4) < 0.1, "{}", at(4));
}
