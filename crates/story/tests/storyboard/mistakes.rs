//! Mistakes are found before a run.

use crate::toy::{at, checked, checked_after, event, events, speed, when};

#[track_caller]
fn wrong(text: &str, expected: &str) {
    let found = checked(text).err().unwrap_or_default();
    assert!(
        found.iter().any(|it| it.contains(expected)),
        "{found:?}: {text}"
    );
}

#[test]
fn every_mistake_is_reported() {
    let of = |more: &str| events(&event("e", more));
    wrong(
        &of(&when("is: SimulationTime(rule: GreaterThan, value_s: 1e9)")),
        "out of bounds",
    );
    wrong(
        &of(&when(
            "delay_s: -1, is: SimulationTime(rule: GreaterThan, value_s: 1)",
        )),
        "out of bounds",
    );
    wrong(
        &of(&when("is: Variable(name: \"m\", rule: LessThan, value: 0)")),
        "no variable `m`",
    );
    wrong(
        &of(&when("is: TrafficSignal(name: \"x\", state: Red)")),
        "no light `x`",
    );
    wrong(
        &of(&when(
            "is: StoryboardElementState(element: \"x\", state: RunningState)",
        )),
        "no element `x`",
    );
    wrong(
        &of(&when(
            "is: ByEntity(entities: [], condition: Speed(rule: LessThan, value_mps: 1))",
        )),
        "no agent",
    );
    wrong(
        &of(&when(
            "is: ByEntity(entities: [\"z\"], condition: Speed(rule: LessThan, value_mps: 1))",
        )),
        "no agent `z`",
    );
    wrong(&of("start_trigger: [[]]"), "no condition");
    wrong(&of("maximum_execution_count: 0"), "0 executions");
    wrong(&of("maximum_execution_count: 2"), "without a trigger");
    wrong(&of("maximum_execution_count: 99999"), "99999 executions");
    wrong(&of("actions: []"), "no action");
    wrong(&of(&speed(-1.0, 1.0)), "out of bounds");
    wrong(&of(&speed(1.0, 1e9)), "out of bounds");
    wrong(&format!("{} x", of("")), "");
    wrong(
        &events(&format!("{}, {}", event("e", ""), event("e", ""))),
        "a second `e`",
    );
    wrong(&events(&event("a::b", "")), "cannot be a name");
    wrong(
        &of(&speed(1.0, 1.0)).replace("actors: [\"a\"]", "actors: [\"c\"]"),
        "cannot act",
    );
    wrong(
        &of(&speed(1.0, 1.0)).replace("actors: [\"a\"],", ""),
        "no actor",
    );
    let other =
        "(name: \"other\", does: Speed(target: Absolute(value_mps: 2), dynamics: (shape: Step)))";
    let two = speed(1.0, 1.0).replace("))))],", &format!(")))), {other}],"));
    wrong(&of(&two), "the same motion");
    wrong(
        &of(
            "actions: [(name: \"x\", does: LaneOffset(target_m: 1, shape: Linear, max_lateral_acc_mps2: 1))]",
        ),
        "no lateral acceleration",
    );
    let change = "actions: [(name: \"x\", does: LaneChange(target: Absolute(lane: 2), dynamics: (shape: Step)))]";
    wrong(&of(change), "has no lane 2");
    wrong(
        &of(change).replace("actors: [\"a\"]", "actors: [\"b\"]"),
        "walks",
    );
    let does = |does: &str| of(&format!("actions: [(name: \"x\", does: {does})]"));
    wrong(&does("LaneOffset()"), "one target");
    let at_once = "Speed(target: Absolute(value_mps: 1), dynamics: (shape: Linear))";
    wrong(&does(at_once), "a change without a size");
    wrong(&does("SpeedProfile(points: [])"), "no speed");
    wrong(
        &does("SpeedProfile(points: [(speed_mps: -1)])"),
        "out of bounds",
    );
    wrong(
        &does("LongitudinalDistance(entity: \"z\", distance: Metres(1), freespace: true)"),
        "no agent `z`",
    );
    wrong(
        &does(
            "LongitudinalDistance(entity: \"b\", distance: Metres(1), freespace: true, limits: (max_accel_mps2: 0))",
        ),
        "out of bounds",
    );
    wrong(
        &does(
            "Synchronize(master: \"b\", master_position: Road(road: \"no\", s_m: 1, t_m: 0), target_position: Road(s_m: 1, t_m: 0))",
        ),
        "no road `no`",
    );
    let twice = "performance: [(entity: \"a\", limits: ()), (entity: \"a\", limits: ())], stories:";
    wrong(
        &of(&at(1.0)).replace("stories:", twice),
        "second performance",
    );
    assert!(checked(&of(&at(1.0))).is_ok());
}

#[test]
fn a_mistake_beyond_the_last_that_is_reported_counts() {
    let of = |more: &str| events(&event("e", more));
    for mistakes in [0, 99, 100, 1000] {
        assert!(checked_after(mistakes, &of(&at(1.0))).is_ok(), "{mistakes}");
        let wrong = of("maximum_execution_count: 0");
        assert!(checked_after(mistakes, &wrong).is_err(), "{mistakes}");
    }
}

#[test]
fn an_ambiguous_name_asks_for_more_of_its_path() {
    let trigger = when("is: StoryboardElementState(element: \"add\", state: RunningState)");
    let text = events(&format!("{}, {}", event("e", ""), event("f", &trigger)));
    wrong(&text, "2 elements are named `add`");
    assert!(checked(&text.replace("element: \"add\"", "element: \"e::add\"")).is_ok());
}
