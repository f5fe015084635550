//! Typical mistakes of a first hour: each message names the place and the fix.

use super::program::{code, run_with, scratch, stderr};
use super::root;

/// Words of a command line, and parts of the message.
type Mistake = (&'static str, &'static [&'static str]);

const MISTAKES: [Mistake; 35] = [
    ("campaign run plan --piece -1", &["a whole number from 0"]),
    ("sarch acc", &["'sarch'", "'search'", "`brakecheck --help`"]),
    (
        "acc search",
        &["'acc'", "the verb comes first", "`brakecheck check acc`"],
    ),
    ("README.md", &["'README.md'", "the verb comes first"]),
    ("search", &["<WORLD|RUN>", "usage: brakecheck search"]),
    (
        "search acc --sead 1",
        &["'--sead'", "'--seed'", "`brakecheck search --help`"],
    ),
    (
        "search acc --over ego.x=0..1",
        &["'--over'", "it is an option of `sweep`"],
    ),
    ("search acc --from runs/x", &["'--from'", "`--bank RUN`"]),
    ("check acc -j 4", &["'-j'", "it is an option of `train`"]),
    (
        "search acc python3 ego.py",
        &["'python3'", "`brakecheck search acc -- python3 ego.py`"],
    ),
    ("search acc --plant ridgid", &["'ridgid'", "'rigid'"]),
    ("search acc --starts 0", &["'0'", "--starts"]),
    ("search acc --starts many", &["'many'", "300k"]),
    (
        "search acc --seed 18446744073709551616",
        &[
            "'18446744073709551616'",
            "--seed",
            "from 0 to 18446744073709551615",
        ],
    ),
    ("search acc --jobs 0", &["'0'", "--jobs", "1..=1024"]),
    ("search acc --ego", &["--ego", "a value is required"]),
    (
        "search acc --starts 2 --",
        &["missing command after `--`", "leave out `--`"],
    ),
    (
        "search acc --switches 99999",
        &["--switches", "99999 is not in 0..=10"],
    ),
    (
        "risk acc --known none.ron",
        &["none.ron", "no such file or directory"],
    ),
    (
        "view tests/regressions/acc-nominal-0001.ron -o none/crash.svg",
        &["no directory `none`", "make it first"],
    ),
    (
        "export tests/regressions -o Cargo.toml",
        &["`Cargo.toml` is no directory"],
    ),
    (
        "log trace.csv --picture lanes.png",
        &["lanes.png", "ends in .svg"],
    ),
    ("search acm", &["`acm`", "`acc`"]),
    (
        "search acc --ego nominl",
        &["`nominl`", "did you mean `nominal`?"],
    ),
    ("check none.ron", &["`none.ron`", "name a world file"]),
    ("check src", &["`src`", "is a directory"]),
    ("check Cargo.toml", &["Cargo.toml:"]),
    (
        "replay acc",
        &["`acc` is a world", "brakecheck search acc --keep kept"],
    ),
    (
        "gate acc --baseline-ego nominal",
        &["`acc` is a world", "brakecheck train acc"],
    ),
    ("eval src", &["`src`", "brakecheck train"]),
    (
        "view tests/regressions/acc-nominal-0001.ron -o crash.jpg",
        &["crash.jpg", ".svg"],
    ),
    (
        "search tests/regressions/acc-nominal-0001.ron",
        &[
            "acc-nominal-0001.ron:2:5",
            "this is a kept counterexample",
            "`brakecheck replay FILE`",
        ],
    ),
    (
        "replay tests/regressions/acc-nominal-0001.csv",
        &[
            "has the samples of a kept counterexample",
            "`tests/regressions/acc-nominal-0001.ron`",
        ],
    ),
    (
        "export tests/regressions",
        &["--output <DIR>", "usage: brakecheck export"],
    ),
    (
        "stl always(gap>0)",
        &["--trace <FILE.csv>", "usage: brakecheck stl"],
    ),
];

#[test]
fn each_mistake_has_its_place_and_a_fix() {
    for (words, parts) in MISTAKES {
        let words: Vec<&str> = words.split(' ').collect();
        let output = run_with(root(), &[("COLUMNS", "200")], &words);
        let said = stderr(&output);
        assert_eq!(code(&output), 2, "{words:?}: {said}");
        for part in parts.iter().chain(&["  × ", "  help: "]) {
            assert!(said.contains(part), "{words:?}, `{part}`: {said}");
        }
        assert!(output.stdout.is_empty(), "{words:?}");
    }
}

#[test]
fn files_that_hold_no_world_are_named() {
    let dir = scratch();
    std::fs::write(dir.path().join("empty.ron"), "").expect("written");
    std::fs::write(dir.path().join("empty.csv"), "").expect("written");
    let (campaign, xml) = (dir.path().join("c.ron"), dir.path().join("x.xosc"));
    std::fs::write(campaign, "// One\nCampaign(name: \"c\")").expect("written");
    std::fs::write(xml, "<?xml version=\"1.0\"?>\n<OpenSCENARIO/>").expect("written");
    for (words, part) in [
        ("check c.ron", "brakecheck campaign plan"),
        ("check x.xosc", "brakecheck new NAME --from"),
        ("check empty.ron", "empty.ron:1:1"),
        ("search empty.ron", "empty.ron:1:1"),
        ("log empty.csv", "empty.csv"),
        ("stl x>0 --trace empty.csv", "empty.csv"),
    ] {
        let output = run_with(dir.path(), &[], &words.split(' ').collect::<Vec<_>>());
        let said = stderr(&output);
        assert_eq!(code(&output), 2, "{words}: {said}");
        assert!(
            said.contains(part) && said.contains("help: "),
            "{words}: {said}"
        );
    }
}

#[test]
fn a_run_in_place_of_a_world_is_answered_with_its_world() {
    let dir = scratch();
    let run = dir.path().join("run");
    std::fs::create_dir(&run).expect("made");
    std::fs::write(run.join("world.ron"), "").expect("written");
    for verb in ["check", "train"] {
        let output = run_with(dir.path(), &[], &[verb, "run"]);
        let said = stderr(&output);
        assert_eq!(code(&output), 2, "{said}");
        assert!(
            said.contains("`run` is a run") && said.contains("`run/world.ron`"),
            "{said}"
        );
    }
}

#[test]
fn a_kept_file_that_is_cut_off_is_damaged() {
    let dir = scratch();
    let kept = root().join("tests/regressions/acc-nominal-0001.ron");
    let text = std::fs::read_to_string(kept).expect("kept");
    for length in [text.len() / 2, 60, 5, 0] {
        std::fs::write(dir.path().join("cut.ron"), &text[..length]).expect("written");
        let output = run_with(dir.path(), &[], &["replay", "cut.ron"]);
        let said = stderr(&output);
        assert_eq!(code(&output), 3, "{length}: {said}");
        assert!(said.contains("cut off"), "{length}: {said}");
    }
    std::fs::write(dir.path().join("cut.ron"), "(name: 3)").expect("written");
    let output = run_with(dir.path(), &[], &["replay", "cut.ron"]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
}

#[test]
fn a_number_of_many_digits_is_shortened_beside_its_range() {
    let digits = "9".repeat(300);
    let shown = format!("'{}…'", "9".repeat(40));
    for (option, range) in [
        ("--seed", "from 0 to 18446744073709551615"),
        ("--starts", "from 1 to 10000000"),
        ("--jobs", "from 1 to 1024"),
    ] {
        let words = ["search", "acc", option, &digits];
        let output = run_with(root(), &[("COLUMNS", "200")], &words);
        let said = stderr(&output);
        assert_eq!(code(&output), 2, "{option}: {said}");
        for part in [&*shown, option, range] {
            assert!(said.contains(part), "{option}, `{part}`: {said}");
        }
    }
}
