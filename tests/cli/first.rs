//! The first hour: a new world, numbers and names as they are typed, and help.

use super::{brakecheck, brakecheck_in, code, json, refusal, refused, root, scratch, stderr};

#[test]
fn a_new_world_is_sound_and_nothing_is_overwritten() {
    let dir = scratch();
    let output = brakecheck_in(dir.path(), &["new", "mine"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let file = dir.path().join("mine.ron");
    let text = std::fs::read_to_string(&file).expect("the world");
    assert!(
        text.contains("name: \"mine\"") && !text.contains("NAME"),
        "{text}"
    );
    let listing = json(&brakecheck_in(dir.path(), &["check", "mine.ron", "--json"]));
    assert_eq!(
        (&listing["ok"], &listing["warnings"]),
        (&true.into(), &serde_json::json!([]))
    );
    let search = [
        "search",
        "mine.ron",
        "--starts",
        "4",
        "--plant",
        "kinematic",
        "--json",
    ];
    let output = brakecheck_in(dir.path(), &search);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    std::fs::write(&file, "precious").expect("written");
    for name in ["mine", "mine.ron"] {
        let output = brakecheck_in(dir.path(), &["new", name]);
        refusal(&output, "is there already");
    }
    assert_eq!(std::fs::read_to_string(&file).expect("still"), "precious");
    let output = brakecheck_in(dir.path(), &["new", "../mine"]);
    refusal(&output, "cannot name a world");
}

#[test]
fn what_has_no_effect_is_no_option() {
    let cases: [&[&str]; 6] = [
        &["check", "worlds/acc.ron", "--seed", "1"],
        &["check", "worlds/acc.ron", "--jobs", "1"],
        &["stl", "x > 0", "--trace", "-", "--seed", "1"],
        &["stl", "x > 0", "--trace", "-", "--allow-programs"],
        &["replay", "tests/regressions", "--seed", "1"],
        &["view", "tests/regressions", "--seed", "1"],
    ];
    for args in cases {
        refused(args, "unexpected argument");
    }
}

#[test]
fn a_program_after_a_verb_that_takes_a_file_is_refused_with_that_file() {
    let cases = [
        ["view", "tests/regressions/acc-nominal-0001.ron"],
        ["train", "acc"],
    ];
    for verb in cases {
        let output = brakecheck(&[&verb[..], &["--", "python3", "my ego.py"]].concat());
        assert_eq!(code(&output), 2, "{verb:?}");
        for part in [
            "`--ego FILE.ron --allow-programs`",
            r#"Change(controller: Process(command: ["python3", "my ego.py"]))"#,
        ] {
            assert!(stderr(&output).contains(part), "{}", stderr(&output));
        }
    }
}

#[test]
fn egos_learners_and_worlds_are_guessed() {
    let kept = "tests/regressions/acc-nominal-0001.ron";
    let cases: [(&[&str], &str); 5] = [
        (&["check", "worlds/merg.ron"], "did you mean `merge`?"),
        (
            &[
                "search",
                "worlds/acc.ron",
                "--ego",
                "soft brakes",
                "--starts",
                "1",
            ],
            "did you mean `softer brakes`?",
        ),
        (
            &[
                "search",
                "worlds/acc_plain.ron",
                "--ego",
                "nominl",
                "--starts",
                "1",
            ],
            "did you mean `nominal`?",
        ),
        (
            &["replay", kept, "--ego", "nominel"],
            "did you mean `nominal`?",
        ),
        (
            &["train", "worlds/grid.ron", "--learner", "x"],
            "leave out `--learner`",
        ),
    ];
    for (args, says) in cases {
        let said = refused(args, says);
        assert!(
            !said.contains("known: ;") && !said.contains(", ;"),
            "{said}"
        );
    }
}

#[test]
fn numbers_are_taken_as_they_are_typed() {
    for decisions in ["0", "3x", "1.5", "99999999999999999999"] {
        refused(
            &["train", "worlds/acc.ron", "--decisions", decisions],
            decisions,
        );
    }
    let search = |starts: &str| {
        let args = [
            "search",
            "worlds/acc.ron",
            "--plant",
            "kinematic",
            "--starts",
            starts,
        ];
        let more = ["--method", "hold", "--budget", "0.001k", "--json"];
        json(&brakecheck(&[&args[..], &more].concat()))["rows"][0]["solved"].clone()
    };
    assert_eq!(search("0.01k"), search("1_0"));
}

#[test]
fn shipped_worlds_are_there_by_name_wherever_one_is() {
    let dir = scratch();
    let listing = json(&brakecheck_in(dir.path(), &["check", "acc", "--json"]));
    assert_eq!(listing["ok"], true);
    let rows = |args: &[&str]| {
        let more = ["--plant", "kinematic", "--starts", "5", "--json"];
        let output = brakecheck_in(dir.path(), &[args, &more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        json(&output)["rows"].as_array().map_or(0, Vec::len)
    };
    assert_eq!(rows(&["search", "acc"]), 1);
    assert_eq!(rows(&["eval", "acc"]), 4);
    // A file of that name comes first.
    std::fs::write(dir.path().join("acc"), "no world").expect("written");
    refusal(&brakecheck_in(dir.path(), &["check", "acc"]), "");
}

#[test]
fn a_formula_that_looks_beyond_the_trace_says_so() {
    let dir = scratch();
    let file = dir.path().join("short.csv");
    std::fs::write(&file, "time,gap\n0,2\n0.1,3\n0.2,4\n").expect("written");
    let stl = |formula: &str| {
        let file = file.display().to_string();
        let output = brakecheck(&["stl", formula, "--trace", &file]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        stderr(&output)
    };
    let said = stl("always[0, 14] (gap > 1)");
    assert!(said.contains("looks 14.000000 s ahead"), "{said}");
    assert!(said.contains("ends after 0.200000 s"), "{said}");
    assert!(!stl("always[0, 0.2] (gap > 1)").contains("warning"));
    assert!(!stl("always (gap > 1)").contains("warning"));
}

#[test]
fn a_world_has_no_trained_ado_to_ask_for() {
    let eval = [
        "eval",
        "worlds/acc.ron",
        "--ado",
        "trained",
        "--starts",
        "1",
    ];
    refused(&eval, "train an ado first");
}

#[test]
fn warnings_do_not_look_like_errors() {
    let dir = scratch();
    let world = std::fs::read_to_string("worlds/acc.ron").expect("the world");
    let blind = world.replace("observe: [\"headway\", \"ego.speed\", ", "observe: [");
    std::fs::write(dir.path().join("blind.ron"), blind).expect("written");
    let output = brakecheck_in(dir.path(), &["check", "blind.ron"]);
    let said = stderr(&output);
    assert_eq!(code(&output), 0, "{said}");
    assert!(said.contains('⚠') && !said.contains('×'), "{said}");
    let output = brakecheck_in(dir.path(), &["check", "none.ron"]);
    assert!(stderr(&output).contains('×'), "{}", stderr(&output));
}

/// What an import drops, on stderr or in JSON; what it refuses names the cure.
#[test]
fn an_import_says_what_it_drops_and_what_to_write_instead() {
    let dir = scratch();
    let small = root().join("tests/worlds/imports");
    let copied = |name: &str, from: &str, to: &str| {
        let text = std::fs::read_to_string(small.join(name)).expect("a file");
        let changed = text.replace(from, to);
        assert_ne!(text, changed, "{from}");
        std::fs::write(dir.path().join(name), changed).expect("written");
    };
    let leans = r#"<lateralProfile><superelevation s="0" a="0.05" b="0" c="0" d="0"/>"#;
    let leans = format!("{leans}</lateralProfile>");
    copied("straight.xodr", "<lateralProfile/>", &leans);
    copied("base.xosc", "<!--global-->", "");
    let new = |words: &[&str]| {
        let words = [&["new", "--from", "base.xosc"], words].concat();
        brakecheck_in(dir.path(), &words)
    };
    let said = new(&["one"]);
    assert_eq!(code(&said), 0, "{}", stderr(&said));
    let line = "dropped: lateral profile, 1 in all, the first in straight.xodr, line 10\n";
    assert_eq!(stderr(&said), line);
    let said = new(&["two", "--json"]);
    assert_eq!(stderr(&said), "");
    let dropped = serde_json::json!([
        { "kind": "lateral profile", "file": "straight.xodr", "line": 10, "count": 1 }
    ]);
    assert_eq!(json(&said)["dropped"], dropped);
    copied("straight.xodr", r#"length="1000" id"#, r#"length="900" id"#);
    let said = new(&["three"]);
    assert_eq!(code(&said), 2);
    for part in [
        "straight.xodr",
        "line 4",
        "its length is 900.000 m",
        "make both the same",
    ] {
        assert!(stderr(&said).contains(part), "{part}: {}", stderr(&said));
    }
    assert!(!dir.path().join("three.ron").exists());
}
