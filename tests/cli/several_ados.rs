//! Several ados from the command line: a policy each, placed ados, drawn actions, a bank.

use serde_json::Value;

use super::{brakecheck, code, json, path, root, scratch, stderr};

/// `sandwich` on the kinematic plant, in a file.
fn sandwich(dir: &tempfile::TempDir) -> String {
    let text = std::fs::read_to_string(root().join("worlds/sandwich.ron")).expect("shipped");
    let file = path(dir, "sandwich.ron");
    let text = text.replace("plant: Rigid", "plant: Kinematic");
    std::fs::write(&file, text).expect("written");
    file
}

/// A file of the repository.
fn shipped(file: &str) -> String {
    root().join(file).display().to_string()
}

fn train(world: &str, run: &str, more: &[&str]) -> std::process::Output {
    let args = [
        "train",
        world,
        "-o",
        run,
        "--decisions",
        "3000",
        "--starts",
        "5",
        "--json",
    ];
    brakecheck(&[&args[..], more].concat())
}

fn rows(output: &std::process::Output) -> Vec<Value> {
    assert_eq!(code(output), 0, "{}", stderr(output));
    json(output)["rows"].as_array().expect("rows").clone()
}

#[test]
fn each_ado_has_a_policy_and_its_contribution_is_a_row() {
    let dir = scratch();
    let (world, run) = (sandwich(&dir), path(&dir, "run"));
    let trained = train(&world, &run, &["--per-ado", "independent"]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let output = brakecheck(&[
        "eval",
        &run,
        "--starts",
        "40",
        "--ado",
        "trained",
        "--ado",
        "without",
        "--json",
        "--temperature",
        "0.5",
        "--draws",
        "3",
    ]);
    let rows = rows(&output);
    let ados: Vec<&str> = rows
        .iter()
        .map(|row| row["ado"].as_str().expect("a name"))
        .collect();
    assert_eq!(ados, ["trained", "sampled", "without lead", "without tail"]);
    assert_eq!(rows[0]["method"], "perado");
    let sampled = &rows[1];
    assert_eq!(
        (&sampled["repeats"]["runs"], &sampled["sims_per_start"]),
        (&3.into(), &3.0.into())
    );
    assert!(sampled["repeats"]["ci95"][0].as_f64() <= sampled["repeats"]["failing_share"].as_f64());
    // Each violation names its ado and the rule that this ado has.
    let mut named = 0;
    for broken in rows
        .iter()
        .filter_map(|row| row["violations"].as_array())
        .flatten()
    {
        let (ado, rule) = (broken["ado"].as_str(), broken["rule"].as_str());
        let (ado, rule) = (ado.expect("an ado"), rule.expect("a rule"));
        assert!(rule.starts_with(ado), "{ado}: {rule}");
        named += broken["starts"].as_u64().expect("a count");
    }
    assert!(named > 0);
    // The same draws again, on one thread.
    let again = brakecheck(&[
        "eval",
        &run,
        "--starts",
        "40",
        "--json",
        "--temperature",
        "0.5",
        "--draws",
        "3",
        "--jobs",
        "1",
    ]);
    assert_eq!(self::rows(&again)[1]["solved"], sampled["solved"]);
}

#[test]
fn a_trained_ado_guides_a_search_and_each_ado_is_left_out() {
    let dir = scratch();
    let (world, run, kept) = (sandwich(&dir), path(&dir, "run"), path(&dir, "kept"));
    assert_eq!(code(&train(&world, &run, &[])), 0);
    let guided = ["search", "--guided", &run, &world, "--starts", "40"];
    let more = ["--tries", "12", "--keep", &kept, "--json"];
    let output = brakecheck(&[&guided[..], &more].concat());
    let found = &rows(&output)[0];
    assert_eq!(found["ado"], "guided");
    assert_eq!(found["method"], "guided, at most 12 runs");
    let most = found["max_sims_per_start"].as_u64().expect("recorded");
    assert!((1..=12).contains(&most), "{most}");
    assert!(found["successes"].as_u64() > Some(0), "{found}");
    let replayed = brakecheck(&["replay", &kept, "--expect", "recorded"]);
    assert_eq!(code(&replayed), 0, "{}", stderr(&replayed));
    // The first run of each start is that of the trained ado.
    let eval = ["eval", &run, "--starts", "40", "--tries", "12"];
    let output = brakecheck(&[&eval[..], &["--json"]].concat());
    let all = rows(&output);
    let ados: Vec<&str> = all.iter().filter_map(|row| row["ado"].as_str()).collect();
    assert_eq!(ados, ["trained", "guided", "without lead", "without tail"]);
    assert_eq!(all[1]["solved"], found["solved"]);
    assert_eq!(all[0]["success_rate"], all[1]["anytime"][0]["success_rate"]);
    let effects = json(&output)["ado_effects"]
        .as_array()
        .expect("two")
        .clone();
    let ados: Vec<&str> = effects.iter().filter_map(|it| it["ado"].as_str()).collect();
    assert_eq!(ados, ["lead", "tail"]);
    for (effect, without) in effects.iter().zip(&all[2..]) {
        assert_eq!(effect["some"], without["successes"]);
        assert_eq!(effect["all"], all[0]["successes"]);
    }
    let details = brakecheck(&[&eval[..], &["--details"]].concat());
    let text = String::from_utf8_lossy(&details.stdout).into_owned();
    for says in [
        "runs per start: nominal, guided: ",
        "`lead`",
        "`tail`",
        "McNemar p = ",
    ] {
        assert!(text.contains(says), "{says} is missing in\n{text}");
    }
    // A policy of other observations has nothing to say here.
    let refused = brakecheck(&["search", "--guided", &run, "acc"]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("other observations or actions"));
    let refused = brakecheck(&["search", &world, "--method", "guided"]);
    assert!(
        stderr(&refused).contains("--guided RUN"),
        "{}",
        stderr(&refused)
    );
}

#[test]
fn placed_ados_are_evaluated_without_a_training() {
    let dir = scratch();
    let (world, run) = (sandwich(&dir), path(&dir, "run"));
    assert_eq!(code(&train(&world, &run, &["--per-ado", "alternating"])), 0);
    let text = std::fs::read_to_string(&world).expect("a file");
    let mut placed = text;
    for (name, end) in [
        ("lead", "],\n            ),"),
        ("tail", "],\n            ),"),
    ] {
        let agent = placed.find(&format!("name: \"{name}\"")).expect("an agent");
        let drive = agent + placed[agent..].find("drive: Ado(").expect("its drive");
        let end = drive + placed[drive..].find(end).expect("its end") + end.len();
        let new = format!("drive: Trained(run: \"{run}\", part: \"{name}\", rules: Judged),");
        placed.replace_range(drive..end, &new);
    }
    let file = path(&dir, "placed.ron");
    std::fs::write(&file, placed).expect("written");
    let output = brakecheck(&["eval", &file, "--starts", "20", "--json"]);
    let rows = rows(&output);
    let ados: Vec<&str> = rows
        .iter()
        .map(|row| row["ado"].as_str().expect("a name"))
        .collect();
    assert_eq!(ados, ["composed", "without lead", "without tail"]);
    let kinds = rows
        .iter()
        .map(|row| row["adversary"]["kind"].as_str().expect("a kind"));
    assert_eq!(
        kinds.collect::<Vec<_>>(),
        ["composed", "without", "without"]
    );
}

#[test]
fn a_bank_of_another_ego_becomes_demonstrations() {
    let dir = scratch();
    let acc = |name: &str| path(&dir, name);
    let first = brakecheck(&[
        "train",
        "acc",
        "--plant",
        "kinematic",
        "-o",
        &acc("first"),
        "--decisions",
        "8000",
        "--starts",
        "5",
    ]);
    assert_eq!(code(&first), 0, "{}", stderr(&first));
    let text = std::fs::read_to_string(root().join("worlds/acc.ron"))
        .expect("shipped")
        .replace("learner: Dqn(decisions: 300_000),", "");
    let world = path(&dir, "acc.ron");
    std::fs::write(&world, text).expect("written");
    let train = |run: &str, bank: &[&str]| {
        let run = acc(run);
        let args = [
            "train",
            &*world,
            "--plant",
            "kinematic",
            "--ego",
            "weak brakes",
            "-o",
            &run,
            "--decisions",
            "4000",
            "--starts",
            "20",
            "--json",
        ];
        let bank = bank.iter().flat_map(|bank| ["--bank", bank]);
        brakecheck(&args.into_iter().chain(bank).collect::<Vec<_>>())
    };
    let with = train("with", &[&acc("first")]);
    assert_eq!(code(&with), 0, "{}", stderr(&with));
    let without = train("without", &[]);
    // Known failures are changed a little, where a search from nothing tries thousands.
    let simulations = |output| {
        json(output)["sought"]["simulations"]
            .as_u64()
            .expect("a count")
    };
    let (few, many) = (simulations(&with), simulations(&without));
    assert!(4 * few < many, "{few} {many}");

    // The run holds its bank, and notices a change of it.
    let bank = dir.path().join("with/bank.json");
    let held = std::fs::read_to_string(&bank).expect("a bank");
    std::fs::write(&bank, held.replacen("\"noise\":", "\"noise\": ", 1)).expect("written");
    let eval = brakecheck(&["eval", &acc("with"), "--starts", "5"]);
    assert_ne!(code(&eval), 0);
    assert!(stderr(&eval).contains("bank.json"), "{}", stderr(&eval));

    for (bank, why) in [
        (
            shipped("tests/regressions/pedestrian-nominal-0001.ron"),
            "do not fit",
        ),
        (
            acc("nothing"),
            "contains neither a run nor kept counterexamples",
        ),
        (shipped("worlds/acc.ron"), "is no kept counterexample"),
    ] {
        let refused = train("refused", &[&bank]);
        assert_eq!(code(&refused), 2, "{}", stderr(&refused));
        assert!(stderr(&refused).contains(why), "{}", stderr(&refused));
        assert!(!dir.path().join("refused").exists());
    }
    let kept = shipped("tests/regressions/acc-nominal-0001.ron");
    assert_eq!(code(&train("kept", &[&kept])), 0);
    // A learner without demonstrations cannot use a bank.
    let other = brakecheck(&["train", "acc", "-o", &acc("other"), "--bank", &kept]);
    assert!(
        stderr(&other).contains("`Dqn` does not learn from"),
        "{}",
        stderr(&other)
    );
}
