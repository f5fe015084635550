//! Actors that a trigger chooses, relative places and numbers that are parameters.

use crate::toy::{Played, Toy, checked, event, events, speed, when};

/// Act that starts when `condition` holds, whose actors are those that trigger it.
fn triggered(actors: &str, condition: &str) -> String {
    let start = when(condition);
    events(&event("e", &speed(20.0, 1.0)))
        .replace("name: \"act\",", &format!("name: \"act\", {start},"))
        .replace(
            "actors: [\"a\"]",
            &format!("actors: [{actors}], actors_are_triggering: true"),
        )
}

fn toy() -> Toy {
    Toy::new(&[(0.0, 10.0), (50.0, 12.0), (0.0, 0.0), (0.0, 0.0)])
}

const BOTH: &str = "is: ByEntity(entities: [\"a\", \"b\"], rule: Any, condition: \
                    TraveledDistance(value_m: 24.0))";

#[test]
fn agents_that_trigger_an_act_are_its_actors() {
    let played = Played::play(&triggered("", BOTH), toy(), 6.0, 0.1);
    played.expect("e", &[("Start", 2.0), ("End", 3.0)]);
    // The other one had driven 20 m only.
    assert_eq!(played.toy.legs[1].speed_mps, 12.0 + 0.0);
    assert!((played.toy.legs[1].accel_mps2 - 8.0).abs() < 1e-6);
    assert_eq!(played.toy.legs[0].accel_mps2, 0.0);
}

#[test]
fn named_actors_act_beside_those_that_trigger() {
    let played = Played::play(&triggered("\"a\"", BOTH), toy(), 6.0, 0.1);
    for (agent, accel_mps2) in [(0, 10.0), (1, 8.0)] {
        assert!((played.toy.legs[agent].accel_mps2 - accel_mps2).abs() < 1e-6);
    }
    let both = BOTH.replace("rule: Any", "rule: All");
    let played = Played::play(&triggered("", &both), toy(), 6.0, 0.1);
    played.expect("e", &[("Start", 2.4), ("End", 3.4)]);
    assert!((played.toy.legs[0].accel_mps2 - 10.0).abs() < 1e-6);
}

#[test]
fn edges_and_delays_choose_the_actors_that_cause_them() {
    // Each case: the condition, its instant and the accelerations of both.
    let travels = "condition: TraveledDistance(value_m: 24.0))";
    // The first is near from 2 s to 4 s, and the second never.
    let near = "condition: Distance(position: World(x_m: 27.0, y_m: 0.0), rule: LessThan, \
                value_m: 10.0))";
    for (edge, rule, condition, at_s, accels_mps2) in [
        ("edge: Falling", "Any", near, 4.0, [10.0, 0.0]),
        ("edge: RisingOrFalling", "Any", near, 2.0, [10.0, 0.0]),
        ("edge: Rising", "All", travels, 2.4, [10.0, 8.0]),
        // The first has driven as far when the delay of the second has passed.
        ("delay_s: 1.0", "Any", travels, 3.0, [0.0, 8.0]),
        (
            "edge: Rising, delay_s: 1.0",
            "Any",
            travels,
            3.0,
            [0.0, 8.0],
        ),
    ] {
        let entities = "entities: [\"a\", \"b\"]";
        let condition = format!("{edge}, is: ByEntity({entities}, rule: {rule}, {condition}");
        let played = Played::play(&triggered("", &condition), toy(), 6.0, 0.1);
        played.expect("e", &[("Start", at_s), ("End", at_s + 1.0)]);
        for (leg, accel_mps2) in played.toy.legs.iter().zip(accels_mps2) {
            let off_mps2 = (leg.accel_mps2 - accel_mps2).abs();
            assert!(off_mps2 < 1e-6, "{condition}: {leg:?}");
        }
    }
}

#[test]
fn triggering_actors_must_exist_and_may_act() {
    let time = "is: SimulationTime(rule: GreaterThan, value_s: 1.0)";
    let found = checked(&triggered("", time)).err().unwrap_or_default();
    assert!(
        found.iter().any(|it| it.contains("no agent triggers")),
        "{found:?}"
    );
    let passive = BOTH.replace("\"b\"", "\"c\"");
    let found = checked(&triggered("", &passive)).err().unwrap_or_default();
    assert!(
        found.iter().any(|it| it.contains("`c` cannot act")),
        "{found:?}"
    );
}

#[test]
fn numbers_may_be_parameters() {
    // The parameter `gap` is 7.
    let text = events(&event(
        "e",
        &speed(20.0, 1.0).replace("Time(1.0)", "Time(\"gap\")"),
    ));
    let played = Played::play(&text, toy(), 8.0, 0.1);
    played.expect("e", &[("Start", 0.0), ("End", 7.0)]);
    let late = event(
        "e",
        &when("delay_s: \"gap\", is: SimulationTime(rule: GreaterThan, value_s: 0.5)"),
    );
    Played::play(&events(&late), toy(), 8.0, 0.1).expect("e", &[("Start", 7.5), ("End", 7.5)]);
    let board = std::sync::Arc::new(checked(&text).unwrap_or_else(|it| panic!("{it:?}")));
    assert!(board.has_parameters());
    assert!(board.at_values(&[3.0]).is_ok());
    let wrong = board.at_values(&[-3.0]).err().unwrap_or_default();
    assert!(
        wrong.contains("-3, a value of `gap`, is out of bounds"),
        "{wrong}"
    );
    let found = checked(&text.replace("\"gap\"", "\"gab\""))
        .err()
        .unwrap_or_default();
    assert!(
        found.iter().any(|it| it.contains("no parameter `gab`")),
        "{found:?}"
    );
}

#[test]
fn places_may_be_relative_to_agents() {
    // Reference points are 3 m behind the front. Agent `b` keeps 12 m/s from 47 m on.
    for (place, at_s) in [
        ("World(x_m: 27.0, y_m: 0.0)", 2.0),
        ("Road(s_m: 27.0, t_m: 0.0)", 2.0),
        ("RelativeObject(entity: \"b\", dx_m: -54.0, dy_m: 0.0)", 2.0),
        ("RelativeWorld(entity: \"b\", dx_m: -54.0, dy_m: 0.0)", 2.0),
        ("RelativeRoad(entity: \"b\", ds_m: -54.0, dt_m: 0.0)", 2.0),
        ("RelativeLane(entity: \"b\", lanes: 0, ds_m: -54.0)", 2.0),
    ] {
        let condition = format!(
            "is: ByEntity(entities: [\"a\"], condition: Distance(position: {place}, \
             rule: LessThan, value_m: 10.0))"
        );
        let text = events(&event("e", &when(&condition)));
        let played = Played::play(&text, toy(), 6.0, 0.1);
        // Fixed places are near once `a` has come to 17 m, moving ones once they have
        // come to `a`: x of the place is −7 m + 12 m/s and that of `a` −3 m + 10 m/s.
        let expected_s = if place.starts_with('W') || place.starts_with("Road") {
            at_s
        } else {
            0.0
        };
        played.expect("e", &[("Start", expected_s), ("End", expected_s)]);
    }
}
