//! Tables that are made from nothing, and what is kept of them on the way.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use assert_cmd::cargo::CommandCargoExt;
use quick_xml::events::Event;
use serde_json::Value;
use sha2::{Digest, Sha256};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Runs the program in a directory without worlds: they are inside it.
fn repro(args: &[&str]) -> Output {
    let mut program = Command::cargo_bin("repro").expect("the program");
    program.current_dir(env!("CARGO_TARGET_TMPDIR"));
    program.env("NO_COLOR", "1").args(args);
    program.output().expect("it runs")
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("an exit code")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("no JSON ({e}): {}", stderr(output)))
}

fn scratch() -> tempfile::TempDir {
    tempfile::tempdir().expect("a scratch directory")
}

fn path(dir: &tempfile::TempDir, name: &str) -> String {
    dir.path().join(name).display().to_string()
}

/// ACC on the kinematic plant with a training of a second.
fn brief_worlds(dir: &tempfile::TempDir) -> String {
    let worlds = dir.path().join("worlds");
    fs::create_dir_all(&worlds).expect("a directory");
    let text = fs::read_to_string(root().join("worlds/acc.ron"))
        .expect("the world")
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
        let mut args = vec!["case-studies", "--worlds", &worlds];
        args.extend(["--world", "acc", "--seeds", "1", "--starts", starts]);
        args.extend(["-o", &out, "--json"]);
        let output = repro(&args);
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
    assert_eq!(other["made"]["made"]["train_cpu_s"], first["train_cpu_s"]);
    other["made"]["made"]["train_cpu_s"] = 77.5.into();
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
    use std::process::Stdio;
    use std::time::Duration;

    let dir = scratch();
    let worlds = brief_worlds(&dir);
    let acc = dir.path().join("worlds/acc.ron");
    let text = fs::read_to_string(&acc)
        .expect("the world")
        .replace("Dqn(decisions: 3_000)", "Dqn(decisions: 30_000_000)");
    fs::write(&acc, text).expect("a long world");
    let out = path(&dir, "out");
    let child = Command::cargo_bin("repro")
        .expect("the program")
        .args(["case-studies", "--worlds", &worlds])
        .args(["--world", "acc", "--seeds", "1", "-o", &out])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    let begun = dir.path().join("out/runs/acc-1000/manifest.json");
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

/// The names of all elements of an XML text.
fn elements(text: &str) -> Vec<String> {
    let mut reader = quick_xml::Reader::from_str(text);
    let (mut open, mut names) = (0, Vec::new());
    loop {
        let event = reader
            .read_event()
            .unwrap_or_else(|error| panic!("not well-formed: {error}"));
        let name = match &event {
            Event::Start(tag) | Event::Empty(tag) => tag.name(),
            Event::End(_) => {
                open -= 1;
                continue;
            }
            Event::Eof => {
                assert_eq!(open, 0, "elements without an end");
                return names;
            }
            _ => continue,
        };
        names.push(name.as_ref().to_owned());
        open += i32::from(matches!(event, Event::Start(_)));
    }
}

#[test]
fn the_figures_of_the_paper_are_drawn_from_our_worlds() {
    let dir = scratch();
    let out = path(&dir, "figures");
    let output = repro(&["figures", "-o", &out, "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(json(&output)["figures"].as_array().expect("files").len(), 3);
    let read = |name: &str| {
        let file = format!("{out}/{name}.svg");
        fs::read_to_string(&file).unwrap_or_else(|error| panic!("{file}: {error}"))
    };
    for (name, panels) in [("figure-2", 4), ("figure-3", 9), ("figure-5", 2)] {
        let svg = read(name);
        let pictures = elements(&svg).iter().filter(|name| *name == "svg").count();
        // The picture, and for each panel a place and the panel in it.
        assert_eq!(pictures, 1 + 2 * panels, "{name}");
        assert!(svg.contains("found by search"), "{name}");
        assert!(!svg.contains('`'), "{name}: figures have no code");
    }
    assert!(read("figure-5").contains("runs the red light"));
    assert!(read("figure-3").contains("breaks “stays ahead until it overlaps”"));
    assert!(read("figure-3").contains("paths, a dot per second"));
}

#[test]
fn wrong_input_is_refused_with_its_fix() {
    for (args, says) in [
        (&["case-studies", "--world", "nowhere"][..], "merge_fair"),
        (&["near-starts", "--world", "nowhere"], "merge_fair"),
        (&["table1", "--seed", "3"], "--seeds"),
        (&["table2"], "table1"),
        (&["page", "--root", "."], "--root"),
        (&["near-starts", "--record"], "--root"),
    ] {
        let output = repro(args);
        assert_eq!(code(&output), 2, "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(says), "{}", stderr(&output));
    }
}

#[test]
fn help_is_what_it_was() {
    let output = repro(&["--help"]);
    assert_eq!(code(&output), 0);
    insta::assert_snapshot!("help", String::from_utf8_lossy(&output.stdout));
}
