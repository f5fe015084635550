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
    // As versions before 0.2 wrote it.
    let mut older = json(&trained)["rows"][0].clone();
    let fields = older.as_object_mut().expect("a row");
    let context = fields.remove("context").expect("said");
    fields.insert("told".to_owned(), context);
    let older: brakecheck::run::Row = serde_json::from_value(older).expect("an older row");
    assert_eq!(older.context.as_deref(), Some("nominal"));
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
    let told = |more: &[&str]| {
        let output = eval(more);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        json(&output)["rows"][0]["context"].clone()
    };
    let refused = |more: &[&str], why: &str| {
        let output = eval(more);
        assert_eq!(code(&output), 2, "{}", stderr(&output));
        assert!(stderr(&output).contains(why), "{}", stderr(&output));
    };
    refused(&[], "must be told");
    refused(
        &["--params", "guessed"],
        "none of nominal, true, identified, adapted",
    );
    refused(&["--params", &path(&dir, "none.ron")], "there is no");
    assert_eq!(told(&["--params", "nominal"]), "nominal");
    assert_eq!(told(&["--params", "true", "--ego", "sporty"]), "true");
    // An IDM has no kp: said, and told the nominal values.
    let idm = eval(&["--params", "true", "--ego", "idm"]);
    assert_eq!(json(&idm)["rows"][0]["context"], "nominal");
    assert!(
        stderr(&idm).contains("has no `kp_per_s2`"),
        "{}",
        stderr(&idm)
    );

    let file = path(&dir, "p.ron");
    let identified = brakecheck(&[
        "identify",
        &run,
        "--ego",
        "sporty",
        "--runs",
        "2",
        "--plant",
        "kinematic",
        "-o",
        &file,
        "--json",
    ]);
    assert_eq!(code(&identified), 0, "{}", stderr(&identified));
    let found = &json(&identified)["egos"]["sporty"];
    assert_eq!(found["explains"], true, "{found}");
    let kp = found["parameters"]["kp_per_s2"].as_f64().expect("a number");
    assert!((kp - 0.4).abs() < 0.08, "{found}");
    assert_eq!(told(&["--params", &file, "--ego", "sporty"]), "identified");
    refused(&["--params", &file, "--ego", "tired"], "does not hold");
    // Found out before the first ego is played.
    let partly = eval(&["--params", &file, "--ego", "all"]);
    assert_eq!(code(&partly), 2);
    assert!(partly.stdout.is_empty(), "{}", stderr(&partly));
    let text = std::fs::read_to_string(&file).expect("the file");
    let write = |text: String| std::fs::write(&file, text).expect("written");
    write(text.replace("max_brake_mps2\": 7.5,", "max_brake_mps2\": 7.0,"));
    refused(&["--params", &file, "--ego", "sporty"], "another ego");
    let hash = text.find("world_sha256: \"").expect("a hash") + "world_sha256: \"".len();
    write(format!("{}0{}", &text[..hash], &text[hash + 1..]));
    let other = eval(&["--params", &file, "--ego", "sporty"]);
    assert_eq!(code(&other), 0, "{}", stderr(&other));
    let flipped = text.as_bytes()[hash] != b'0';
    let said = stderr(&other).contains("another version of the world");
    assert_eq!(said, flipped, "{}", stderr(&other));
    write(text.replace("\"delay_s\"", "\"delays_s\""));
    refused(&["--params", &file, "--ego", "sporty"], "delays_s");
    let from = text.find("\"kp_per_s2\":").expect("a value");
    let to = from + text[from..].find('\n').expect("a line");
    write(format!("{}{}", &text[..from], &text[to..]));
    refused(
        &["--params", &file, "--ego", "sporty"],
        "`kp_per_s2` is missing",
    );
    write(format!(
        "{}\"kp_per_s2\": 9.0,{}",
        &text[..from],
        &text[to..]
    ));
    refused(
        &["--params", &file, "--ego", "sporty"],
        "outside of 0.15 ..= 0.6",
    );
    write("Change()".to_owned());
    refused(
        &["--params", &file, "--ego", "sporty"],
        "holds no identified egos",
    );

    // A place that is none is found out before anything is run.
    let nowhere = path(&dir, "none/p.ron");
    let lost = brakecheck(&["identify", &run, "--ego", "all", "-o", &nowhere]);
    assert_eq!(code(&lost), 2);
    assert!(
        stderr(&lost).contains("is no directory"),
        "{}",
        stderr(&lost)
    );

    // An ego of no family is told what the ado fares best with.
    let adapt = |simulations: &str| {
        brakecheck(&[
            "identify",
            &run,
            "--ego",
            "idm",
            "--runs",
            "1",
            "--adapt",
            simulations,
            "--plant",
            "kinematic",
            "-o",
            &file,
            "--json",
        ])
    };
    let too_few = adapt("199");
    assert_eq!(code(&too_few), 2);
    assert!(stderr(&too_few).contains("200.."), "{}", stderr(&too_few));
    let adapted = adapt("200");
    assert_eq!(code(&adapted), 0, "{}", stderr(&adapted));
    let found = &json(&adapted)["egos"]["idm"]["adapted"];
    let spent = found["simulations"].as_u64().expect("a number");
    assert!((160..=200).contains(&spent), "{found}");
    let rate = |name: &str| found[name].as_f64().expect("a number");
    assert!(
        rate("otherwise_success_rate") - 0.2 <= rate("success_rate"),
        "{found}"
    );
    let text = std::fs::read_to_string(&file).expect("the file");
    for tries in ["1", "3"] {
        let told = told(&["--params", &file, "--ego", "idm", "--tries", tries]);
        assert_eq!(told, "adapted");
    }
    let sha = found["policy_sha256"].as_str().expect("words");
    write(text.replace(sha, "another"));
    let other = eval(&["--params", &file, "--ego", "idm"]);
    assert_eq!(json(&other)["rows"][0]["context"], "nominal");
    assert!(
        stderr(&other).contains("another policy"),
        "{}",
        stderr(&other)
    );
    let from = text.find("others: [").expect("others");
    let value = from + text[from..].find("\"lag_s\": ").expect("a value");
    let end = value + text[value..].find(',').expect("its end");
    write(format!("{}\"lag_s\": inf{}", &text[..value], &text[end..]));
    refused(&["--params", &file, "--ego", "idm"], "not finite");
    assert_eq!(told(&["--params", "adapted", "--ego", "idm"]), "adapted");

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
            vec!["identify", &tuned, "--ego", "nominal"],
            "--against conditional",
        ),
        (
            vec!["eval", &tuned, "--params", "true"],
            "not told parameters",
        ),
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
