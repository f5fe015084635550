//! `eval --runs`: an ado learns an ego from some runs of it.

use super::{brakecheck, code, json, path, refused, scratch, small_run, stderr};
use serde_json::Value;

fn row<'a>(all: &'a Value, ado: &str) -> &'a Value {
    let rows = all["rows"].as_array().expect("rows");
    rows.iter().find(|row| row["ado"] == ado).expect("a row")
}

#[test]
fn an_ego_of_another_structure_is_learned_from_runs_of_it_and_remembered() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let kept = path(&dir, "kept");
    let asked = [
        "eval",
        &run,
        "--ego",
        "sporty idm",
        "--starts",
        "24",
        "--json",
    ];
    let asked = [&asked[..], &["--runs", "40", "--search", "1"]].concat();
    let keep = format!("{kept},as-found");
    let output = brakecheck(&[&asked[..], &["--keep", &keep]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let first = json(&output);

    // An ado trained against PD control knows nothing of the IDM.
    let (trained, adapted) = (row(&first, "trained"), row(&first, "adapted"));
    let solved = |row: &Value| row["successes"].as_u64().expect("successes");
    assert!(
        solved(trained) + 4 <= solved(adapted),
        "{trained} {adapted}"
    );
    assert!(Some(0.4) <= adapted["recall"].as_f64(), "{adapted}");
    assert_eq!(adapted["sims_per_start"], 1.0);
    assert_eq!(adapted["method"], "planned in a surrogate of 40 runs");
    // What it must never be below stands beside it.
    let rows = first["rows"].as_array().expect("rows");
    let held: Vec<_> = rows.iter().filter(|row| row["ado"] == "hold").collect();
    let [once, for_as_much] = held[..] else {
        panic!("{held:?}");
    };
    // 40 runs to learn from, and one for every start.
    let starts = once["starts"].as_u64().expect("starts");
    let most = (40 + starts).div_ceil(starts);
    let method = format!("at most {most} runs per start, as many as adapting takes");
    assert_eq!(for_as_much["method"], *method);
    let spent = for_as_much["sims_per_start"].as_f64().expect("runs");
    assert!(spent > 1.0 && spent <= most as f64, "{for_as_much}");
    for beside in ["constant", "switch", "replays"] {
        row(&first, beside);
    }

    // What was seen of the ego: every run is counted, half of them were planned.
    let told = &first["adapted"][0];
    assert_eq!(told["ego"], "sporty idm");
    assert_eq!((&told["runs"], &told["planned"]), (&40.into(), &20.into()));
    assert_eq!(told["as_trained"], 5);
    assert_eq!(told["acts"], "planned");
    // Some starts it plays as it learned to inside the surrogate.
    let learned_on = told["starts_trained_on"].as_u64().expect("it learns on");
    assert!((1..=starts).contains(&learned_on), "{told}");
    // It is a published model, and found to be one.
    let alike = &told["alike"][0];
    assert!(alike["controller"]["Idm"].is_object(), "{alike}");
    assert!(alike["unexplained"].as_f64() < Some(0.25), "{alike}");
    let error = &told["error"];
    let [off_m, keeping_m] = ["rms_m", "keeps_acceleration_m"].map(|key| error[key].as_f64());
    assert!(
        Some(0.0) < off_m && off_m < keeping_m.map(|m| 0.5 * m),
        "{error}"
    );
    let expected = told["expected"].as_f64().expect("a rate");
    let planned = told["planned_successes"].as_f64().expect("a count") / 20.0;
    assert_eq!(expected, planned);

    // Its counterexamples are kept as they were played, and replay.
    let replayed = brakecheck(&["replay", &kept, "--expect", "recorded"]);
    assert_eq!(code(&replayed), 0, "{}", stderr(&replayed));

    // The ego is not learned twice, and the rows are the same.
    let again = brakecheck(&asked);
    assert!(
        stderr(&again).contains("learned before"),
        "{}",
        stderr(&again)
    );
    let second = json(&again);
    assert_eq!(row(&second, "adapted")["solved"], adapted["solved"]);
    assert_eq!(second["adapted"], first["adapted"]);

    // A damaged file is said to be one, and makes no difference.
    let learned = dir.path().join("run/learned");
    let file = std::fs::read_dir(&learned)
        .expect("kept")
        .next()
        .expect("a file")
        .expect("readable")
        .path();
    let mut bytes = std::fs::read(&file).expect("readable");
    let whole = bytes.clone();
    bytes.truncate(bytes.len() - 9);
    std::fs::write(&file, bytes).expect("written");
    let anew = brakecheck(&asked);
    assert!(stderr(&anew).contains("learned anew"), "{}", stderr(&anew));
    assert_eq!(row(&json(&anew), "adapted")["solved"], adapted["solved"]);
    assert_eq!(std::fs::read(&file).expect("readable"), whole);
}

#[test]
fn what_cannot_be_learned_is_refused_with_what_can() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    for (args, says) in [
        (["eval", &run, "--runs", "3"], "takes 10 at least"),
        (
            ["eval", "worlds/acc.ron", "--runs", "100"],
            "train an ado first",
        ),
    ] {
        refused(&args, says);
    }
}
