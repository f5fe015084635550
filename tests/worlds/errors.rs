//! Mistakes in a world file read like a compiler's messages.

use brakecheck::cli::{Failure, plain_theme};
use brakecheck::world::Scenario;
use proptest::prelude::*;

const ACC: &str = include_str!("../../worlds/acc.ron");

/// A mistake: what it is, and the text of `acc.ron` with it.
fn mistakes() -> Vec<(&'static str, String)> {
    let with = |from: &str, to: &str| {
        assert!(ACC.contains(from), "acc.ron no longer contains {from}");
        ACC.replacen(from, to, 1)
    };
    vec![
        (
            "a contact that ends no episode",
            with(
                "plant: Rigid,",
                "plant: Rigid, counts: Contact(closing_mps: 3.0),",
            ),
        ),
        (
            "a reward without a step",
            with(
                "judge: UntilViolation,",
                "judge: UntilContact, counts: Contact(closing_mps: 3.0),",
            )
            .replace("jump: 0.5", "jump: 0.0"),
        ),
        (
            "nobody who would have avoided it",
            with(
                "judge: UntilViolation,",
                "judge: UntilContact, counts: Preventable(by: []),",
            ),
        ),
        (
            "a driver that is none",
            with(
                "judge: UntilViolation,",
                "judge: UntilContact, counts: Preventable(by: [Rss]),",
            ),
        ),
        (
            "a contact at a speed below none",
            with(
                "judge: UntilViolation,",
                "judge: UntilContact, counts: Contact(closing_mps: -1.0),",
            ),
        ),
        ("a missing comma", with("plant: Rigid,", "plant: Rigid")),
        ("an unknown field", with("horizon_s:", "horizont_s:")),
        ("an unknown variant", with("plant: Rigid", "plant: Rigit")),
        ("a missing field", with("decision_s: 0.5, ", "")),
        (
            "a field given twice",
            with("plant: Rigid,", "plant: Rigid, plant: Rigid,"),
        ),
        (
            "a constant given twice",
            with("\"v_min\": 0.1,", "\"v_min\": 0.1, \"v_min\": 0.2,"),
        ),
        (
            "a number that is none",
            with("friction: 0.9", "friction: NaN"),
        ),
        ("an infinite number", with("(8.0, 60.0)", "(8.0, 1e999)")),
        ("a reversed range", with("(8.0, 60.0)", "(60.0, 8.0)")),
        ("a range of three", with("(8.0, 60.0)", "(8.0, 60.0, 70.0)")),
        ("overlapping starts", with("(8.0, 60.0)", "(4.0, 60.0)")),
        (
            "an unknown signal in a formula",
            with("ado.speed >= v_min", "ado.sped >= v_min"),
        ),
        (
            "an unknown constant in a formula",
            with("ado.speed <= v_lim", "ado.speed <= v_limit"),
        ),
        (
            "a syntax error in a formula",
            with("(headway >= d_safe)", "(headway >= )"),
        ),
        (
            "a bound that is no multiple",
            with("always[0, T] (headway", "always[0, 0.12] (headway"),
        ),
        (
            "an unknown signal in an expression",
            with("\"ado.x - ego.x\"", "\"ado.x - ergo.x\""),
        ),
        (
            "an unknown observed signal",
            with("\"time_left\"]", "\"timeleft\"]"),
        ),
        (
            "an unknown body",
            with("body: \"sedan\"", "body: \"seden\""),
        ),
        ("an unknown agent", with("of: \"ego\"", "of: \"egon\"")),
        ("no ego", with("drive: Ego(Acc(", "drive: Egg(Acc(")),
        (
            "an unknown ego parameter",
            with("kp_per_s2: 0.3", "kp: 0.3"),
        ),
        (
            "an unknown parameter in reuse",
            with("(max_brake_mps2: 4.0)", "(max_brake: 4.0)"),
        ),
        (
            "a lane that is not there",
            with(
                "name: \"ado\", body: \"sedan\", lane: 0",
                "name: \"ado\", body: \"sedan\", lane: 1",
            ),
        ),
        (
            "a decision that is no multiple",
            with("decision_s: 0.5", "decision_s: 0.52"),
        ),
        (
            "a horizon beyond the limit",
            with("horizon_s: 15.0", "horizon_s: 1.0e9"),
        ),
        ("too coarse physics", with("substeps: 4", "substeps: 1")),
        (
            "a neutral action that is not there",
            with("neutral: 1", "neutral: 3"),
        ),
        (
            "a rule broken at the start",
            with("\"v_min\": 0.1", "\"v_min\": 5.0"),
        ),
        (
            "a spec violated at the start",
            with("\"d_safe\": 4.7", "\"d_safe\": 9.0"),
        ),
        (
            "a reserved constant",
            with("\"v_min\": 0.1", "\"T\": 3.0, \"v_min\": 0.1"),
        ),
        (
            "a signal that is published already",
            with("{ \"headway\"", "{ \"ado.x\""),
        ),
        (
            "a learner out of range",
            with("decisions: 300_000", "decisions: 0"),
        ),
        (
            "a name that would leave the directory",
            with("name: \"acc\"", "name: \"../acc\""),
        ),
        (
            "nothing observed",
            with(
                "observe: [\"headway\", \"ego.speed\", \"ado.speed\", \"ego.accel\", \"time_left\"]",
                "observe: []",
            ),
        ),
        (
            "a constant named like a signal",
            with("\"v_min\": 0.1", "\"headway\": 3.0, \"v_min\": 0.1"),
        ),
        (
            "a constant named like an operator",
            with("\"v_min\": 0.1", "\"always\": 3.0, \"v_min\": 0.1"),
        ),
        (
            "an unused formula that makes no sense",
            with(
                "ego_spec:",
                "formulas: { \"near\": \"headwy < 9\" },\n    ego_spec:",
            ),
        ),
        (
            "formulas that use each other",
            with(
                "ego_spec:",
                "formulas: { \"a\": \"not b\", \"b\": \"not a\" },\n    ego_spec:",
            ),
        ),
        (
            "a changed ego called nominal",
            with("\"wet road\":", "\"nominal\":"),
        ),
        (
            "a body that reaches into another",
            with(
                "\"wet road\":      Change(friction: 0.4),",
                "\"lorry\": Change(ego_body: \"truck\"),",
            )
            .replace("At(x_m: 0.0", "At(x_m: 5.0")
            .replace("(8.0, 60.0)", "(-12.0, -8.0)"),
        ),
        (
            "bodies that overlap in a bend only",
            with(
                "Straight(lanes: 1,",
                "Curved(pieces: [Arc(length_m: 40.0, radius_m: 15.0)], lanes: 2,",
            )
            .replace("lane: 0", "lane: 1")
            .replace("At(x_m: 0.0", "At(x_m: 10.0")
            .replace("(8.0, 60.0)", "(5.0, 15.0)"),
        ),
        (
            "somebody far off the road",
            with(
                "agents: [",
                "agents: [\n        Pedestrian(name: \"walker\", lateral_m: (-40.0, -3.0), start: At(x_m: 50.0, speed_mps: 0.0), drive: Scripted(Walk([]))),",
            ),
        ),
        (
            "a stop line far away",
            with(
                "agents: [",
                "agents: [\n        Light(name: \"light\", line_m: 90000.0, drive: Schedule([])),",
            ),
        ),
        (
            "a spec without a signal",
            with("always[0, T] (headway >= d_safe)", "always (d_safe >= 5)"),
        ),
        (
            "a spec that nobody can violate",
            with(
                "always[0, T] (headway >= d_safe)",
                "always (ego.ado.gap >= -0.1)",
            ),
        ),
        (
            "a spec that no ado can influence",
            with("always[0, T] (headway >= d_safe)", "always (time <= 10)"),
        ),
        (
            "a rule that nothing can keep",
            with("ado.speed <= v_lim", "ado.speed <= -2"),
        ),
        (
            "a start without its kind",
            with(
                "At(x_m: 0.0, speed_mps: (5.0, 25.0))",
                "(x_m: 0.0, speed_mps: 5.0)",
            ),
        ),
        (
            "a rule that is a text",
            with("rulebook: [", "rulebook: [\"always (ado.speed <= 30)\", "),
        ),
        (
            "a list that is none",
            with("[-3.0, 0.0, 3.0]", "(-3.0, 0.0, 3.0)"),
        ),
        ("a text without quotes", with("name: \"acc\"", "name: acc")),
        (
            "a number in words",
            with("friction: 0.9", "friction: \"wet\""),
        ),
        (
            "a horizon in words",
            with("horizon_s: 15.0", "horizon_s: nine"),
        ),
        ("too many lanes", with("lanes: 1,", "lanes: 1000000000,")),
        (
            "half of the file",
            ACC[..ACC.find("0.2, ").expect("its gains") + 5].to_owned(),
        ),
        ("nothing", String::new()),
        ("another thing", "hello".to_owned()),
    ]
}

#[test]
fn every_mistake_has_a_place_a_reason_and_a_cure() {
    let mut shown = String::new();
    for (what, text) in mistakes() {
        let Err(error) = Scenario::parse("acc.ron", &text) else {
            panic!("{what}: accepted");
        };
        for problem in &error.problems {
            assert!(problem.span.end <= text.len(), "{what}");
        }
        let rendered = Failure::from(error).render(plain_theme(), 100);
        shown.push_str(&format!("=== {what}\n{rendered}\n"));
    }
    insta::assert_snapshot!("world_mistakes", shown);
}

#[test]
fn mistakes_of_all_kinds_are_found_together() {
    let mut text = ACC.to_owned();
    let wrong = [
        ("\"sedan\"", "\"sedann\""),
        ("ado.speed >= v_min", "ado.speeed >= v_min"),
        ("(headway >= d_safe)", "(ego.ado.gapp >= d_safe)"),
        ("\"ado.x - ego.x\"", "\"ado.x - ergo.x\""),
        ("headway_m: (8.0", "headwy_m: (8.0"),
        ("speed_mps: (5.0", "sped_mps: (5.0"),
    ];
    for (from, to) in wrong {
        assert!(text.contains(from), "acc.ron no longer contains {from}");
        text = text.replacen(from, to, 1);
    }
    let error = Scenario::parse("acc.ron", &text).expect_err("six mistakes");
    let mut places: Vec<&str> = error
        .problems
        .iter()
        .map(|it| &text[it.span.clone()])
        .collect();
    places.sort_unstable();
    let expected = [
        "\"sedann\"",
        "ado.speeed",
        "ego.ado.gapp",
        "ergo.x",
        "headwy_m",
        "sped_mps",
    ];
    assert_eq!(places, expected, "{error}");
    assert!(Scenario::is_readable(&text));
    assert!(!Scenario::is_readable(
        &text.replace("plant: Rigid,", "plant: Rigid")
    ));
}

#[test]
fn a_list_of_an_ado_that_is_too_long_is_marked_itself() {
    let many = format!("observe: [{}", "\"headway\", ".repeat(1_001));
    let text = ACC.replacen("observe: [", &many, 1);
    let error = Scenario::parse("acc.ron", &text).expect_err("too many signals");
    let marked = &text[error.problems[0].span.clone()];
    assert!(marked.starts_with("[\"headway\""), "{error}");
}

#[test]
fn rules_that_exclude_each_other_or_nothing_are_warned_about() {
    let text = ACC
        .replace("ado.speed >= v_min", "time < 1.02 or ado.speed >= 16")
        .replace("(8.0, 60.0)", "(40.0, 60.0)")
        .replace("ado.speed <= v_lim", "time < 1.02 or ado.speed <= 15")
        .replace(
            "rulebook: [",
            "rulebook: [Rule(name: \"is there\", stl: \"always (ego.ado.gap >= -1)\"),",
        );
    let world = Scenario::parse("acc.ron", &text).expect("odd, but allowed");
    let warned: Vec<&str> = world
        .warnings()
        .iter()
        .map(|odd| odd.what.as_str())
        .collect();
    let expected = [
        "the rules `never stops or reverses` and `keeps the speed limit` were never kept together",
        "the rule `is there` cannot be broken",
    ];
    assert_eq!(warned, expected);
    assert!(text[world.warnings()[0].span.clone()].contains("<= 15"));
}

#[test]
fn a_coasting_run_at_exactly_zero_is_warned_about() {
    let text = ACC
        .replace("\"v_lim\": 30.0", "\"v_lim\": 25.0")
        .replacen(
            "speed_mps: (5.0, 25.0)),\n            drive: Ado",
            "speed_mps: 10.0),\n            drive: Ado",
            1,
        )
        .replace("ado.speed >= v_min", "10.0 - ado.speed >= -v_min")
        .replace("\"v_min\": 0.1", "\"v_min\": 0.0");
    let error = Scenario::parse("acc.ron", &text).expect_err("ρ = 0 at t = 0");
    assert!(
        error.to_string().contains("broken already at the start"),
        "{error}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 150,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn damaged_files_are_errors_or_worlds_but_never_panics(
        at in 0..ACC.len(), cut in 0usize..40, insert in "[-(){}\\[\\],:\"a-z0-9. ]{0,6}",
    ) {
        let from = (0..=at).rev().find(|&i| ACC.is_char_boundary(i)).unwrap_or(0);
        let to = (from + cut).min(ACC.len());
        let to = (to..=ACC.len()).find(|&i| ACC.is_char_boundary(i)).unwrap_or(ACC.len());
        let text = format!("{}{insert}{}", &ACC[..from], &ACC[to..]);
        if let Err(error) = Scenario::parse("damaged.ron", &text) {
            prop_assert!(!error.problems.is_empty());
            let _ = Failure::from(error).render(plain_theme(), 100);
        }
    }
}
