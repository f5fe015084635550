//! Coverage of runs, campaigns and kept crashes, and what is not known.

use serde_json::Value;

use super::campaign::{SMALL, plan, run as run_campaign};
use super::replayed::keep;
use super::{brakecheck, code, json, path, refused, scratch, small_run, stderr};

/// Coverage of the only world.
#[track_caller]
fn only(args: &[&str]) -> Value {
    let output = brakecheck(&[&["coverage"], args, &["--json"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let object = json(&output);
    let worlds = object["coverage"].as_array().expect("worlds");
    assert_eq!(worlds.len(), 1, "{object}");
    worlds[0].clone()
}

fn count(object: &Value) -> u64 {
    object.as_u64().expect("a number")
}

#[test]
fn the_coverage_of_a_run_counts_its_tries_and_stored_failures() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let covered = only(&[&run, "--starts", "60"]);
    // Starts from which the ego fails by itself are no tries.
    let rows = json(&brakecheck(&["eval", &run, "--starts", "60", "--json"]));
    let row = &rows["rows"][0];
    assert_eq!(covered["tries"], row["starts"]);
    assert_eq!(covered["failing_tries"], row["successes"]);
    assert!(count(&covered["stored"]) > 0, "{covered}");
    let failures = count(&covered["failing_tries"]) + count(&covered["stored"]);
    let parts = covered["parts"].as_array().expect("parts");
    assert_eq!(parts.len(), 1, "one leaf");
    assert_eq!(count(&parts[0]["decides"]), failures);
    assert_eq!(parts[0]["state"], "covered");
    for rule in covered["rules"].as_array().expect("rules") {
        assert_eq!(rule["others_tried"], rule["episodes"]);
        assert!(count(&rule["episodes"]) > 59, "{rule}");
    }
    // Every failure is in one bin of each axis.
    for axis in ["ego.speed", "ado.headway", "ado.speed"] {
        let cells = covered["cells"].as_array().expect("cells");
        let own = cells.iter().filter(|cell| cell["axis"] == axis);
        let sum: u64 = own
            .map(|cell| count(&cell["failures"]) + count(&cell["stored"]))
            .sum();
        assert_eq!(sum, failures, "{axis}");
    }
    // Another number of threads gives the same bytes.
    let args = ["coverage", &run, "--starts", "60", "--json"];
    let one = brakecheck(&[&args[..], &["--jobs", "1"]].concat());
    let three = brakecheck(&[&args[..], &["--jobs", "3"]].concat());
    assert_eq!(one.stdout, three.stdout);
}

#[test]
fn kept_crashes_are_no_tries_and_too_few_for_a_claim() {
    let (_dir, kept, _) = keep(&["acc-nominal-0001"]);
    let covered = only(&[&kept]);
    assert_eq!(count(&covered["tries"]), 0);
    assert_eq!(count(&covered["stored"]), 1);
    assert_eq!(covered["gaps"].as_array().map(Vec::len), Some(0));
    assert!(covered["all_kinds"].is_null());
    let states = |list: &str| -> Vec<String> {
        let items = covered[list].as_array().expect("a list").iter();
        items
            .map(|it| it["state"].as_str().expect("a state").to_owned())
            .collect()
    };
    let cells = states("cells");
    assert!(
        cells
            .iter()
            .all(|state| state == "covered" || state == "untried"),
        "{cells:?}"
    );
    assert!(cells.contains(&"untried".to_owned()), "{cells:?}");
    let rules = states("rules");
    assert!(rules.iter().all(|state| state != "never"), "{rules:?}");
}

#[test]
fn a_campaign_is_covered_by_its_finished_pieces() {
    let dir = scratch();
    let planned = plan(&dir, "small", SMALL, "0.2");
    let output = brakecheck(&["coverage", &planned]);
    assert_eq!(code(&output), 3, "nothing was played");
    assert!(
        stderr(&output).contains("no episode was evaluated"),
        "{}",
        stderr(&output)
    );
    run_campaign(&planned);
    let covered = only(&[&planned]);
    // Several ados and egos try a start, which is one unit.
    assert!(
        count(&covered["tries"]) > count(&covered["starts"]),
        "{covered}"
    );
    assert!(count(&covered["starts"]) <= 40);
    assert!(count(&covered["failing_tries"]) > 0);
}

#[test]
fn a_world_and_a_missing_path_are_refused() {
    refused(&["coverage", "acc"], "`acc` is a world");
    let dir = scratch();
    refused(&["coverage", &path(&dir, "nowhere")], "there is no `");
}
