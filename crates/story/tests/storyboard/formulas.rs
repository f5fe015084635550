//! Conditions by formulas: their instants, edges and delays, and how far they look back.

use crate::toy::{Played, Toy, at, event, events, speed, when};

fn play(text: &str, sample_s: f64) -> Played {
    Played::play(text, Toy::new(&[(0.0, 10.0)]), 4.0, sample_s)
}

#[test]
fn a_formula_triggers_at_the_zero_of_its_robustness() {
    let cases = [
        ("is: Formula(\"x >= 1\")", 1.23),
        ("edge: Rising, is: Formula(\"x >= 1\")", 1.23),
        ("edge: Falling, is: Formula(\"x >= 1\")", 2.23),
        ("edge: RisingOrFalling, is: Formula(\"x >= 1\")", 1.23),
        ("delay_s: 0.5, is: Formula(\"x >= 1\")", 1.73),
        (
            "edge: Falling, delay_s: 0.41, is: Formula(\"x >= 1\")",
            2.64,
        ),
    ];
    for (condition, expected_s) in cases {
        let text = events(&event("e", &when(condition)));
        for sample_s in [0.1, 0.05, 0.04, 0.02] {
            let found = play(&text, sample_s).of("e");
            let start_s = found.first().map(|it| it.1);
            // The zero is no search: its instant has the error of a rounding.
            let late_s = start_s.map(|it| (it - expected_s).abs());
            assert!(
                late_s.is_some_and(|it| it < 1e-12),
                "{condition}, {sample_s} s: {found:?}, expected {expected_s}"
            );
        }
    }
}

#[test]
fn a_formula_looks_back_to_the_instant_from_which_its_element_waits() {
    let first = event("first", &(speed(12.0, 1.0) + &at(0.512)));
    let ends = "is: StoryboardElementState(element: \"first\", state: CompleteState)";
    let second = event(
        "second",
        &format!("start_trigger: [[({ends}), (is: Formula(\"x >= 1\"))]]"),
    );
    let played = play(&events(&[first, second].join(", ")), 0.1);
    assert_eq!(played.toy.watched_s, [0.0]);
    played.expect("second", &[("Start", 1.512), ("End", 1.512)]);
    let many = "maximum_execution_count: 2,".to_owned();
    let again = event("again", &(many + &when("is: Formula(\"x >= 1\")")));
    let played = play(&events(&again), 0.1);
    // It is watched anew after each execution, at an instant within a sample.
    let [from_s, again_s, ..] = played.toy.watched_s[..] else {
        panic!("{:?}", played.toy.watched_s);
    };
    assert!(from_s == 0.0 && (again_s - 1.23).abs() < 1e-12, "{again_s}");
}

#[test]
fn a_formula_joins_other_conditions() {
    let text = events(&event(
        "e",
        "start_trigger: [[(is: Formula(\"x >= 1\")), \
         (is: SimulationTime(rule: GreaterThan, value_s: 1.9))]]",
    ));
    play(&text, 0.1).expect("e", &[("Start", 1.9), ("End", 1.9)]);
}
