//! Stories, acts, groups, maneuvers, events and actions.

use crate::toy::{Played, Toy, at, event, events, speed, when};

fn play(text: &str) -> Played {
    Played::play(
        text,
        Toy::new(&[(0.0, 10.0), (50.0, 10.0), (0.0, 0.0)]),
        6.0,
        0.1,
    )
}

fn of_events(all: &[String]) -> Played {
    play(&events(&all.join(", ")))
}

#[test]
fn an_event_runs_as_long_as_its_actions() {
    let played = of_events(&[event("e", &(speed(20.0, 2.0) + &at(1.005)))]);
    played.expect("e", &[("Start", 1.005), ("End", 3.005)]);
    played.expect("e::drive", &[("Start", 1.005), ("End", 3.005)]);
    played.expect("maneuver", &[("Start", 0.0), ("End", 3.005)]);
    played.expect("act", &[("Start", 0.0), ("End", 3.005)]);
    played.expect("story", &[("Start", 0.0), ("End", 3.005)]);
}

#[test]
fn an_event_without_a_trigger_starts_with_its_act() {
    let text = events(&event("e", ""))
        .replace("name: \"act\",", &format!("name: \"act\", {},", at(0.703)));
    play(&text).expect("e", &[("Start", 0.703), ("End", 0.703)]);
}

#[test]
fn override_stops_the_running_events_of_its_maneuver() {
    let played = of_events(&[
        event("first", &(speed(20.0, 3.0) + &at(1.0))),
        event(
            "second",
            &(speed(0.0, 1.0) + "priority: Override," + &at(2.0)),
        ),
    ]);
    played.expect("first", &[("Start", 1.0), ("Stop", 2.0)]);
    played.expect("second", &[("Start", 2.0), ("End", 3.0)]);
}

#[test]
fn an_overridden_event_never_runs_again() {
    let many = "maximum_execution_count: 5,".to_owned();
    let played = of_events(&[
        event("first", &(speed(20.0, 3.0) + &many + &at(1.0))),
        event("second", &(speed(0.0, 1.0) + &at(2.0))),
    ]);
    played.expect("first", &[("Start", 1.0), ("Stop", 2.0)]);
}

#[test]
fn parallel_leaves_the_others_running() {
    let swing = "actions: [(name: \"swing\", does: LaneOffset(target_m: 1.0))],";
    let played = of_events(&[
        event("first", &(speed(20.0, 3.0) + &at(1.0))),
        event(
            "second",
            &(swing.to_owned() + "priority: Parallel," + &at(2.0)),
        ),
    ]);
    played.expect("first", &[("Start", 1.0), ("End", 4.0)]);
    played.expect("second", &[("Start", 2.0), ("End", 4.0)]);
}

#[test]
fn an_action_takes_the_motion_from_a_parallel_one() {
    let played = of_events(&[
        event("first", &(speed(20.0, 3.0) + &at(1.0))),
        event(
            "second",
            &(speed(0.0, 1.0) + "priority: Parallel," + &at(2.0)),
        ),
    ]);
    played.expect("first::drive", &[("Start", 1.0), ("Stop", 2.0)]);
    played.expect("second::drive", &[("Start", 2.0), ("End", 3.0)]);
}

#[test]
fn skip_counts_as_an_execution_and_may_come_later() {
    let skip = "priority: Skip, maximum_execution_count: 2,";
    let again =
        when("edge: Rising, is: StoryboardElementState(element: \"tick\", state: StartTransition)");
    let tick = "priority: Parallel, maximum_execution_count: 3,";
    let ticks = "start_trigger: [[(edge: Rising, is: SimulationTime(rule: GreaterThan, value_s: 2.0))], \
                 [(edge: Rising, is: SimulationTime(rule: GreaterThan, value_s: 4.5))]]";
    let played = of_events(&[
        event("first", &(speed(20.0, 3.0) + &at(1.0))),
        event("second", &(skip.to_owned() + &again)),
        event("tick", &(tick.to_owned() + ticks)),
    ]);
    played.expect("first", &[("Start", 1.0), ("End", 4.0)]);
    played.expect("second", &[("Skip", 2.0), ("Start", 4.5), ("End", 4.5)]);
}

#[test]
fn a_skipped_event_without_executions_left_is_complete() {
    let played = of_events(&[
        event("first", &(speed(20.0, 3.0) + &at(1.0))),
        event("second", &("priority: Skip,".to_owned() + &at(2.0))),
    ]);
    played.expect("second", &[("Skip", 2.0)]);
    played.expect("maneuver", &[("Start", 0.0), ("End", 4.0)]);
}

#[test]
fn an_event_executes_as_often_as_it_may() {
    let count = "maximum_execution_count: 3,";
    let played = of_events(&[event("e", &(speed(20.0, 1.0) + count + &at(0.5)))]);
    played.expect(
        "e",
        &[
            ("Start", 0.5),
            ("End", 1.5),
            ("Start", 1.5),
            ("End", 2.5),
            ("Start", 2.5),
            ("End", 3.5),
        ],
    );
    played.expect("maneuver", &[("Start", 0.0), ("End", 3.5)]);
}

#[test]
fn an_event_without_a_duration_repeats_after_time_has_passed() {
    let count = "maximum_execution_count: 3,";
    let played = of_events(&[event("e", &(count.to_owned() + &at(0.5)))]);
    let starts: Vec<f64> = played.of("e").iter().step_by(2).map(|it| it.1).collect();
    assert_eq!(starts.len(), 3);
    assert!(
        starts.windows(2).all(|it| it[1] > it[0] + 0.005),
        "{starts:?}"
    );
    assert_eq!(played.run.variable(0), 3.0);
}

#[test]
fn conditions_forget_what_was_before_the_event_waits_again() {
    let late = "delay_s: 0.5, is: SimulationTime(rule: GreaterThan, value_s: 1.0)";
    let count = "maximum_execution_count: 2,";
    let played = of_events(&[event("e", &(speed(20.0, 1.0) + count + &when(late)))]);
    let expected = [("Start", 1.5), ("End", 2.5), ("Start", 3.0), ("End", 4.0)];
    played.expect("e", &expected);
}

#[test]
fn a_group_repeats_its_maneuvers() {
    let text = events(&event("e", &speed(20.0, 1.0))).replace(
        "name: \"group\",",
        "name: \"group\", maximum_execution_count: 2,",
    );
    let played = play(&text);
    played.expect(
        "group",
        &[("Start", 0.0), ("End", 1.0), ("Start", 1.0), ("End", 2.0)],
    );
    played.expect(
        "e",
        &[("Start", 0.0), ("End", 1.0), ("Start", 1.0), ("End", 2.0)],
    );
    played.expect("act", &[("Start", 0.0), ("End", 2.0)]);
}

#[test]
fn a_stop_trigger_stops_all_that_an_act_contains() {
    let stop = "stop_trigger: [[(is: SimulationTime(rule: GreaterThan, value_s: 2.345))]],";
    let text = events(
        &[
            event("runs", &(speed(20.0, 3.0) + &at(1.0))),
            event("waits", &at(5.0)),
        ]
        .join(", "),
    )
    .replace("name: \"act\",", &format!("name: \"act\", {stop}"));
    let played = play(&text);
    for name in ["act", "group", "maneuver"] {
        played.expect(name, &[("Start", 0.0), ("Stop", 2.345)]);
    }
    played.expect("runs", &[("Start", 1.0), ("Stop", 2.345)]);
    played.expect("runs::drive", &[("Start", 1.0), ("Stop", 2.345)]);
    played.expect("waits", &[("Stop", 2.345)]);
    // The speed stays as it was at the stop.
    assert!((played.toy.legs[0].speed_mps - (10.0 + 10.0 * 1.345 / 3.0)).abs() < 1e-5);
}

#[test]
fn an_act_that_waits_can_be_stopped() {
    let stop = "stop_trigger: [[(is: SimulationTime(rule: GreaterThan, value_s: 1.0))]],";
    let text = events(&event("e", "")).replace(
        "name: \"act\",",
        &format!("name: \"act\", {stop} {},", at(2.0)),
    );
    let played = play(&text);
    played.expect("act", &[("Stop", 1.0)]);
    played.expect("e", &[]);
}

#[test]
fn the_storyboard_stops_with_its_trigger() {
    let stop = "stop_trigger: [[(is: SimulationTime(rule: GreaterThan, value_s: 2.0))]], stories:";
    let text = events(&event("e", &(speed(20.0, 3.0) + &at(1.0)))).replace("stories:", stop);
    let played = play(&text);
    played.expect("story", &[("Start", 0.0), ("Stop", 2.0)]);
    played.expect("e", &[("Start", 1.0), ("Stop", 2.0)]);
}

#[test]
fn events_of_one_instant_trigger_each_other_in_any_file_order() {
    let of = |element: &str, state: &str| {
        when(&format!(
            "is: StoryboardElementState(element: \"{element}\", state: {state})"
        ))
    };
    let parallel = "priority: Parallel,".to_owned();
    let all = [
        event("one", &(parallel.clone() + &at(1.234))),
        event("two", &(parallel.clone() + &of("one", "EndTransition"))),
        event("three", &(parallel.clone() + &of("two", "CompleteState"))),
        event("four", &(parallel + &of("three::add", "StartTransition"))),
    ];
    for order in [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]] {
        let played = of_events(&order.map(|it| all[it].clone()));
        for name in ["one", "two", "three", "four"] {
            played.expect(name, &[("Start", 1.234), ("End", 1.234)]);
        }
        assert_eq!(played.run.variable(0), 4.0);
    }
}
