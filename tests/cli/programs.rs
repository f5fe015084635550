//! Crashes of programs: minimized, labelled and persistent, as those of stock
//! egos are.

use brakecheck::crashes::Regressions;
use brakecheck::run_dir::{About, NotAsked};

use super::{brakecheck, code, path, scratch, stderr};

/// Follows at 1.2 s, but within 12 m it hardly brakes: a bug.
const BLIND: &str = r#"
import json, sys
def follow(step):
    own = step["own"]
    ahead = [o for o in step["others"] if o["headway_m"] > 0.0 and abs(o["lateral_m"]) < 2.0]
    if not ahead:
        return 0.0
    lead = min(ahead, key=lambda o: o["headway_m"])
    wish = lead["length_m"] + 2.0 + 1.2 * own["speed_mps"]
    accel = 0.25 * (lead["headway_m"] - wish) + lead["speed_mps"] - own["speed_mps"]
    if lead["headway_m"] - lead["length_m"] < 12.0:
        accel = max(accel, -1.0)
    return max(-7.0, min(2.0, accel))
for line in sys.stdin:
    message = json.loads(line)
    if "hello" in message:
        answer = {"hello": {"protocol": 1, "name": "blind"}}
    elif "reset" in message:
        answer = {"id": message["id"], "ready": True}
    elif "step" in message:
        answer = {"id": message["id"], "accel_mps2": follow(message["step"])}
    else:
        break
    print(json.dumps(answer), flush=True)
"#;

/// Keeps what a random search finds against the program; what was said.
fn kept(dir: &tempfile::TempDir, name: &str, settings: &str) -> (Vec<About>, String) {
    let program = path(dir, "blind.py");
    std::fs::write(&program, BLIND).expect("written");
    // Machines are busy: a start of Python may take its time.
    let ego = path(dir, "blind.ron");
    let change = format!(
        "Change(controller: Some(Process(command: [\"python3\", {program:?}], timeout_s: 60.0)))"
    );
    std::fs::write(&ego, change).expect("written");
    let directory = path(dir, name);
    let keep = format!("{directory},most=2{settings}");
    let search = brakecheck(&[
        "search",
        "acc",
        "--plant",
        "kinematic",
        "--method",
        "hold",
        "--budget",
        "20",
        "--starts",
        "6",
        "--seed",
        "2",
        "--ego",
        &ego,
        "--allow-programs",
        "--keep",
        &keep,
    ]);
    assert_eq!(code(&search), 0, "{}", stderr(&search));
    let read = Regressions::load(&directory).expect("kept files");
    read.reproduce().unwrap_or_else(|error| panic!("{error}"));
    let files = read.kept().iter();
    let about = files.map(|it| it.counterexample.about.clone().expect("labelled"));
    (about.collect(), stderr(&search))
}

#[test]
fn the_crash_of_a_program_is_minimized_labelled_and_persistent() {
    let dir = scratch();
    let (all, said) = kept(&dir, "kept", "");
    assert!(said.contains("minimized and labelled with"), "{said}");
    // The one program is named once, with its cost.
    assert_eq!(said.matches("blind.py` gave ").count(), 1, "{said}");
    assert!(!all.is_empty());
    for about in &all {
        let shrunk = about.shrunk.expect("asked");
        assert!(!shrunk.before.is_less_than(&shrunk.after));
        assert!(about.persistence.as_ref().expect("varied").variations.len() == 11);
        let why = about.why.as_ref().expect("explained");
        assert_eq!(why.not_asked, None);
        assert!(why.last_chance.is_some());
        let runs = about.ego_runs.as_ref().expect("counted");
        // One to compare, eleven variations, and whatever else was asked.
        assert!(runs.runs > 13 && runs.runs <= 300, "{runs}");
        assert_eq!(runs.ended, None);
    }
    assert!(
        all.iter()
            .any(|it| it.why.as_ref().is_some_and(|why| why.decisive.is_some()))
    );
}

#[test]
fn the_limit_of_runs_holds_and_is_said() {
    let dir = scratch();
    let (all, said) = kept(&dir, "kept", ",runs=16");
    assert!(said.contains("the limit of 16 runs"), "{said}");
    for about in &all {
        let runs = about.ego_runs.as_ref().expect("counted");
        assert!(runs.runs <= 16, "{runs}");
        assert_eq!(runs.ended, Some(NotAsked::RunLimit { runs: 16 }));
        assert!(about.persistence.is_some(), "variations come first");
    }
}
