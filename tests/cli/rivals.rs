//! What a trained ado has to beat, from the command line.

use serde_json::Value;

use super::{brakecheck, code, json, path, refused, scratch, small_run, stderr};

fn words(rows: &Value) -> Vec<&str> {
    let rows = rows["rows"].as_array().expect("rows").iter();
    rows.map(|row| row["ado"].as_str().expect("a word"))
        .collect()
}

#[test]
fn a_run_stands_beside_searches_replays_and_a_rule() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let few = ["--starts", "30", "--json"];
    let verb = |args: &[&str]| {
        let output = brakecheck(&[args, &few].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        json(&output)
    };
    // A search of a run shows its ado too, and when training has paid.
    let searched = verb(&["search", &run, "--method", "hold", "--budget", "40"]);
    assert_eq!(words(&searched), ["trained", "search"]);
    let even = &searched["break_even"][0];
    // What was looked for to judge the training is part of its cost.
    let trained = json(&trained);
    let once = [&trained["episodes"], &trained["calibration"]["simulations"]]
        .map(|part| part.as_u64().expect("a number"));
    assert_eq!(even["once"]["simulations"], once[0] + once[1]);
    assert!(even["once"]["physics_steps"].as_u64().expect("steps") > 0);
    let (starts, budget) = (even["starts"].as_f64(), even["budget"].as_u64());
    assert!(starts.expect("training pays") > 1.0, "{even}");
    assert!(budget.expect("a budget") <= 40);
    let last = even["curve"].as_array().and_then(|curve| curve.last());
    assert_eq!(last.map(|at| &at["budget"]), Some(&Value::from(40)));
    // A world alone has no ado to compare with.
    let alone = verb(&[
        "search",
        "worlds/acc.ron",
        "--method",
        "cem",
        "--budget",
        "5",
    ]);
    assert_eq!(words(&alone), ["search"]);
    assert_eq!(alone["break_even"], Value::Array(Vec::new()));
    // The counterexamples of the run itself are mutated, or of another one.
    let own = verb(&["search", &run, "--method", "mutate", "--budget", "12"]);
    let same = verb(&[
        "search",
        "worlds/acc.ron",
        "--plant",
        "kinematic",
        "--method",
        "mutate",
        "--bank",
        &run,
        "--budget",
        "12",
    ]);
    assert_eq!(own["rows"][1]["solved"], same["rows"][0]["solved"]);
    // Replays and the heuristic, in the order they were asked for.
    let rivals = verb(&["eval", &run, "--ado", "heuristic", "--ado", "replays"]);
    assert_eq!(words(&rivals), ["heuristic", "replay", "replays"]);
    let ten = &rivals["rows"][2];
    assert!(ten["sims_per_start"].as_f64().expect("a number") > 1.0);

    // What was stored and is damaged is not replayed.
    let file = std::path::Path::new(&run).join("counterexamples.jsonl");
    let text = std::fs::read_to_string(&file).expect("it is there");
    std::fs::write(&file, text.replacen("\"index\":", "\"index\":1", 1)).expect("written");
    let output = brakecheck(&["search", &run, "--method", "mutate"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("SHA-256"), "{}", stderr(&output));
    // Nor is what belongs to another world.
    std::fs::write(&file, text).expect("written");
    let foreign = ["search", "worlds/merge.ron", "--method", "mutate", "--bank"];
    refused(
        &[&foreign[..], &[&path(&dir, "run")]].concat(),
        "same world",
    );
}

/// Before anybody has trained: what a world's egos meet anyway.
#[test]
fn a_world_alone_is_evaluated_by_its_baselines_and_a_search() {
    let few = ["--plant", "kinematic", "--starts", "20"];
    let eval = |more: &[&str]| brakecheck(&[&["eval", "worlds/acc.ron"], &few[..], more].concat());
    let output = eval(&["--json", "--ego", "all"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let evaluated = json(&output);
    let rows = evaluated["rows"].as_array().expect("rows");
    assert!(
        rows.len() > 4 && rows.len().is_multiple_of(4),
        "{} rows",
        rows.len()
    );
    let first: Vec<_> = rows[..4].iter().map(|row| row["ado"].as_str()).collect();
    assert_eq!(
        first,
        ["hold", "random", "constant", "search"].map(Some),
        "{evaluated}"
    );
    assert!(
        rows[2]["recall"]
            .as_f64()
            .is_some_and(|recall| recall < 1.0)
    );
    assert_eq!(code(&eval(&["--fail-on-counterexample"])), 1);
    let refused = eval(&["--keep", "kept"]);
    assert_eq!(code(&refused), 2);
    assert!(
        stderr(&refused).contains("train an ado first"),
        "{}",
        stderr(&refused)
    );
}
