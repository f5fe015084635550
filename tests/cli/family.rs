//! Conditional ados, identified egos and tries, as a user runs them.

use super::{brakecheck, code, json, path, scratch, stderr};

#[test]
fn a_conditional_ado_is_told_identified_true_or_nominal_parameters_and_nothing_else() {
    let dir = scratch();
    let run = path(&dir, "run");
    let trained = brakecheck(&[
        "train",
        "worlds/acc.ron",
        "-o",
        &run,
        "--against",
        "conditional",
        "--decisions",
        "3000",
        "--starts",
        "10",
        "--json",
    ]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    assert_eq!(json(&trained)["rows"][0]["context"], "nominal");
    let manifest = std::fs::read_to_string(dir.path().join("run/manifest.json")).expect("it");
    assert!(manifest.contains("\"conditional\"") && manifest.contains("max_brake_mps2"));

    let eval = |more: &[&str]| {
        let head = [
            "eval",
            &run,
            "--starts",
            "20",
            "--plant",
            "kinematic",
            "--json",
        ];
        brakecheck(&[&head[..], more].concat())
    };
    // Without a run of an ego it is told the nominal parameters, and that is said.
    let untold = eval(&["--ego", "sporty"]);
    assert_eq!(json(&untold)["rows"][0]["context"], "nominal");
    assert!(stderr(&untold).contains("--runs 10"), "{}", stderr(&untold));

    // With some it identifies the ego, once, and zero-shot stands beside it.
    let sporty = ["--ego", "sporty", "--runs", "2", "--ado", "trained"];
    let identified = eval(&sporty);
    assert_eq!(code(&identified), 0, "{}", stderr(&identified));
    let said = json(&identified);
    let rows = said["rows"].as_array().expect("rows");
    let row = |row: &serde_json::Value| format!("{} {}", row["ado"], row["context"]);
    assert_eq!(
        rows.iter().map(row).collect::<Vec<_>>(),
        [r#""trained" "identified""#, r#""zero-shot" "nominal""#]
    );
    assert_eq!(
        rows[1]["solved"],
        json(&untold)["rows"][0]["solved"],
        "zero-shot is what it is without a run"
    );
    let found = &said["identified"][0];
    assert_eq!(found["explains"], true, "{found}");
    assert_eq!(found["recorded"], 2, "{found}");
    let parameters = found["parameters"].as_array().expect("parameters");
    let kp = parameters.iter().find(|p| p["name"] == "kp_per_s2");
    let kp = kp.and_then(|kp| kp["fitted"].as_f64()).expect("a number");
    assert!((kp - 0.4).abs() < 0.08, "{found}");
    assert!(!stderr(&identified).contains("identified before"));
    let again = eval(&sporty);
    assert!(
        stderr(&again).contains("identified before"),
        "{}",
        stderr(&again)
    );
    assert_eq!(json(&again)["identified"], said["identified"]);
    assert_eq!(json(&again)["rows"][0]["solved"], rows[0]["solved"]);
    // A file that was changed is not believed.
    let kept = std::fs::read_dir(dir.path().join("run/learned")).expect("a directory");
    let kept: Vec<_> = kept.flatten().map(|entry| entry.path()).collect();
    let [kept] = &kept[..] else {
        panic!("{kept:?}");
    };
    let text = std::fs::read_to_string(kept).expect("the file");
    let changed = text.replacen("\"recorded\": 2", "\"recorded\": 3", 1);
    assert_ne!(changed, text);
    std::fs::write(kept, changed).expect("written");
    let anew = eval(&sporty);
    assert!(
        stderr(&anew).contains("identified anew"),
        "{}",
        stderr(&anew)
    );
    assert_eq!(std::fs::read_to_string(kept).expect("the file"), text);
    // For people: a table of what was found.
    let shown = brakecheck(&[&["eval", &run, "--starts", "5"][..], &sporty].concat());
    let shown = String::from_utf8(shown.stdout).expect("text");
    assert!(
        shown.contains("explained: the member stays within"),
        "{shown}"
    );
    assert!(shown.contains("kp_per_s2"), "{shown}");
    // An ego of no family says so, and with enough runs it is learned as well.
    let idm = eval(&["--ego", "idm", "--runs", "20", "--ado", "trained"]);
    assert_eq!(code(&idm), 0, "{}", stderr(&idm));
    assert_eq!(json(&idm)["identified"][0]["explains"], false);
    let adapted = &json(&idm)["adapted"][0];
    assert_eq!(adapted["identified_from"], 10, "{adapted}");
    assert_eq!(adapted["runs"], 10, "{adapted}");
    assert!(
        stderr(&idm).contains("none of the family"),
        "{}",
        stderr(&idm)
    );

    // Fine-tuning must say the same about the family as the training.
    let tuned = path(&dir, "tuned");
    let mixed = brakecheck(&[
        "train",
        "worlds/acc.ron",
        "-o",
        &tuned,
        "--from",
        &run,
        "--ego",
        "sporty",
    ]);
    assert_eq!(code(&mixed), 2);
    assert!(
        stderr(&mixed).contains("--against conditional"),
        "{}",
        stderr(&mixed)
    );
}

#[test]
fn an_ado_is_fine_tuned_on_a_changed_ego_and_tries_several_times() {
    let dir = scratch();
    let (wide, tuned) = (path(&dir, "wide"), path(&dir, "tuned"));
    let train = |run: &str, more: &[&str]| {
        let head = [
            "train",
            "worlds/acc.ron",
            "-o",
            run,
            "--decisions",
            "3000",
            "--starts",
            "20",
        ];
        brakecheck(&[&head[..], more, &["--json"]].concat())
    };
    let first = train(&wide, &["--against", "wide"]);
    assert_eq!(code(&first), 0, "{}", stderr(&first));
    assert!(json(&first)["rows"][0].get("context").is_none());
    let second = train(&tuned, &["--from", &wide, "--ego", "softer brakes"]);
    assert_eq!(code(&second), 0, "{}", stderr(&second));
    assert_eq!(json(&second)["rows"][0]["ego"], "softer brakes");
    let manifest = std::fs::read_to_string(dir.path().join("tuned/manifest.json")).expect("it");
    assert!(manifest.contains("softer brakes"));
    let again = train(&tuned, &["--resume", "--ego", "wet road"]);
    assert_eq!(code(&again), 2, "{}", stderr(&again));
    let again = train(&tuned, &["--resume"]);
    assert_eq!(code(&again), 0, "{}", stderr(&again));
    assert_eq!(json(&again)["rows"][0]["ego"], "softer brakes");

    let keep = path(&dir, "kept");
    let tries = brakecheck(&[
        "eval",
        &tuned,
        "--starts",
        "30",
        "--tries",
        "5",
        "--ego",
        "softer brakes",
        "--plant",
        "kinematic",
        "--keep",
        &keep,
        "--json",
    ]);
    assert_eq!(code(&tries), 0, "{}", stderr(&tries));
    let row = &json(&tries)["rows"][0];
    assert!(
        row["method"]
            .as_str()
            .expect("words")
            .contains("at most 5 tries"),
        "{row}"
    );
    let spent = row["sims_per_start"].as_f64().expect("a number");
    assert!((1.0..=5.0).contains(&spent), "{row}");
    // Every kept try fails the same ego again, bit for bit.
    let replayed = brakecheck(&["replay", &keep, "--expect", "recorded"]);
    assert_eq!(code(&replayed), 0, "{}", stderr(&replayed));

    let refusals = [
        (
            vec!["train", "worlds/acc.ron", "--ego", "all"],
            "one of them",
        ),
        (
            vec!["train", "worlds/grid.ron", "--against", "wide"],
            "no family",
        ),
        (
            vec![
                "train",
                "worlds/acc.ron",
                "--against",
                "wide",
                "--plant",
                "rigid",
            ],
            "names its plants",
        ),
        (
            vec![
                "train",
                "worlds/acc.ron",
                "--against",
                "wide",
                "--ego",
                "idm",
            ],
            "leave out one",
        ),
    ];
    for (args, cure) in refusals {
        let output = brakecheck(&args);
        assert_eq!(code(&output), 2, "{args:?}: {}", stderr(&output));
        let said = stderr(&output)
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        assert!(said.contains(cure), "{args:?}: {said}");
    }
}
