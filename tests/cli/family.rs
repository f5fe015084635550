//! Ados of a family, fine-tuning and tries, as a user runs them.

use super::{brakecheck, code, json, path, scratch, stderr};

#[test]
fn a_conditional_ado_is_refused_with_what_to_use_in_its_place() {
    let dir = scratch();
    let run = path(&dir, "run");
    let train = |against: &str| {
        let head = ["train", "worlds/acc.ron", "-o", &run, "--against", against];
        brakecheck(&[&head[..], &["--decisions", "600", "--starts", "5"]].concat())
    };
    let retired = train("conditional");
    assert_eq!(code(&retired), 2, "{}", stderr(&retired));
    let said = stderr(&retired);
    assert!(said.contains("nominal, wide"), "{said}");

    // A run of an earlier version says so in its manifest, whatever else it holds.
    let wide = train("wide");
    assert_eq!(code(&wide), 0, "{}", stderr(&wide));
    let file = dir.path().join("run/manifest.json");
    let manifest = std::fs::read_to_string(&file).expect("a manifest");
    let former = manifest.replace("\"against\": \"wide\"", "\"against\": \"conditional\"");
    assert_ne!(former, manifest);
    std::fs::write(&file, former).expect("written");
    for args in [
        vec!["eval", &run],
        vec!["report", &run],
        vec!["train", "worlds/acc.ron", "-o", &run, "--resume"],
    ] {
        let refused = brakecheck(&args);
        assert_eq!(code(&refused), 2, "{args:?}: {}", stderr(&refused));
        let said = stderr(&refused);
        let words: Vec<&str> = said.split_whitespace().collect();
        let said = words.join(" ");
        // Long paths are wrapped anywhere, so only their end is compared.
        for part in [
            "run`",
            "conditional ados were retired",
            "--against wide",
            "--runs N",
        ] {
            assert!(said.contains(part), "{args:?}: {part}: {said}");
        }
    }
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
    let rows = &json(&tries)["rows"];
    let [once, row] = [&rows[0], &rows[1]];
    assert_eq!(row["method"], "guided, at most 5 runs");
    let solved = [once, row].map(|row| row["successes"].as_u64());
    assert!(solved[0] <= solved[1], "{rows}");
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
