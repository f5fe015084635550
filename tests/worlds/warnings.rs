//! What is allowed but odd is warned about, and a world can say it is meant.

use brakecheck::world::Scenario;

const ACC: &str = include_str!("../../worlds/acc.ron");
const NEW: &str = include_str!("../../src/cli/new_world.ron");
const GRID: &str = include_str!("../../worlds/grid.ron");
const MERGE: &str = include_str!("../../worlds/merge.ron");

fn with(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the world no longer contains {from}");
    text.replacen(from, to, 1)
}

fn warned(text: &str) -> Vec<(String, String)> {
    let world = Scenario::parse("odd.ron", text).unwrap_or_else(|error| panic!("{error}"));
    let warnings = world.warnings().iter();
    let said = warnings.map(|odd| (odd.what.clone(), odd.help.clone().unwrap_or_default()));
    said.collect()
}

/// The line of a text that begins with these words.
fn line_of(text: &str, begins: &str) -> String {
    let line = text.lines().find(|line| line.trim().starts_with(begins));
    line.expect("such a line").to_owned()
}

const TOO_NEAR: &str = "`box` may stand 22.0 m ahead of the ego, which needs 35.4 m to stop from 25 m/s at the limit of the road";

/// The merge with a parked car in the ego's lane, its front bumper at a station.
fn before(s_m: f64) -> String {
    let parked = format!("Obstacle(name: \"box\", body: \"sedan\", s_m: {s_m:?}, lateral_m: 0.0),");
    let last = "    ],\n    signals: {";
    with(MERGE, last, &format!("        {parked}\n{last}"))
}

/// What is odd: the word that allows it, what the warning says, and the text.
fn oddities() -> Vec<(&'static str, &'static str, String)> {
    let lines: Vec<&str> = ACC.lines().collect();
    let rulebook = lines
        .iter()
        .position(|line| line.contains("rulebook: ["))
        .expect("a rulebook");
    let end = lines[rulebook..]
        .iter()
        .position(|line| line.trim() == "],");
    let mut lawless = lines.clone();
    lawless.drain(rulebook + 1..rulebook + end.expect("its end"));
    vec![
        (
            "decision_beyond_horizon",
            "a decision of 20 s in a run of 15 s",
            with(ACC, "decision_s: 0.5", "decision_s: 20.0"),
        ),
        (
            "bounds_beyond_T",
            "the ego's specification looks 20 s away, and a run ends at 15 s",
            with(ACC, "always[0, T] (headway", "always[0, 20] (headway"),
        ),
        (
            "duplicate_rule",
            "two rules are called `never stops`",
            with(
                ACC,
                "rulebook: [",
                "rulebook: [Rule(name: \"never stops\", stl: \"always (ado.speed >= 0.05)\"), Rule(name: \"never stops\", stl: \"always (ado.speed >= 0.01)\"),",
            ),
        ),
        (
            "duplicate_rule",
            "`b` asks what `a` does",
            with(
                ACC,
                "rulebook: [",
                "rulebook: [Rule(name: \"a\", stl: \"G (ado.speed >= 0.05)\"), Rule(name: \"b\", stl: \"always (ado.speed>=0.05)\"),",
            ),
        ),
        (
            "duplicate_observation",
            "`headway` is observed twice, and counts once",
            with(
                ACC,
                "observe: [\"headway\"",
                "observe: [\"headway\", \"headway\"",
            ),
        ),
        (
            "equal_actions",
            "this ado has no choice, since all its actions are equal",
            with(
                ACC,
                "Accelerations([-3.0, 0.0, 3.0])",
                "Accelerations([0.0, 0.0, 0.0])",
            ),
        ),
        (
            "empty_change",
            "`same` changes nothing, so it is the world's own ego",
            with(ACC, "reuse: {", "reuse: { \"same\": Change(),"),
        ),
        (
            "fast_start",
            "a start at 90 m/s, which is 324 km/h",
            with(
                ACC,
                "x_m: 0.0, speed_mps: (5.0, 25.0)",
                "x_m: 0.0, speed_mps: (5.0, 90.0)",
            ),
        ),
        (
            "fast_ego",
            "`desired_speed_mps` is 130 m/s, which is 468 km/h",
            with(
                ACC,
                "reuse: {",
                "reuse: { \"fast\": Change(controller: Idm(desired_speed_mps: 130.0, time_gap_s: 1.0, min_gap_m: 2.0, max_accel_mps2: 1.0, comfort_brake_mps2: 2.0, max_brake_mps2: 8.0, lag_s: 0.2)),",
            ),
        ),
        (
            "excluding_rules",
            "the rules `moves` and `stands` were never kept together",
            with(
                ACC,
                "rulebook: [",
                "rulebook: [Rule(name: \"moves\", stl: \"always (ado.speed >= 1)\"), Rule(name: \"stands\", stl: \"always[2, T] (ado.speed <= 0.5)\"),",
            ),
        ),
        (
            "never_kept",
            "the rule `stands` was kept to the end of none of 160 runs",
            with(
                ACC,
                "rulebook: [",
                "rulebook: [Rule(name: \"stands\", stl: \"always[0.5, T] (ado.speed <= 0.5)\"),",
            ),
        ),
        (
            "wind_without_slip",
            "on the kinematic plant wind moves nothing aside",
            with(
                &with(ACC, "plant: Rigid,", "plant: Kinematic,"),
                "agents: [",
                "wind: (speed_mps: 8.0, from_rad: 1.57), agents: [",
            ),
        ),
        (
            "long_lag",
            "an actuator that lags by 6 s",
            with(ACC, "neutral: 1,", "neutral: 1, lag_s: 6.0,"),
        ),
        (
            "long_lag",
            "an actuator that lags by 1000 s",
            with(NEW, "lag_s: 0.3", "lag_s: 1000.0"),
        ),
        (
            "empty_question",
            "the world asks nothing",
            with(ACC, &line_of(ACC, "question:"), "    question: \" \","),
        ),
        (
            "empty_rulebook",
            "this ado has no rule, so whatever it does is lawful",
            lawless.join("\n"),
        ),
        (
            "unseen",
            "the ego's specification reads `headway`, and no ado observes anything of it",
            with(
                ACC,
                &line_of(ACC, "observe: ["),
                "                observe: [\"ado.speed\", \"ego.speed\", \"time_left\"],",
            ),
        ),
        (
            "duplicate_observation",
            "`near.x` is observed twice, and counts once",
            {
                with(
                    GRID,
                    "observe: [\"near.x\"",
                    "observe: [\"near.x\", \"near.x\"",
                )
            },
        ),
        (
            "spec_without_ego",
            "the ego's specification reads nothing of the ego, only `ado.speed`",
            with(
                ACC,
                "always[0, T] (headway >= d_safe)",
                "always[0, T] (ado.speed >= 1)",
            ),
        ),
        (
            "off_road_move",
            "`ado` has 0.85 m of road beside it where it can move, less than its own width of 1.8 m",
            with(MERGE, "lateral: [Hold, Right]", "lateral: [Hold, Left]"),
        ),
        ("obstacle_too_near", TOO_NEAR, before(26.54)),
    ]
    .into_iter()
    .chain(decided_at_once())
    .collect()
}

/// Formulas that the first sample decides: without `always`, or of an event at the start.
fn decided_at_once() -> Vec<(&'static str, &'static str, String)> {
    let spec = "the first sample alone decides the ego's specification";
    let rule = "the first sample alone decides the rule `moves`";
    let specs = [
        "headway >= d_safe",
        "historically (headway >= d_safe)",
        "always[0, 0] (headway >= d_safe)",
        "eventually[0, T] (headway >= d_safe)",
    ];
    let specs = specs.map(|stl| with(ACC, "always[0, T] (headway >= d_safe)", stl));
    let of = |text: &str, stl: &str| {
        let rule = format!("rulebook: [Rule(name: \"moves\", stl: \"{stl}\"),");
        with(text, "rulebook: [", &rule)
    };
    let rules = [of(ACC, "ado.speed >= 1"), of(GRID, "ado.x >= -1")];
    let in_specs = specs.into_iter().map(|text| (spec, text));
    let all = in_specs.chain(rules.into_iter().map(|text| (rule, text)));
    all.map(|(says, text)| ("first_sample_only", says, text))
        .collect()
}

#[test]
fn what_is_odd_is_said_unless_the_world_allows_it() {
    assert_eq!((warned(ACC), warned(GRID)), (Vec::new(), Vec::new()));
    for (word, says, text) in oddities() {
        let said = warned(&text);
        let found = said.iter().find(|(what, _)| what == says);
        let (_, help) = found.unwrap_or_else(|| panic!("{word}: {said:?}"));
        assert!(help.contains(&format!("allow: [\"{word}\"]")), "{help}");
        let allowed = with(
            &text,
            "    question:",
            &format!("    allow: [\"{word}\"],\n    question:"),
        );
        let rest: Vec<String> = warned(&allowed).into_iter().map(|(what, _)| what).collect();
        assert!(!rest.contains(&says.to_owned()), "{word}: {rest:?}");
        assert_eq!(rest.len() + 1, said.len(), "{word}: {rest:?}");
    }
}

/// A move with room for it, an obstacle far or aside, and a spec of a pair are usual.
#[test]
fn what_is_only_near_to_odd_is_not_warned_about() {
    let aside = |lateral: &str| before(26.54).replace("s_m: 26.54, lateral_m: 0.0", lateral);
    let kinds = ["has", "may stand", "reads nothing of the ego"];
    let usual = [
        MERGE.to_owned(),
        with(
            MERGE,
            "lateral: [Hold, Right]",
            "lateral: [Hold, Left, Right]",
        ),
        with(MERGE, "lateral: [Hold, Right]", "lateral: [Hold]"),
        // 35.4 m and a little more.
        before(40.0),
        aside("s_m: 26.54, lateral_m: -1.81"),
        with(
            ACC,
            "always[0, T] (headway >= d_safe)",
            "always[0, T] (not contact)",
        ),
        with(
            ACC,
            "always[0, T] (headway >= d_safe)",
            "always[0, T] (ado.ego.gap >= 1)",
        ),
    ];
    for text in usual {
        let said = warned(&text);
        let is_new = |(what, _): &(String, String)| kinds.iter().any(|kind| what.contains(kind));
        assert!(!said.iter().any(is_new), "{said:?}");
    }
    // Less than 35.4 m, and nearly beside the ego.
    let near = [before(39.8), aside("s_m: 26.54, lateral_m: -1.79")];
    for text in near {
        let said = warned(&text);
        assert!(
            said.iter().any(|(what, _)| what.contains("may stand")),
            "{said:?}"
        );
    }
}

#[test]
fn a_word_that_allows_nothing_is_a_mistake() {
    let text = with(
        ACC,
        "    question:",
        "    allow: [\"bounds_beyond_t\"],\n    question:",
    );
    let error = Scenario::parse("acc.ron", &text).expect_err("an unknown word");
    assert_eq!(&text[error.problems[0].span.clone()], "\"bounds_beyond_t\"");
    assert!(
        error
            .to_string()
            .contains("did you mean `bounds_beyond_T`?"),
        "{error}"
    );
}

/// Two runs of 5000 s are too few to call a rule impossible.
#[test]
fn a_rule_that_few_long_runs_broke_is_warned_about_only() {
    let text = with(ACC, "horizon_s: 15.0", "horizon_s: 5000.0");
    let text = with(&text, "judge: UntilViolation,", "judge: WholeRun,");
    let text = with(
        &text,
        "rulebook: [",
        "rulebook: [Rule(name: \"gets away\", stl: \"eventually (ego.ado.gap > 1e9)\"),",
    );
    let said = warned(&text);
    let rule = |(what, help): &&(String, String)| {
        what.contains("`gets away` was broken in") && help.contains("barely_tried")
    };
    assert!(said.iter().find(rule).is_some(), "{said:?}");
}

#[test]
fn a_byte_order_mark_is_read_over() {
    let marked = format!("\u{feff}{ACC}");
    let world = Scenario::parse("acc.ron", &marked).expect("a world");
    assert_eq!(world.text(), ACC);
    let dir = tempfile::tempdir().expect("a directory");
    let change = dir.path().join("wet.ron");
    std::fs::write(&change, "\u{feff}Change(friction: 0.4)").expect("written");
    world.changed_by(&change).expect("a change");
}

#[test]
fn a_signal_used_before_it_is_declared_is_called_so() {
    let cases = [
        (
            "\"near\": \"headway - 1\", \"headway\"",
            "the signal `headway` is declared later",
            "headway",
        ),
        (
            "\"near\": \"near + 1\", \"headway\"",
            "the signal `near` is defined by itself",
            "near",
        ),
        (
            "\"near\": \"hedway - 1\", \"headway\"",
            "`hedway`",
            "hedway",
        ),
    ];
    for (signals, says, underlined) in cases {
        let text = with(ACC, "{ \"headway\"", &format!("{{ {signals}"));
        let error = Scenario::parse("acc.ron", &text).expect_err(signals);
        let problem = &error.problems[0];
        assert!(problem.what.contains(says), "{error}");
        assert_eq!(&text[problem.span.clone()], underlined, "{error}");
    }
}

#[test]
fn an_empty_list_of_observations_is_underlined_itself() {
    let list = "observe: [\"headway\", \"ego.speed\", \"ado.speed\", \"ego.accel\", \"time_left\"]";
    let text = with(ACC, list, "observe: []");
    let error = Scenario::parse("acc.ron", &text).expect_err("nothing observed");
    assert_eq!(&text[error.problems[0].span.clone()], "[]", "{error}");
}

#[test]
fn the_worlds_inside_the_program_are_those_of_the_directory() {
    let names: Vec<String> = Scenario::shipped_names()
        .map(|name| format!("{name}.ron"))
        .collect();
    let shipped = super::shipped();
    let files: Vec<&String> = shipped.iter().map(|(file, _)| file).collect();
    assert_eq!(names.iter().collect::<Vec<_>>(), files);
    for (name, (file, world)) in Scenario::shipped_names().zip(&shipped) {
        let inside = Scenario::shipped(name).expect(name).expect(name);
        assert_eq!(inside.text(), world.text(), "{file}");
        assert!(
            world.warnings().is_empty(),
            "{file}: {:?}",
            world.warnings()
        );
    }
}

/// A rule that is broken a moment after ρ = 0 is no tie.
#[test]
fn a_coasting_run_that_breaks_a_rule_is_not_taken_for_one_that_just_keeps_it() {
    let light = include_str!("../../worlds/light_ado.ron");
    let rule = "rulebook: [Rule(name: \"short\", stl: \"always (light.phase_time <= 1)\"),";
    let said = warned(&with(light, "rulebook: [", rule));
    assert!(
        !said.iter().any(|(what, _)| what.contains("ρ = 0 exactly")),
        "{said:?}"
    );
}

#[test]
fn ados_whose_world_names_no_observation_see_what_is_usual() {
    let names = |world: &Scenario| -> Vec<String> {
        let observed = world.world().observed().iter();
        observed.map(|observed| observed.name.clone()).collect()
    };
    let without = |text: &str| with(text, &format!("{}\n", line_of(text, "observe: [")), "");
    let world = Scenario::parse("acc.ron", &without(ACC)).expect("a world");
    assert_eq!(
        names(&world),
        [
            "ego.ado.headway",
            "ego.speed",
            "ego.accel",
            "ado.speed",
            "time_left"
        ]
    );
    assert!(world.warnings().is_empty(), "{:?}", world.warnings());
    let world = Scenario::parse("new.ron", &without(NEW)).expect("a world");
    assert_eq!(
        names(&world),
        [
            "ego.ado.headway",
            "ego.ado.lateral",
            "ado.lateral_speed",
            "ego.speed",
            "ego.accel",
            "ado.speed",
            "time_left"
        ]
    );
    assert!(world.warnings().is_empty(), "{:?}", world.warnings());
    let light = include_str!("../../worlds/light_ado.ron");
    let world = Scenario::parse("light_ado.ron", &without(light)).expect("a world");
    let seen = names(&world);
    for name in [
        "light.phase",
        "light.phase_time",
        "ego.light.line",
        "ego.speed",
    ] {
        assert!(seen.iter().any(|seen| seen == name), "{name}: {seen:?}");
    }
}

/// Worlds that nobody here wrote: sound, and odd only where that is their point.
#[test]
fn worlds_of_others_are_sound_and_the_blind_one_is_said_to_be() {
    let dir = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("worlds/others");
    let mut met = 0;
    for entry in std::fs::read_dir(dir).expect("the worlds") {
        let path = entry.expect("an entry").path();
        let world = Scenario::load(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(world.learner().name(), "Dqfd", "{}", path.display());
        let said: Vec<&str> = world
            .warnings()
            .iter()
            .map(|odd| odd.what.as_str())
            .collect();
        let unseen = said
            .iter()
            .filter(|what| what.contains("no ado observes anything of it"));
        let blind = 3 * usize::from(world.name() == "blind");
        assert_eq!(
            (unseen.count(), said.len()),
            (blind, blind),
            "{}: {said:?}",
            world.name()
        );
        met += 1;
    }
    assert_eq!(met, 15);
}
