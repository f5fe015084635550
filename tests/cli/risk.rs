//! Risks: what is refused, what is stored, and what a risk is said to be.

use std::path::{Path, PathBuf};

use super::{brakecheck, code, json, path, refusal, refused, scratch, small_run, stderr};

/// Few runs, which are too few for a result.
const FEW: [&str; 8] = [
    "risk",
    "acc",
    "--traffic",
    "examples/traffic/acc.ron",
    "--plant",
    "kinematic",
    "--budget",
    "1000",
];

fn few<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&FEW[..], &["--natural-runs", "600"], more].concat()
}

#[test]
fn a_risk_that_is_no_result_is_said_with_its_bound_and_exits_with_3() {
    let output = brakecheck(&few(&[]));
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout);
    let said = "in traffic “example by hand, not measured”, on the kinematic plant, in runs of \
                15 s, `nominal` fails in at most ";
    assert!(text.contains("nominal: no result"), "{text}");
    assert!(text.contains(said), "{text}");
    assert!(stderr(&output).contains("no result for `nominal`"));
    let found = json(&brakecheck(&few(&["--json"])));
    let ego = &found["egos"][0];
    assert!(ego["fails"].is_null() && ego["between"].is_null());
    assert_eq!(
        (&ego["invalid"], &found["counts"]),
        (&0.into(), &"Violation".into())
    );
    assert!(ego["runs"].as_u64() >= Some(600), "{ego}");
    let [least, most] = [0, 1].map(|end| ego["limits"]["fails"][end].as_f64());
    assert!(least == Some(0.0) && most > Some(0.001), "{ego}");
}

#[test]
fn questions_that_no_risk_answers_are_refused() {
    refused(&["risk", "acc"], "`acc` declares no traffic");
    refused(&few(&["--ego", "all"]), "`--ego all` is more than one ego");
    refused(
        &few(&["--baseline-ego", "all"]),
        "`--baseline-ego all` is more than one ego",
    );
    refused(
        &few(&["--baseline-ego", "nominal"]),
        "`nominal` is compared with itself",
    );
    let dir = scratch();
    let empty = path(&dir, "none");
    std::fs::create_dir(&empty).expect("made");
    refused(&few(&["--known", &empty]), "has no counterexample of `acc`");
    // Kept in another world.
    let other = "tests/regressions/merge-nominal-0000.ron";
    refused(&few(&["--known", other]), "has no counterexample of `acc`");
    refused(&["risk", "grid", "--traffic", "motorway"], "is a grid");
}

#[test]
fn known_counterexamples_are_played_and_judged_by_the_traffic() {
    let kept = "tests/regressions/acc-nominal-0001.ron";
    let found = json(&brakecheck(&few(&["--known", kept, "--json"])));
    let ego = &found["egos"][0];
    // It is known to fail, so it is a probe, or the traffic cannot produce it.
    let probes = ego["checks"]["probes"][1].as_u64().expect("a number");
    let impossible = ego["impossible"].as_u64().expect("a number");
    assert!(probes + impossible >= 1, "{ego}");
}

/// Counterexamples of a training are known failures of its own world only.
#[test]
fn counterexamples_of_a_training_are_used_in_its_own_world_alone() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let found = json(&brakecheck(&few(&["--run", &run, "--json"])));
    let ego = &found["egos"][0];
    let probes = ego["checks"]["probes"][1].as_u64().expect("a number");
    let impossible = ego["impossible"].as_u64().expect("a number");
    assert!(probes + impossible >= 1, "{ego}");
    // One more action.
    let text = std::fs::read_to_string("worlds/acc.ron").expect("shipped");
    let other = path(&dir, "other.ron");
    let set = "[-3.0, 0.0, 3.0]";
    assert!(text.contains(set));
    std::fs::write(&other, text.replace(set, "[-3.0, 0.0, 3.0, 1.0]")).expect("written");
    let traffic = std::fs::read_to_string("examples/traffic/acc.ron")
        .expect("there")
        .replace("[0.6, 0.9, 0.6]", "[0.6, 0.9, 0.6, 0.5]")
        .replace("[0.0, 1.0, 0.3]", "[0.0, 1.0, 0.3, 0.1]");
    let laws = path(&dir, "laws.ron");
    std::fs::write(&laws, traffic).expect("written");
    let plant = ["--plant", "kinematic", "--budget", "1000", "--run", &run];
    let asked = [&["risk", &other, "--traffic", &laws][..], &plant].concat();
    refused(&asked, "other starts or actions");
}

fn pieces(dir: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(dir).expect("a directory").flatten();
    let mut files: Vec<PathBuf> = entries.map(|it| it.path()).collect();
    files.retain(|it| it.extension().is_some_and(|it| it == "runs"));
    files.sort();
    files
}

#[test]
fn stored_runs_are_used_by_their_own_request_alone() {
    let dir = scratch();
    let [own, other] = ["own", "other"].map(|name| path(&dir, name));
    let with = |seed: &str, dir: &str| brakecheck(&few(&["--seed", seed, "-o", dir, "--json"]));
    let first = with("1", &own);
    assert_eq!(code(&first), 3, "{}", stderr(&first));
    assert_eq!(with("1", &own).stdout, first.stdout);
    // Another seed, in the same directory and with a file of it.
    refusal(&with("2", &own), "has runs of another risk");
    assert_eq!(code(&with("2", &other)), 3);
    let (kept, foreign) = (pieces(&own), pieces(&other));
    assert!(kept.len() >= 2 && foreign.len() >= 2, "{kept:?}");
    std::fs::copy(&foreign[0], &kept[0]).expect("copied");
    let said = refusal(&with("1", &own), "has other runs than its name says");
    let name = kept[0]
        .file_name()
        .expect("a name")
        .to_string_lossy()
        .into_owned();
    assert!(
        said.contains(&name) && said.contains("seed: 2, expected 1"),
        "{said}"
    );
    assert!(said.contains("delete the file"), "{said}");
    // A piece of the same request under another's name.
    std::fs::copy(&kept[1], &kept[0]).expect("copied");
    refusal(&with("1", &own), "first run: 500, expected 0");
    std::fs::remove_file(&kept[0]).expect("removed");
    assert_eq!(with("1", &own).stdout, first.stdout);
    // Runs whose request is gone are nobody's.
    std::fs::remove_file(Path::new(&own).join("request.sha256")).expect("removed");
    let said = refusal(&with("1", &own), "has no `request.sha256`");
    assert!(said.contains("empty or a new directory"), "{said}");
}
