//! Triggers, edges, delays and the quantities of conditions.

use crate::toy::{Played, Toy, event, events, speed, when};

/// `a` closes in on `b` at 10 m/s from 50 m, `c` stands, and `d` drives 40 m beside `b`.
fn toy() -> Toy {
    let mut toy = Toy::new(&[(0.0, 20.0), (50.0, 10.0), (30.0, 0.0), (50.0, 10.0)]);
    toy.legs[3].y_m = 40.0;
    toy
}

fn start_of(trigger: &str) -> Vec<(String, f64)> {
    Played::play(&events(&event("e", trigger)), toy(), 6.0, 0.1).of("e")
}

#[track_caller]
fn starts(trigger: &str, at_s: f64) {
    let found = start_of(trigger);
    let first = found.first().unwrap_or_else(|| panic!("never: {trigger}"));
    assert!(
        (first.1 - at_s).abs() < 1e-5,
        "{found:?}, expected {at_s}: {trigger}"
    );
}

#[track_caller]
fn never(trigger: &str) {
    assert_eq!(start_of(trigger), [], "{trigger}");
}

fn time(edge: &str, rule: &str, value_s: f64, delay_s: f64) -> String {
    format!(
        "(edge: {edge}, delay_s: {delay_s:?}, is: SimulationTime(rule: {rule}, value_s: {value_s:?}))"
    )
}

fn of(agent: &str, condition: &str) -> String {
    when(&format!(
        "is: ByEntity(entities: [\"{agent}\"], condition: {condition})"
    ))
}

#[test]
fn groups_are_alternatives_and_their_conditions_are_joined() {
    let (late, early) = (
        time("None", "GreaterThan", 3.0, 0.0),
        time("None", "GreaterThan", 1.0, 0.0),
    );
    starts(&format!("start_trigger: [[{late}, {early}]]"), 3.0);
    starts(&format!("start_trigger: [[{late}], [{early}]]"), 1.0);
    let before = time("None", "LessThan", 2.0, 0.0);
    never(&format!("start_trigger: [[{late}, {before}]]"));
}

#[test]
fn an_edge_is_an_instant_and_needs_a_check_before_it() {
    // True from the first check on: no edge, but a level.
    starts(
        &format!("start_trigger: [[{}]]", time("None", "LessThan", 2.0, 0.0)),
        0.0,
    );
    never(&format!(
        "start_trigger: [[{}]]",
        time("Rising", "LessThan", 2.0, 0.0)
    ));
    starts(
        &format!(
            "start_trigger: [[{}]]",
            time("Falling", "LessThan", 2.0, 0.0)
        ),
        2.0,
    );
    starts(
        &format!(
            "start_trigger: [[{}]]",
            time("RisingOrFalling", "LessThan", 2.0, 0.0)
        ),
        2.0,
    );
    starts(
        &format!(
            "start_trigger: [[{}]]",
            time("Rising", "GreaterThan", 0.0, 0.0)
        ),
        0.0,
    );
    // The edge of 1 s is past when the other condition becomes true.
    let edge = time("Rising", "GreaterThan", 1.0, 0.0);
    never(&format!(
        "start_trigger: [[{edge}, {}]]",
        time("None", "GreaterThan", 1.5, 0.0)
    ));
    starts(
        &format!(
            "start_trigger: [[{edge}, {}]]",
            time("None", "LessThan", 1.5, 0.0)
        ),
        1.0,
    );
}

#[test]
fn a_delay_shows_the_condition_of_the_past() {
    starts(
        &format!(
            "start_trigger: [[{}]]",
            time("Rising", "GreaterThan", 1.0, 0.255)
        ),
        1.255,
    );
    starts(
        &format!(
            "start_trigger: [[{}]]",
            time("None", "GreaterThan", 1.0, 0.255)
        ),
        1.255,
    );
    // Before the delay has passed there is no past, so the condition is false.
    starts(
        &format!("start_trigger: [[{}]]", time("None", "LessThan", 2.0, 0.5)),
        0.5,
    );
    // It is true from 0.5 s to 2.5 s, also after the expression is false.
    let past = time("None", "LessThan", 2.0, 0.5);
    starts(
        &format!(
            "start_trigger: [[{past}, {}]]",
            time("None", "GreaterThan", 2.25, 0.0)
        ),
        2.25,
    );
    never(&format!(
        "start_trigger: [[{past}, {}]]",
        time("None", "GreaterThan", 2.75, 0.0)
    ));
}

#[test]
fn a_state_condition_may_be_delayed() {
    let first = event("first", &(speed(30.0, 1.0) + &crate::toy::at(1.0)));
    let second = |state: &str| {
        let condition =
            format!("delay_s: 0.7, is: StoryboardElementState(element: \"first\", state: {state})");
        event("second", &when(&condition))
    };
    let mut expected = Vec::new();
    for (state, at_s) in [
        ("RunningState", 1.7),
        ("EndTransition", 2.7),
        ("CompleteState", 2.7),
    ] {
        let text = events(&format!("{first}, {}", second(state)));
        let played = Played::play(&text, toy(), 6.0, 0.1);
        expected.push((played.of("second")[0].1, at_s));
    }
    assert!(
        expected.iter().all(|it| (it.0 - it.1).abs() < 1e-6),
        "{expected:?}"
    );
}

#[test]
fn values_are_compared() {
    starts(
        &when("is: Parameter(name: \"gap\", rule: EqualTo, value: 7)"),
        0.0,
    );
    never(&when(
        "is: Parameter(name: \"gap\", rule: NotEqualTo, value: 7)",
    ));
    starts(&when("is: TrafficSignal(name: \"light\", state: Red)"), 1.5);
    never(&when(
        "is: Variable(name: \"n\", rule: GreaterThan, value: 0)",
    ));
    starts(
        &when("is: SimulationTime(rule: EqualTo, value_s: 1.2345)"),
        1.2345,
    );
}

#[test]
fn distances_are_between_reference_points_or_boxes() {
    // The reference points are 3 m behind the fronts, and the boxes 4 m long.
    let distance = |freespace: bool, rule: &str, value_m: f64| {
        of(
            "a",
            &format!(
                "RelativeDistance(entity: \"b\", freespace: {freespace}, rule: {rule}, value_m: {value_m:?})"
            ),
        )
    };
    starts(&distance(false, "LessThan", 20.0), 3.0);
    starts(&distance(true, "LessThan", 20.0), 2.6);
    starts(
        &distance(true, "LessThan", 20.0)
            .replace("freespace", "distance_type: Longitudinal, freespace"),
        2.6,
    );
    starts(
        &distance(false, "LessThan", 20.0).replace(
            "freespace",
            "distance_type: Longitudinal, coordinate_system: Entity, freespace",
        ),
        3.0,
    );
    never(
        &distance(true, "GreaterThan", 0.0)
            .replace("freespace", "distance_type: Lateral, freespace"),
    );
    starts(&distance(false, "EqualTo", 20.0), 3.0);
}

#[test]
fn times_are_defined_while_they_have_a_meaning() {
    let time = |kind: &str, agent: &str, other: &str, freespace: bool, rule: &str, value_s: f64| {
        of(
            agent,
            &format!(
                "{kind}(entity: \"{other}\", freespace: {freespace}, rule: {rule}, value_s: {value_s:?})"
            ),
        )
    };
    // 50 m and 46 m, closing at 10 m/s, own speed 20 m/s.
    starts(&time("TimeHeadway", "a", "b", false, "LessThan", 1.0), 3.0);
    starts(&time("TimeHeadway", "a", "b", true, "LessThan", 1.0), 2.6);
    starts(
        &time("TimeToCollision", "a", "b", true, "LessThan", 2.0),
        2.6,
    );
    starts(
        &time("TimeToCollision", "b", "a", true, "LessThan", 2.0),
        2.6,
    );
    // The straight line to `d` has 50 m when 30 m are left along the axis.
    let beside = |kind: &str, along: &str, value_s: f64| {
        time(kind, "a", "d", false, "LessThan", value_s)
            .replace("freespace", &format!("distance_type: {along}, freespace"))
    };
    starts(&beside("TimeHeadway", "Longitudinal", 2.0), 1.0);
    starts(&beside("TimeHeadway", "Euclidean", 2.5), 2.0);
    starts(&beside("TimeToCollision", "Euclidean", 5.0), 2.0);
    let to_place = |x_m: f64, freespace: bool| {
        let place = format!("position: World(x_m: {x_m:?}, y_m: 0.0), freespace: {freespace}");
        of(
            "a",
            &format!("TimeToPlace({place}, rule: LessThan, value_s: 3.0)"),
        )
    };
    // The reference point of `a` has 100 m to the place, and its front 97 m.
    starts(&to_place(97.0, false), 2.0);
    starts(&to_place(97.0, true), 1.85);
    never(&to_place(-50.0, false));
    // Behind, at rest or moving away: unknown fulfils neither comparison.
    for rule in ["LessThan", "GreaterThan", "NotEqualTo"] {
        never(&time("TimeHeadway", "c", "b", false, rule, 1.0));
        never(&time("TimeToCollision", "b", "c", false, rule, 1.0));
    }
}

#[test]
fn motion_is_compared() {
    let braking = |condition: &str, agent: &str| {
        let text = events(&event("e", &of(agent, condition)));
        let toy = toy().with_accel(0, -4.0);
        let played = Played::play(&text, toy, 4.0, 0.1);
        played.of("e").first().map(|it| it.1)
    };
    let is = |condition: &str, expected_s: f64| {
        let found = braking(condition, "a").unwrap_or(f64::NAN);
        assert!((found - expected_s).abs() < 1e-5, "{condition}: {found}");
    };
    is("Speed(rule: LessThan, value_mps: 13.0)", 1.75);
    is(
        "RelativeSpeed(entity: \"b\", rule: LessThan, value_mps: 0.0)",
        2.5,
    );
    is("Acceleration(rule: LessThan, value_mps2: -3.9)", 0.0);
    is("TraveledDistance(value_m: 32.0)", 2.0);
    is(
        "ReachPosition(position: World(x_m: 31.0, y_m: 0.0), tolerance_m: 2.0)",
        2.0,
    );
    is(
        "Distance(position: Road(s_m: 31.0, t_m: 0.0), rule: LessThan, value_m: 2.0)",
        2.0,
    );
    // The front drives 29 m: 20 t − 2 t².
    for along in ["Euclidean", "Longitudinal"] {
        let place = "position: Road(s_m: 31.0, t_m: 0.0), freespace: true";
        is(
            &format!("Distance({place}, distance_type: {along}, rule: LessThan, value_m: 2.0)"),
            1.759630,
        );
    }
    assert_eq!(braking("StandStill(duration_s: 2.5)", "c"), Some(2.5));
    assert_eq!(braking("StandStill(duration_s: 2.5)", "b"), None);
    assert_eq!(braking("Offroad(duration_s: 0.0)", "a"), None);
    assert_eq!(braking("EndOfRoad(duration_s: 0.0)", "a"), None);
}

#[test]
fn any_or_all_of_several_agents() {
    let of_all = |rule: &str| {
        when(&format!(
            "is: ByEntity(entities: [\"a\", \"b\"], rule: {rule}, condition: TraveledDistance(value_m: 20.0))"
        ))
    };
    starts(&of_all("Any"), 1.0);
    starts(&of_all("All"), 2.0);
}

#[test]
fn a_contact_is_a_condition() {
    starts(&of("a", "Collision(entity: \"b\")"), 4.6);
}

#[test]
fn an_edge_is_none_between_the_changes_of_one_instant() {
    // Both begin to wait at 1 s, when `first` starts: nothing was checked before.
    let begun = "edge: Rising, is: StoryboardElementState(element: \"first\", state: RunningState)";
    let acts = format!(
        r#"(variables: [(name: "n", value: 0)], stories: [(name: "story", acts: [(name: "act",
        start_trigger: [[(is: SimulationTime(rule: GreaterOrEqual, value_s: 1.0))]],
        maneuver_groups: [(name: "group", actors: ["a"], maneuvers: [
        (name: "one", events: [{}]), (name: "two", events: [{}])])])])])"#,
        event("waits", &when(begun)),
        event(
            "first",
            &(speed(20.0, 2.0) + &when("is: SimulationTime(rule: GreaterThan, value_s: 0.5)"))
        ),
    );
    let played = Played::play(&acts, toy(), 6.0, 0.1);
    played.expect("first", &[("Start", 1.0), ("End", 3.0)]);
    assert_eq!(played.of("waits"), []);
    // The end of a state that lasted is an edge.
    let ended =
        "edge: Falling, is: StoryboardElementState(element: \"first\", state: RunningState)";
    let played = Played::play(&acts.replace(begun, ended), toy(), 6.0, 0.1);
    played.expect("waits", &[("Start", 3.0), ("End", 3.0)]);
}
