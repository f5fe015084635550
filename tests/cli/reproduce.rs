//! Tables that are made from nothing, and what is kept of them on the way.

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::{brakecheck, code, json, path, root, scratch, stderr};
use std::fs;

/// ACC on the kinematic plant with a training of a second.
fn brief_worlds(dir: &tempfile::TempDir) -> String {
    let worlds = dir.path().join("worlds");
    fs::create_dir_all(&worlds).expect("a directory");
    let text = fs::read_to_string(root().join("worlds/acc.ron")).expect("the world");
    let text = text
        .replace("plant: Rigid", "plant: Kinematic")
        .replace("Dqn(decisions: 300_000)", "Dqn(decisions: 3_000)");
    fs::write(worlds.join("acc.ron"), text).expect("a brief world");
    worlds.display().to_string()
}

#[test]
fn finished_pieces_are_used_again_by_the_same_command_only() {
    let dir = scratch();
    let worlds = brief_worlds(&dir);
    let out = path(&dir, "out");
    let made = |starts: &str| {
        let mut args = vec!["reproduce", "case-studies", "--worlds", &worlds];
        args.extend(["--world", "acc", "--seeds", "1", "--starts", starts]);
        args.extend(["-o", &out, "--json"]);
        let output = brakecheck(&args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let study = json(&output)["case_studies"][0].clone();
        (study, stderr(&output))
    };
    let (first, _) = made("12");
    assert_eq!(first["world"], "acc");

    // The piece is the answer: what stands in it is what is printed.
    let part = dir.path().join("out/parts/acc--case-study.json");
    let text = fs::read_to_string(&part).expect("a finished piece");
    let mut other: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(other["made"]["train_cpu_s"], first["train_cpu_s"]);
    other["made"]["train_cpu_s"] = 77.5.into();
    // The seal covers processor times, so a changed one is sealed again.
    let blank = "0".repeat(64);
    other["seal"] = blank.as_str().into();
    let text = other.to_string();
    let seal: String = Sha256::digest(text.as_bytes())
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    fs::write(&part, text.replacen(&blank, &seal, 1)).expect("planted");
    assert_eq!(made("12").0["train_cpu_s"], 77.5);

    // Another question is another piece, made from the training that is kept.
    let (more, _) = made("16");
    assert_eq!(more["train_cpu_s"], first["train_cpu_s"]);
    assert_eq!(
        more["starts"]
            .as_u64()
            .zip(more["trivial"].as_u64())
            .map(|(a, b)| a + b),
        Some(16)
    );

    // A damaged one is said, and made anew.
    let text = fs::read_to_string(&part).expect("a finished piece");
    fs::write(&part, &text[..text.len() / 2]).expect("cut off");
    let (again, said) = made("16");
    // All but the processor times is the same.
    let rows = |study: &serde_json::Value| -> Vec<serde_json::Value> {
        let rows = study["rows"].as_array().expect("rows");
        rows.iter().map(|row| row["solved"].clone()).collect()
    };
    assert_eq!(rows(&again), rows(&more));
    assert_eq!(again["train_cpu_s"], first["train_cpu_s"]);
    assert!(said.contains("acc--case-study.json"), "{said}");
    assert!(said.contains("made anew"), "{said}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_table_says_how_to_go_on() {
    use assert_cmd::cargo::CommandCargoExt;
    use std::process::{Command, Stdio};
    use std::time::Duration;

    let dir = scratch();
    let worlds = brief_worlds(&dir);
    let acc = dir.path().join("worlds/acc.ron");
    let text = fs::read_to_string(&acc).expect("the world");
    let text = text.replace("Dqn(decisions: 3_000)", "Dqn(decisions: 30_000_000)");
    fs::write(&acc, text).expect("a long world");
    let out = path(&dir, "out");
    let child = Command::cargo_bin("brakecheck")
        .expect("the program")
        .args(["reproduce", "case-studies", "--worlds", &worlds])
        .args(["--world", "acc", "--seeds", "1", "-o", &out])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    let begun = dir.path().join("out/runs/acc-100/manifest.json");
    while !begun.exists() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let pid = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &pid]).status();
    assert!(sent.expect("kill").success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(code(&output), 130, "{}", stderr(&output));
    assert!(stderr(&output).contains("run the same command to go on"));
    assert!(!dir.path().join("out/parts").exists());
}

#[test]
fn points_of_protocols_are_passed_or_not_ego_by_ego() {
    let dir = scratch();
    let out = path(&dir, "out");
    let table = [
        "reproduce",
        "r157",
        "--world",
        "r157/cut_in_near",
        "-o",
        &out,
    ];
    let egos = ["--ego", "coasts", "--ego", "nominal", "--json"];
    let output = brakecheck(&[&table[..], &egos].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let rows = json(&output)["r157"].clone();
    let passed = |at: usize| (rows[at]["ego"].clone(), rows[at]["passed"].clone());
    assert_eq!(passed(0), ("coasts".into(), 0.into()));
    assert_eq!(passed(1), ("nominal".into(), 1.into()));
    assert_eq!(
        (&rows[0]["points"], &rows[0]["strayed"]),
        (&1.into(), &0.into())
    );
    let table = fs::read_to_string(dir.path().join("out/r157.md")).expect("a table");
    assert!(
        table.contains("| r157/cut_in_near | 1 | 0 | 1 |"),
        "{table}"
    );

    // An ego of one's own is a file with a change.
    let mine = path(&dir, "mine.ron");
    fs::write(&mine, "Change(ego: (trigger_mps2: 12.0))").expect("written");
    let own = ["reproduce", "r157", "--world", "r157/pedestrian_offset"];
    let output = brakecheck(&[&own[..], &["-o", &out, "--ego", &mine, "--json"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let row = json(&output)["r157"][0].clone();
    assert_eq!(
        (&row["passed"], &row["strayed"]),
        (&1.into(), &1.into()),
        "{row}"
    );

    let output = brakecheck(&["reproduce", "table1", "--ego", "coasts"]);
    assert_eq!(code(&output), 2);
    assert!(
        stderr(&output).contains("reproduce ncap"),
        "{}",
        stderr(&output)
    );
}
