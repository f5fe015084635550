//! Colours, widths, how much is printed, and where defaults come from.

use super::program::{code, run_with, scratch, stderr};
use super::root;

const ESCAPE: char = '\u{1b}';

/// Variables of the environment, options, and whether the output has colours.
type ColourCase<'a> = (&'a [(&'a str, &'a str)], &'a [&'a str], bool);

#[test]
fn colours_follow_the_option_then_the_variables_then_the_terminal() {
    let cases: [ColourCase<'_>; 9] = [
        (&[], &[], false),
        (&[], &["--color", "always"], true),
        (&[("NO_COLOR", "1")], &["--color=always"], true),
        (&[("CLICOLOR_FORCE", "1")], &[], true),
        (&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")], &[], false),
        (&[("CLICOLOR_FORCE", "1")], &["--color", "never"], false),
        (&[("BRAKECHECK_COLOR", "always")], &[], true),
        (
            &[("BRAKECHECK_COLOR", "never"), ("CLICOLOR_FORCE", "1")],
            &[],
            false,
        ),
        (
            &[("BRAKECHECK_COLOR", "always")],
            &["--color", "auto"],
            false,
        ),
    ];
    // An error of this program, one of the command line, and a help.
    for words in [&["check", "none.ron"][..], &["check", "--nonsense"]] {
        for (variables, options, is_coloured) in cases {
            let output = run_with(root(), variables, &[words, options].concat());
            assert_eq!(code(&output), 2);
            let said = stderr(&output);
            assert_eq!(
                said.contains(ESCAPE),
                is_coloured,
                "{variables:?} {options:?}: {said}"
            );
        }
    }
    for (variables, options, is_coloured) in cases {
        let output = run_with(root(), variables, &[&["check", "--help"], options].concat());
        let help = String::from_utf8_lossy(&output.stdout);
        assert_eq!(
            help.contains(ESCAPE),
            is_coloured,
            "{variables:?} {options:?}: {help}"
        );
    }
}

#[test]
fn tables_and_messages_are_as_wide_as_the_terminal() {
    let widest = |text: &str| text.lines().map(|line| line.chars().count()).max();
    let printed = |columns: &str, args: &[&str]| {
        let output = run_with(root(), &[("COLUMNS", columns)], args);
        let text = [output.stdout, output.stderr].concat();
        String::from_utf8(text).expect("text")
    };
    let search = "search acc --plant kinematic --method hold --starts 3 --budget 1";
    let search: Vec<&str> = search.split(' ').collect();
    let is_table = |line: &&str| line.starts_with(['┌', '│', '╞', '└']);
    let table = |columns: &str, args: &[&str]| {
        let text = printed(columns, args);
        let lines: Vec<&str> = text.lines().filter(is_table).collect();
        assert!(!lines.is_empty(), "{text}");
        widest(&lines.join("\n"))
    };
    for args in [&["check", "acc", "--details"][..], &search] {
        for (columns, most) in [("60", 60), ("80", 80), ("40", 60), ("nonsense", 100)] {
            let found = table(columns, args);
            assert!(
                found <= Some(most),
                "{args:?}, {columns} columns: {found:?}"
            );
        }
    }
    assert!(table("150", &["check", "acc", "--details"]) > Some(100));
    let error = printed("60", &["replay", "worlds/acc.ron"]);
    assert!(widest(&error) <= Some(60), "{error}");
    assert!(widest(&printed("100", &["replay", "worlds/acc.ron"])) > Some(60));
}

#[test]
fn quiet_leaves_the_answer_and_errors() {
    let quiet = run_with(root(), &[], &["check", "acc", "-q"]);
    let said = String::from_utf8_lossy(&quiet.stdout);
    assert!(
        said.starts_with("`acc` is valid: ") && said.lines().count() == 2,
        "{said}"
    );
    let search = "-q search acc --plant kinematic --method hold --starts 2 --budget 1";
    let output = run_with(root(), &[], &search.split(' ').collect::<Vec<_>>());
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
    assert!(!output.stdout.is_empty());
    let output = run_with(root(), &[], &["check", "none.ron", "--quiet"]);
    assert_eq!(code(&output), 2);
    assert!(
        stderr(&output).contains("cannot read `none.ron`"),
        "{}",
        stderr(&output)
    );
    let both = run_with(root(), &[], &["check", "acc", "-q", "-v"]);
    assert_eq!(code(&both), 2);
}

#[test]
fn defaults_come_from_the_option_then_the_variable_then_the_file() {
    let dir = scratch();
    let inner = dir.path().join("inner");
    std::fs::create_dir_all(dir.path().join(".git")).expect("made");
    std::fs::create_dir(&inner).expect("made");
    let file = dir.path().join("brakecheck.toml");
    std::fs::write(&file, "jobs = 1\nplant = \"kinematic\"\n").expect("written");
    let search = "search acc --method hold --starts 2 --budget 1 --json -v";
    let search: Vec<&str> = search.split(' ').collect();
    let played = |variables: &[(&str, &str)], options: &[&str]| {
        let output = run_with(&inner, variables, &[&search, options].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let plant = super::json(&output)["rows"][0]["plant"].clone();
        (plant.as_str().expect("a plant").to_owned(), stderr(&output))
    };
    let (plant, said) = played(&[], &[]);
    assert_eq!(plant, "Kinematic");
    assert!(said.contains("`--plant kinematic` is from `"), "{said}");
    assert!(
        said.contains("brakecheck.toml`") && said.contains("`--jobs 1`"),
        "{said}"
    );
    assert!(said.contains("took "), "{said}");
    let (plant, said) = played(&[("BRAKECHECK_PLANT", "rigid")], &[]);
    assert_eq!(plant, "Rigid");
    assert!(said.contains("is from BRAKECHECK_PLANT"), "{said}");
    let (plant, said) = played(&[("BRAKECHECK_PLANT", "rigid")], &["--plant", "kinematic"]);
    assert_eq!(plant, "Kinematic");
    assert!(!said.contains("--plant"), "{said}");
    // A grid has no plants, and a default does not hold there.
    let grid = run_with(&inner, &[], &["search", "grid", "--starts", "2", "--json"]);
    assert_eq!(code(&grid), 0, "{}", stderr(&grid));
    let typed = ["search", "grid", "--starts", "2", "--plant", "rigid"];
    assert_eq!(code(&run_with(&inner, &[], &typed)), 2);
    let wrong = run_with(&inner, &[("BRAKECHECK_JOBS", "0")], &search);
    assert_eq!(code(&wrong), 2);
    assert!(
        stderr(&wrong).contains("BRAKECHECK_JOBS"),
        "{}",
        stderr(&wrong)
    );
}

#[test]
fn no_file_consents_to_start_programs() {
    let dir = scratch();
    let file = dir.path().join("brakecheck.toml");
    for (text, place, says) in [
        ("\nallow_programs = true", ":2:1", "must not consent"),
        ("job = 3", ":1:1", "did you mean `jobs`?"),
        ("jobs = 0", ":1:8", "from 1 to 1024"),
    ] {
        std::fs::write(&file, text).expect("written");
        let output = run_with(dir.path(), &[], &["check", "acc"]);
        assert_eq!(code(&output), 2, "{text}");
        let said = stderr(&output);
        for part in [place, says, "help: "] {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
}
