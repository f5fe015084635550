//! Every verb answers first: the verdict in its first lines, few lines, no empty column.

use std::process::Output;

use super::campaign::SMALL;
use super::log::recording;
use super::{brakecheck, brakecheck_in, code, path, root, scratch, small_run, stderr};

/// Most lines of an answer on a terminal of 100 columns.
const MOST_LINES: usize = 25;
const WIDTH: usize = 100;

/// Verbs that answer in messages of a protocol, on a page, or with a whole text or list.
///
/// `harden` trains, so its answer is tested where it runs anyway.
const WITHOUT_ANSWER: [&str; 8] = [
    "completions",
    "drive",
    "harden",
    "lsp",
    "man",
    "reference",
    "serve",
    "worlds",
];

/// Lines of a terminal, into which long lines are wrapped.
fn lines(text: &str) -> usize {
    let lines = text
        .lines()
        .map(|line| line.chars().count().div_ceil(WIDTH));
    lines.map(|rows| rows.max(1)).sum()
}

/// Returns a problem of an answer, or `None`.
fn problem(stdout: &str, stderr: &str, verdict: &str) -> Option<String> {
    let first = |text: &str| text.lines().take(3).any(|line| line.contains(verdict));
    if !first(stdout) && !first(stderr) {
        return Some(format!("`{verdict}` is not in the first three lines"));
    }
    let lines = lines(stdout) + lines(stderr);
    if lines > MOST_LINES {
        return Some(format!("{lines} lines"));
    }
    empty_column(stdout).map(|column| format!("column {column} has dashes only"))
}

/// Returns the number of a column of dashes in a table with rows, if there is one.
fn empty_column(text: &str) -> Option<usize> {
    let mut tables: Vec<Vec<Vec<&str>>> = Vec::new();
    for line in text.lines() {
        if line.starts_with('╞') {
            tables.push(Vec::new());
        } else if line.starts_with('│')
            && let Some(rows) = tables.last_mut()
        {
            let cells = line.trim_matches('│').split('┆').map(str::trim);
            rows.push(cells.collect());
        }
    }
    let tables = tables.iter().filter(|rows| !rows.is_empty());
    tables.into_iter().find_map(|rows| {
        let is_dash = |column: &usize| rows.iter().all(|row| matches!(row[*column], "–" | ""));
        (0..rows[0].len()).find(is_dash)
    })
}

#[track_caller]
pub(super) fn answers(output: &Output, args: &[&str], verdict: &str) {
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    let said = stderr(output);
    if let Some(problem) = problem(&stdout, &said, verdict) {
        panic!("{args:?}: {problem}\n--- stdout\n{stdout}\n--- stderr\n{said}");
    }
}

#[test]
fn a_late_verdict_a_long_answer_and_an_empty_column_are_found() {
    let table = "it fails\n│ ado ┆ recall │\n╞══╪══╡\n│ hold ┆ – │\n│ trained ┆ 1 │\n";
    assert_eq!(problem(table, "", "it fails"), None);
    let late = format!("\n\n\n{table}");
    assert!(problem(&late, "", "it fails").is_some());
    assert_eq!(problem(&late, "it fails", "it fails"), None);
    let empty = table.replace("┆ 1 ", "┆ – ");
    let said = problem(&empty, "", "it fails").expect("a column");
    assert_eq!(said, "column 1 has dashes only");
    let long = format!("it fails {}", "x".repeat(2500));
    assert_eq!(problem(&long, "", "it fails").as_deref(), Some("26 lines"));
}

/// A new verb is missing here until it has a case.
#[test]
fn every_verb_answers_first_and_in_few_lines() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let scratch = |name: &str| path(&dir, name);
    let write = |name: &str, text: &str| {
        std::fs::write(dir.path().join(name), text).expect("written");
        scratch(name)
    };
    let harder = write("harder.ron", "Change(ego: (max_brake_mps2: 7.2))");
    let trace = write("trace.csv", "time,gap\n0,2\n0.1,3\n0.2,-4\n");
    let tracks = write("tracks.csv", &recording());
    let campaign = write("campaign.ron", SMALL);
    let [new, kept, plan, svg, scenarios, page] =
        ["new", "kept", "plan", "crash.svg", "scenarios", "page.html"].map(scratch);
    let crash = "tests/regressions/acc-nominal-0001.ron";
    let short = ["--plant", "kinematic", "--starts", "8"];
    let cases: Vec<(Vec<&str>, &str)> = vec![
        (vec!["new", "mine"], "mine.ron"),
        (vec!["check", "acc"], "`acc` is valid: "),
        (vec!["check", "sandwich"], "`sandwich` is valid: "),
        (
            [
                &["train", "acc", "-o", &new, "--decisions", "2k"][..],
                &short,
            ]
            .concat(),
            "`nominal` fails from ",
        ),
        (
            vec!["eval", &run, "--starts", "20"],
            "`nominal` fails from ",
        ),
        (
            vec![
                "eval", &run, "--starts", "12", "--ado", "hold", "--ado", "trained", "--search",
                "1",
            ],
            "`nominal` fails from ",
        ),
        (
            vec!["eval", &run, "--starts", "4", "--ego", "all"],
            " egos fail, ",
        ),
        (
            [&["eval", "acc"][..], &short].concat(),
            "`nominal` fails from ",
        ),
        (vec!["eval", "ncap/cpna"], " points passed, "),
        (
            vec![
                "gate",
                &run,
                "--starts",
                "30",
                "--ego",
                "nominal",
                "--baseline-ego",
                &harder,
            ],
            "gate ",
        ),
        (
            vec![
                "sweep",
                &run,
                "--starts",
                "12",
                "--over",
                "ego.time_gap_s=0.3..2.7:4",
            ],
            "fail",
        ),
        (
            [&["search", "acc", "--keep", &kept][..], &short].concat(),
            "`nominal` fails from ",
        ),
        (
            vec![
                "risk",
                "acc",
                "--traffic",
                "examples/traffic/acc.ron",
                "--plant",
                "kinematic",
                "--budget",
                "1k",
                "--natural-runs",
                "600",
            ],
            "`nominal` fails in ",
        ),
        (vec!["coverage", &run, "--starts", "20"], "`acc`: "),
        (
            vec!["coverage", "tests/regressions"],
            "no gap found in 12 worlds",
        ),
        (vec!["coverage", crash], "`acc`: "),
        (vec!["replay", "tests/regressions"], " still fail, "),
        (vec!["replay", crash], "1 of 1 still fail, "),
        (
            vec!["replay", crash, "--ego", "wet road"],
            "1 of 1 still fail, ",
        ),
        (
            vec!["stl", "always (gap > 0)", "--trace", &trace],
            "violated, ",
        ),
        (vec!["stl", "motorway", "--log", &tracks], "tracks.csv"),
        (vec!["log", &tracks], "2 road users"),
        (
            vec![
                "report",
                &run,
                "-o",
                &page,
                "--starts",
                "20",
                "--reuse-starts",
                "2",
            ],
            "`nominal` fails from ",
        ),
        (
            vec!["report", "tests/regressions", "-o", &page],
            " still fail, ",
        ),
        (
            vec!["campaign", "plan", &campaign, "-o", &plan],
            " pieces, ",
        ),
        (vec!["campaign", "run", &plan], " pieces are there"),
        (vec!["campaign", "merge", &plan], "fail"),
        (vec!["coverage", &plan], "`acc`: "),
        (vec!["view", crash, "-o", &svg], "crash.svg"),
        (vec!["export", crash, "-o", &scenarios], "acc-nominal-0001"),
    ];
    let help = brakecheck(&["--help"]);
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    let (verbs, _) = help.split_once("\nOptions:").expect("options");
    let verbs = verbs.lines().filter_map(|line| line.strip_prefix("  "));
    let verbs: Vec<&str> = verbs.filter_map(|line| line.split(' ').next()).collect();
    assert!(verbs.len() > WITHOUT_ANSWER.len(), "{help}");
    for verb in verbs.into_iter().filter(|verb| *verb != "help") {
        let is_tested = cases.iter().any(|(args, _)| args[0] == verb);
        let is_exempt = WITHOUT_ANSWER.contains(&verb);
        assert!(is_tested != is_exempt, "`{verb}` requires a case here");
    }
    for (args, verdict) in &cases {
        // A new world is written where the program is called.
        let place = if args[0] == "new" { dir.path() } else { root() };
        answers(&brakecheck_in(place, args), args, verdict);
    }
}
