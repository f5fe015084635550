//! Replays against another ego: it still fails, is fixed, or there is no answer.

use std::path::Path;

use brakecheck::crashes::{RegressionError, Regressions, ReplayOutcome};
use serde_json::{Value, json};

use super::junit::cases;
use super::{brakecheck, code, json as json_of, path, root, scratch, stderr};

/// An ego that drives on, whatever is ahead.
const COAST: &str = "Change(controller: Coast(accel_mps2: 0.0, lag_s: 0.0))";

/// Against an ego that drives on, one car breaks its rule in this file.
const NO_ANSWER: &str = "sandwich-nominal-0000";

/// A directory with some kept counterexamples of the crate, and the file of the ego.
pub(super) fn keep(names: &[&str]) -> (tempfile::TempDir, String, String) {
    let dir = scratch();
    let kept = dir.path().join("kept");
    std::fs::create_dir(&kept).expect("made");
    for name in names {
        for extension in ["ron", "csv"] {
            let file = format!("{name}.{extension}");
            let from = root().join("tests/regressions").join(&file);
            std::fs::copy(from, kept.join(&file)).expect("copied");
        }
    }
    let ego = path(&dir, "coast.ron");
    std::fs::write(&ego, COAST).expect("written");
    (dir, kept.display().to_string(), ego)
}

#[test]
fn a_replay_that_ends_in_a_broken_rule_is_no_answer_and_never_fixed() {
    let names = [NO_ANSWER, "sandwich-nominal-0001", "light_ado-nominal-0000"];
    let (dir, kept, ego) = keep(&names);
    let junit = path(&dir, "replays.xml");
    let asked = ["replay", &kept, "--ego", &ego];
    let output = brakecheck(&[&asked[..], &["--junit", &junit, "--json"]].concat());
    assert_eq!(code(&output), 1, "{}", stderr(&output));
    let found = json_of(&output);
    assert_eq!(
        found["in_all"],
        json!({"replayed": 3, "still_fail": 1, "fixed": 1, "uncounted": 0, "no_answer": 1,
               "invalid": 0})
    );
    let row = |name: &str| -> Value {
        let mut rows = found["rows"].as_array().expect("rows").iter();
        let is_of = |row: &&Value| row["file"].as_str().expect("a file").contains(name);
        rows.find(is_of).expect(name).clone()
    };
    let open = row(NO_ANSWER);
    assert_eq!(open["outcome"], "no_answer");
    let why = &open["no_answer"];
    assert!(why["ado"].is_string() && why["rule"].is_string());
    assert!(why["time_s"].as_f64().expect("a time") > 0.0);
    assert_eq!(row("light_ado")["outcome"], "fixed");
    assert_eq!(row("light_ado")["no_answer"], Value::Null);
    assert_eq!(row("sandwich-nominal-0001")["outcome"], "still_fails");

    let rule = why["rule"].as_str().expect("a rule");
    let cases = cases(&junit);
    let [open, failed, passed] = [NO_ANSWER, names[1], names[2]].map(|name| &cases[name]);
    assert!(open.starts_with("skipped") && open.contains(rule), "{open}");
    assert!(failed.starts_with("failed"), "{failed}");
    assert_eq!(passed, "passed");

    let text = String::from_utf8_lossy(&brakecheck(&asked).stdout).into_owned();
    let first = text.lines().next().expect("a line");
    assert_eq!(first, "1 of 3 still fail, 1 fixed, 1 without an answer");
    assert!(
        text.contains(&format!(
            "no answer, because {} broke `{rule}` at",
            why["ado"].as_str().expect("a name")
        )),
        "{text}"
    );
}

#[test]
fn replays_that_answer_nothing_do_not_pass() {
    let (dir, kept, ego) = keep(&[NO_ANSWER]);
    let output = brakecheck(&["replay", &kept, "--ego", &ego]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    let message = stderr(&output);
    assert!(
        message.contains("no replay gives an answer") && message.contains("broke"),
        "{message}"
    );
    let page = path(&dir, "page.html");
    let output = brakecheck(&["report", &kept, "-o", &page, "--ego", &ego]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(Path::new(&page).is_file());
    // With one answer more they do, and say how many are open.
    let (_dir, kept, ego) = keep(&[NO_ANSWER, "light_ado-nominal-0000"]);
    let output = brakecheck(&["replay", &kept, "--ego", &ego]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(!stderr(&output).contains("missing samples"));
    // A file that lost its samples is named.
    std::fs::remove_file(Path::new(&kept).join(format!("{NO_ANSWER}.csv"))).expect("removed");
    let output = brakecheck(&["replay", &kept, "--ego", &ego]);
    let message = stderr(&output);
    assert!(
        message.contains("missing samples of 1 of 2 files"),
        "{message}"
    );
}

#[test]
fn the_library_counts_replays_without_an_answer() {
    let load = |kept: &str, ego: &str| {
        let kept = Regressions::load(Path::new(kept)).expect("kept");
        kept.against(Some(ego), &[]).expect("an ego")
    };
    let (_dir, kept, ego) = keep(&[NO_ANSWER]);
    let open = load(&kept, &ego);
    let replayed = open.replay().expect("replayed");
    assert_eq!(replayed[0].outcome(), ReplayOutcome::NoAnswer);
    assert!(!replayed[0].still_fails());
    let error = open.pass().expect_err("no answer");
    let RegressionError::NoAnswer { broken, total } = &error else {
        panic!("{error}");
    };
    assert_eq!((broken.len(), *total), (1, 1));
    assert!(broken[0].contains("broke"), "{error}");
    let (_dir, kept, ego) = keep(&[NO_ANSWER, "light_ado-nominal-0000"]);
    let counts = load(&kept, &ego).pass().expect("one answer");
    assert_eq!((counts.fixed, counts.no_answer, counts.replayed), (1, 1, 2));
}
