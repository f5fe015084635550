//! Campaigns in pieces: killed, cut otherwise, mixed up; and what is refused.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::{brakecheck, code, copy, json, path, scratch, stderr};

/// Two egos, four ados, a few starts: about a second.
pub(super) const SMALL: &str = r#"Campaign(
    name: "small",
    worlds: [(file: "acc", plant: Kinematic)],
    egos: [Ego("nominal"), Ego("wet road"), Sweep("ego.time_gap_s=0.5..1.0:2")],
    ados: [Neutral, Held, Constant("-3 m/s²"), Search(switches: 0)],
    starts: Drawn(count: 40, seed: 9),
    preventability: true,
    gate: (baseline: "nominal"),
)"#;

/// Writes a campaign file and plans it, with pieces of about so many seconds.
pub(super) fn plan(dir: &tempfile::TempDir, name: &str, text: &str, piece_s: &str) -> String {
    let file = path(dir, &format!("{name}.ron"));
    fs::write(&file, text).expect("written");
    let planned = path(dir, name);
    let args = [
        "campaign",
        "plan",
        &file,
        "-o",
        &planned,
        "--piece-s",
        piece_s,
        "--json",
    ];
    let output = brakecheck(&args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    planned
}

pub(super) fn run(plan: &str) {
    let output = brakecheck(&["campaign", "run", plan, "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let ran = json(&output);
    assert_eq!(ran["done"], ran["pieces"]);
}

/// The SHA-256 and the rows of a merged campaign.
pub(super) fn merged(plan: &str) -> (String, Vec<Value>) {
    let output = brakecheck(&["campaign", "merge", plan, "--json"]);
    let told = json(&output);
    let file = told["file"].as_str().expect("a file");
    let text = fs::read_to_string(file).expect("the merged file");
    let rows = text
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"));
    (
        told["sha256"].as_str().expect("a hash").to_owned(),
        rows.collect(),
    )
}

/// What a merge that refuses says.
pub(super) fn refused(args: &[&str]) -> String {
    let output = brakecheck(&[&["campaign", "merge"], args].concat());
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    stderr(&output)
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

/// The files of the pieces, in order.
pub(super) fn pieces(plan: &str) -> Vec<PathBuf> {
    let mut all = Vec::new();
    // Where none was made yet, there is no directory either.
    let dirs = fs::read_dir(Path::new(plan).join("pieces"));
    for dir in dirs.into_iter().flatten().flatten() {
        for entry in fs::read_dir(dir.path()).expect("pieces").flatten() {
            all.push(entry.path());
        }
    }
    all.retain(|path| {
        path.extension()
            .is_some_and(|extension| extension == "jsonl")
    });
    all.sort();
    all
}

#[test]
fn rows_are_those_of_eval_and_search_however_the_campaign_is_cut() {
    let dir = scratch();
    let (fine, whole) = (
        plan(&dir, "fine", SMALL, "0.001"),
        plan(&dir, "whole", SMALL, "1000"),
    );
    run(&fine);
    run(&whole);
    assert!(pieces(&fine).len() > 100);
    assert_eq!(pieces(&whole).len(), 16);
    let (hash, rows) = merged(&fine);
    assert_eq!(hash, merged(&whole).0);
    assert_eq!(rows.len(), 4 * 4 * 40);

    // The same starts, one ego and one ado at a time.
    let marks = |ego: &str, ado: &str| -> String {
        let of = rows
            .iter()
            .filter(|row| row["ego"] == ego && row["ado"] == ado);
        of.map(|row| match row["outcome"].as_str().expect("a word") {
            "fails" => '1',
            "trivial" => 't',
            _ => '0',
        })
        .collect()
    };
    let common = [
        "--starts",
        "40",
        "--seed",
        "9",
        "--plant",
        "kinematic",
        "--json",
    ];
    let asked = [
        "search",
        "worlds/acc.ron",
        "--ego",
        "wet road",
        "--switches",
        "0",
    ];
    let searched = json(&brakecheck(&[&asked[..], &common].concat()));
    assert_eq!(searched["rows"][0]["solved"], marks("wet road", "search"));
    let untrained = json(&brakecheck(
        &[&["eval", "worlds/acc.ron"][..], &common].concat(),
    ));
    let held = untrained["rows"]
        .as_array()
        .expect("rows")
        .iter()
        .into_iter()
        .find(|row| row["ado"] == "hold")
        .expect("held-random");
    assert_eq!(held["solved"], marks("nominal", "hold"));
    // Recall is of the starts that search solves from the same ego.
    let summary = json(&brakecheck(&["campaign", "merge", &fine, "--json"]))["summary"].clone();
    let told = summary["rows"]
        .as_array()
        .expect("rows")
        .iter()
        .into_iter()
        .find(|row| row["ego"] == "wet road" && row["ado"] == "hold");
    let (search, hold) = (marks("wet road", "search"), marks("wet road", "hold"));
    let pairs = search
        .chars()
        .zip(hold.chars())
        .filter(|(one, _)| *one == '1');
    let (solved, both) = pairs.fold((0, 0), |(solved, both), (_, other)| {
        (solved + 1, both + i32::from(other == '1'))
    });
    assert!(solved > 0);
    let recall = told.expect("the row")["recall"].as_f64().expect("recall");
    assert_eq!(recall, f64::from(both) / f64::from(solved));
    // A row tells of the crash and holds nothing of the machine.
    let crash = rows
        .iter()
        .find(|row| row["outcome"] == "fails" && row["contact"] == true)
        .expect("a crash");
    assert!(crash["robustness"].as_f64().expect("ρ") < 0.0);
    assert_eq!(crash["leaf"], "headway >= d_safe");
    assert_eq!(crash["kind"], "RearEnd");
    assert!(crash["preventable"].is_boolean() && crash["closing_mps"].as_f64().expect("m/s") > 0.0);
    assert!(!crash["actions"].as_array().expect("actions").is_empty());
    let keys = |row: &Value| -> Vec<String> {
        row.as_object()
            .expect("an object")
            .keys()
            .cloned()
            .collect()
    };
    assert!(rows.iter().all(|row| keys(row) == keys(crash)));
    assert!(!keys(crash).iter().any(|key| key.contains("cpu")));
}

#[test]
fn whatever_is_killed_or_damaged_the_merged_bytes_are_the_same() {
    let dir = scratch();
    let whole = plan(&dir, "whole", SMALL, "1000");
    run(&whole);
    let want = merged(&whole).0;
    let torn = plan(&dir, "torn", SMALL, "0.02");
    let rounds = match std::env::var("BRAKECHECK_KILLS") {
        Ok(rounds) => rounds.parse().expect("a number of kills"),
        Err(_) => 4u64,
    };
    let mut rng = brakecheck::seed::generator("kills", &[0]);
    let mut dice = |below: usize| rand::RngExt::random_range(&mut rng, 0..below);
    for _ in 0..rounds {
        let mut scheduler = Command::new(assert_cmd::cargo::cargo_bin("brakecheck"))
            .args(["campaign", "run", &torn])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        std::thread::sleep(Duration::from_millis(dice(600) as u64));
        scheduler.kill().expect("killed, or gone");
        scheduler.wait().expect("gone");
        // A tenth of what is there is lost in one way or another.
        for file in pieces(&torn) {
            if dice(10) != 0 {
                continue;
            }
            let mut bytes = fs::read(&file).expect("a piece");
            match dice(3) {
                0 => fs::remove_file(&file).expect("removed"),
                1 => {
                    bytes.truncate(dice(bytes.len()));
                    fs::write(&file, bytes).expect("cut");
                }
                _ => {
                    let at = dice(bytes.len());
                    bytes[at] ^= 1 << dice(8);
                    fs::write(&file, bytes).expect("flipped");
                }
            }
        }
    }
    run(&torn);
    assert_eq!(merged(&torn).0, want);
    // What is there is not made again, and nobody's leftovers stay.
    let made = |plan: &str| -> Vec<_> {
        let times = pieces(plan)
            .into_iter()
            .map(|file| fs::metadata(file)?.modified());
        times.collect::<Result<_, _>>().expect("times")
    };
    let before = made(&torn);
    run(&torn);
    assert_eq!(made(&torn), before);
    let one = brakecheck(&["campaign", "run", &torn, "--piece", "3"]);
    assert!(
        stderr(&one).contains("was there already"),
        "{}",
        stderr(&one)
    );
}

#[test]
fn a_merge_names_what_is_missing_damaged_foreign_or_twice_and_different() {
    let dir = scratch();
    let text = SMALL.replace("Sweep(\"ego.time_gap_s=0.5..1.0:2\")", "");
    let plan_of = |name: &str, text: &str| plan(&dir, name, text, "1000");
    let ours = plan_of("ours", &text);
    let empty = refused(&[&ours]);
    assert!(empty.contains("8 of 8 pieces cannot be merged"), "{empty}");
    assert!(
        empty.contains("piece 0 is missing") && empty.contains("campaign run"),
        "{empty}"
    );
    run(&ours);
    let (hash, _) = merged(&ours);
    // A misspelled directory is no place without pieces to look into.
    let said = refused(&[&ours, "--with", "nope"]);
    assert!(said.contains("`nope` holds no pieces"), "{said}");
    let piece = |nth: usize| pieces(&ours)[nth].clone();
    let kept = fs::read(piece(3)).expect("a piece");

    // Damaged: a digit is another one.
    let text_of = String::from_utf8(kept.clone()).expect("text");
    fs::write(piece(3), text_of.replacen("\"start\":7", "\"start\":8", 1)).expect("changed");
    let said = refused(&[&ours]);
    assert!(
        said.contains("1 of 8") && said.contains("piece 3 is damaged"),
        "{said}"
    );
    // Sealed anew, with a start too few.
    let fewer: Vec<&str> = text_of
        .lines()
        .filter(|line| !line.contains("\"start\":7,"))
        .collect();
    fs::write(piece(3), sealed(&format!("{}\n", fewer.join("\n")))).expect("changed");
    let said = refused(&[&ours]);
    assert!(
        said.contains("piece 3 is damaged: it has not just the starts 0 to 40"),
        "{said}"
    );
    // Foreign: whole, and of another campaign, or another piece of this one.
    let theirs = plan_of("theirs", &text.replace("seed: 9", "seed: 10"));
    run(&theirs);
    fs::copy(&pieces(&theirs)[3], piece(3)).expect("copied");
    let said = refused(&[&ours]);
    assert!(said.contains("piece 3 is foreign"), "{said}");
    fs::copy(piece(4), piece(3)).expect("copied");
    let said = refused(&[&ours]);
    assert!(said.contains("piece 3 is foreign"), "{said}");
    // Twice, and different: an ego that does not answer twice alike would do it.
    fs::write(piece(3), &kept).expect("mended");
    let other = path(&dir, "other");
    copy(Path::new(&ours), Path::new(&other));
    let sealed_again = sealed(&text_of.replacen("\"simulations\":", "\"simulations\":1", 1));
    fs::write(&pieces(&other)[3], sealed_again).expect("another answer");
    let said = refused(&[&ours, "--with", &other]);
    assert!(
        said.contains("piece 3 is there twice with different content"),
        "{said}"
    );
    fs::write(&pieces(&other)[3], &kept).expect("mended");
    // Pieces of several machines: what one lacks the other has.
    fs::remove_file(piece(5)).expect("removed");
    let output = brakecheck(&["campaign", "merge", &ours, "--with", &other, "--json"]);
    assert_eq!(json(&output)["sha256"], hash);
    // A file that is no piece of it.
    fs::copy(
        &pieces(&other)[5],
        piece(4).with_file_name("000005 (1).jsonl"),
    )
    .expect("copied");
    let said = refused(&[&ours]);
    assert!(
        said.contains("no piece of this campaign") && said.contains("(1)"),
        "{said}"
    );
    // And a world that is not the one that was planned.
    let world = Path::new(&other).join("worlds/0-acc.ron");
    let changed = fs::read_to_string(&world)
        .expect("the world")
        .replace("kp_per_s2: 0.3", "kp_per_s2: 0.2");
    fs::write(&world, changed).expect("changed");
    let output = brakecheck(&["campaign", "run", &other]);
    assert_eq!(code(&output), 3);
    assert!(
        stderr(&output).contains("another world than was planned"),
        "{}",
        stderr(&output)
    );
}

/// The text of a piece with the right hash at its end.
fn sealed(text: &str) -> String {
    let end = text.trim_end().rfind('\n').expect("two lines") + 1;
    let digest = Sha256::digest(&text.as_bytes()[..end]);
    let hash: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("{}{{\"sha256\":\"{hash}\"}}\n", &text[..end])
}

#[test]
fn a_gate_that_could_never_close_is_refused() {
    let dir = scratch();
    let text = SMALL
        .replace("    preventability: true,\n", "")
        .replace("\"nominal\"),\n)", "\"nominal\", on: Preventable),\n)");
    let file = path(&dir, "open.ron");
    fs::write(&file, &text).expect("written");
    let plan = |planned: &str| brakecheck(&["campaign", "plan", &file, "-o", planned]);
    let output = plan(&path(&dir, "open"));
    assert_eq!(code(&output), 2);
    let message = stderr(&output);
    assert!(
        message.contains("judges none without `preventability: true`"),
        "{message}"
    );
    // Its place is the gate's line.
    assert!(message.contains("gate: (baseline"), "{message}");
    // Other gates need no drivers: without them every crash is unknown, and counts.
    for on in ["Any", "UnlessUnavoidable"] {
        let other = text.replace("on: Preventable", &format!("on: {on}, severity: true"));
        assert_ne!(other, text);
        fs::write(&file, other).expect("written");
        let output = plan(&path(&dir, on));
        assert_eq!(code(&output), 0, "{}", stderr(&output));
    }
}

#[test]
fn a_campaign_that_plays_or_compares_nothing_is_refused() {
    let dir = scratch();
    let file = path(&dir, "empty.ron");
    for (right, wrong, message) in [
        (
            "Ego(\"wet road\")",
            "Family(members: 0)",
            "0 members: there are 1 to 10000",
        ),
        (
            "Constant(\"-3 m/s²\")",
            "Script(name: \"late\", steps: [(\"-3 m/s²\", 1e9)], then: \"0 m/s²\")",
            "after 1000000 decisions",
        ),
        (
            "Constant(\"-3 m/s²\")",
            "Search(switches: 99999)",
            "99999 switches: there are at most 10",
        ),
    ] {
        assert!(SMALL.contains(right), "{right}");
        fs::write(&file, SMALL.replacen(right, wrong, 1)).expect("written");
        let output = brakecheck(&["campaign", "plan", &file, "-o", &path(&dir, "p")]);
        assert_eq!(code(&output), 2, "{wrong}");
        assert!(stderr(&output).contains(message), "{}", stderr(&output));
    }
    let alone = r#"Campaign(
        name: "alone",
        worlds: [(file: "acc")],
        egos: [Ego("nominal")],
        ados: [Neutral],
        starts: Drawn(count: 3),
        gate: (baseline: "nominal"),
    )"#;
    fs::write(&file, alone).expect("written");
    let output = brakecheck(&["campaign", "plan", &file, "-o", &path(&dir, "p")]);
    assert_eq!(code(&output), 2);
    assert!(
        stderr(&output).contains("`nominal` is the only ego, so the gate compares nothing"),
        "{}",
        stderr(&output)
    );
    // A baseline under `reuse` of one world is no ego of the other.
    let text = r#"Campaign(
        name: "two",
        worlds: [(file: "cyclist"), (file: "junction")],
        egos: [Ego("all")],
        ados: [Neutral],
        starts: Drawn(count: 3),
        gate: (baseline: "earlier trigger"),
    )"#;
    fs::write(&file, text).expect("written");
    let output = brakecheck(&["campaign", "plan", &file, "-o", &path(&dir, "p")]);
    assert_eq!(code(&output), 2);
    let message = stderr(&output);
    assert!(
        message.contains("has no ego `earlier trigger` to compare with"),
        "{message}"
    );
}

#[test]
fn a_gate_decides_the_exit_code_of_the_merge() {
    let dir = scratch();
    let played = plan(&dir, "played", SMALL, "1000");
    run(&played);
    // What decides is no part of what is played: the pieces serve all three.
    let exit = |name: &str, on: &str| {
        let gate = format!("gate: (baseline: \"nominal\", on: {on})");
        let text = SMALL.replace("gate: (baseline: \"nominal\")", &gate);
        let plan = plan(&dir, name, &text, "1000");
        let pieces = |plan: &str| Path::new(plan).join("pieces");
        copy(&pieces(&played), &pieces(&plan));
        let output = brakecheck(&["campaign", "merge", &plan, "--json"]);
        (code(&output), json(&output)["summary"]["gates"].clone())
    };
    let (any_exit, any) = exit("any", "Any");
    let gates = any.as_array().expect("gates");
    assert_eq!(gates.len(), 3 * 4);
    let starts = |gate: &Value, what: &str| gate[what].as_array().expect("a list").len() as u64;
    let failing = gates.iter().any(|gate| starts(gate, "newly_failing") > 0);
    assert!(failing, "a wet road makes more of them fail: {any}");
    assert_eq!(any_exit, 1);
    let (exit_of_preventable, preventable) = exit("preventable", "Preventable");
    let gates = preventable.as_array().expect("gates");
    let by = |gate: &Value, label: &str| gate["newly_failing_by"][label].as_u64().expect("a count");
    let preventable = gates.iter().any(|gate| by(gate, "preventable") > 0);
    assert_eq!(exit_of_preventable, i32::from(preventable));
    assert_eq!(exit("never", "Never").0, 0);
    // The default excuses crashes that are shown to be unavoidable, and no others.
    let (exit_of_default, default) = exit("default", "UnlessUnavoidable");
    let gates = default.as_array().expect("gates");
    let labels = ["preventable", "avoidable", "unavoidable", "unknown"];
    let is_closed = |gate: &Value| gate["closed_by"] != serde_json::json!([]);
    for gate in gates {
        let [preventable, avoidable, unavoidable, unknown] = labels.map(|label| by(gate, label));
        let all = preventable + avoidable + unavoidable + unknown;
        assert_eq!(all, starts(gate, "newly_failing"), "{gate}");
        assert_eq!(is_closed(gate), unavoidable < all, "{gate}");
    }
    assert_eq!(exit_of_default, i32::from(gates.iter().any(is_closed)));
    let (exit_of_severity, severity) = exit("severity", "Never, severity: true");
    let gates = severity.as_array().expect("gates");
    let severe = gates.iter().any(|gate| starts(gate, "more_severe") > 0);
    assert_eq!(exit_of_severity, i32::from(severe));
}

#[test]
fn trainings_are_pieces_that_others_wait_for_and_go_on_where_they_were_killed() {
    let dir = scratch();
    let text = r#"Campaign(
        name: "trained",
        worlds: [(file: "acc", plant: Kinematic)],
        ados: [Training(seeds: 2, decisions: 3000)],
        starts: Drawn(count: 30, seed: 100),
    )"#;
    let first = plan(&dir, "first", text, "1000");
    let early = brakecheck(&["campaign", "run", &first, "--piece", "2"]);
    assert_eq!(code(&early), 2);
    assert!(
        stderr(&early).contains("needs the training of piece 0"),
        "{}",
        stderr(&early)
    );
    run(&first);
    let (hash, rows) = merged(&first);
    let seeds: Vec<&Value> = rows.iter().map(|row| &row["train_seed"]).collect();
    assert!(seeds[..30].iter().all(|seed| **seed == 100));
    assert!(seeds[30..].iter().all(|seed| **seed == 101));
    let output = brakecheck(&["campaign", "merge", &first, "--json"]);
    let summary = json(&output)["summary"]["rows"].clone();
    assert_eq!(summary.as_array().expect("rows").len(), 3);
    assert_eq!(summary[2]["trainings"], 2);

    let second = plan(&dir, "second", text, "1000");
    for wait_ms in [150, 400, 700] {
        let mut training = Command::new(assert_cmd::cargo::cargo_bin("brakecheck"))
            .args(["campaign", "run", &second])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        std::thread::sleep(Duration::from_millis(wait_ms));
        training.kill().expect("killed, or gone");
        training.wait().expect("gone");
    }
    run(&second);
    assert_eq!(merged(&second).0, hash);
    // A piece that was played with another ado than the campaign trained.
    let other = plan(&dir, "other", &text.replace("3000", "3100"), "1000");
    run(&other);
    let trainings = |plan: &str| Path::new(plan).join("trainings/0-acc-100");
    fs::remove_dir_all(trainings(&second)).expect("removed");
    copy(&trainings(&other), &trainings(&second));
    fs::remove_file(&pieces(&second)[2]).expect("removed");
    run(&second);
    let said = refused(&[&second]);
    assert!(said.contains("another ado than piece 0 trained"), "{said}");
}

#[test]
fn a_grid_of_starts_is_drawn_as_maps_beside_the_boundary() {
    let dir = scratch();
    let root = super::root().join("examples/campaigns");
    let text = fs::read_to_string(root.join("r157_cut_in.ron")).expect("the campaign");
    // Of three worlds and eleven egos one each, and a coarse grid.
    let world = root.join("r157_cut_in_fast.ron");
    let (_, ados) = text
        .split_once("fast.ron\", ados: ")
        .expect("the fast world");
    let (ados, _) = ados.split_once("]),").expect("its own ado");
    let (_, boundary) = text.split_once("boundary: (").expect("the boundary");
    let small = format!(
        r#"Campaign(
            name: "cut-ins",
            worlds: [(file: "{}", ados: {ados}])],
            ados: [Search(switches: 0)],
            starts: Grid(axes: {{
                "ego.speed": (16.67, 16.67, 1), "ado.headway": (8.0, 64.0, 5), "ado.speed": (2.0, 16.0, 5),
            }}),
            preventability: true,
            boundary: ({boundary}"#,
        world.display()
    );
    let planned = plan(&dir, "cells", &small, "1000");
    run(&planned);
    let (_, rows) = merged(&planned);
    let protocol: Vec<&Value> = rows.iter().filter(|row| row["ado"] == "protocol").collect();
    assert_eq!(protocol.len(), 25);
    // The last axis varies fastest; x is in the order of the world's axes.
    assert_eq!(protocol[1]["x"], serde_json::json!([16.67, 8.0, 5.5]));
    assert_eq!(protocol[5]["x"], serde_json::json!([16.67, 22.0, 2.0]));
    let of = |word: &str| protocol.iter().filter(|row| row["outcome"] == word).count();
    assert!(of("foul") > 0 && of("held") > 0, "{protocol:?}");
    assert!(
        protocol
            .iter()
            .any(|row| row["rule"] == "cuts in as the regulation asks cars to survive")
    );
    let page = fs::read_to_string(Path::new(&planned).join("merged/report.html")).expect("a page");
    assert_eq!(page.matches("aria-label=").count(), 1, "one map");
    assert!(page.contains("class=\"boundary\"") && page.contains("UN R157 5.2.5.2"));
}

#[test]
fn a_dry_run_says_what_it_comes_to_and_writes_nothing() {
    let dir = scratch();
    let file = path(&dir, "small.ron");
    fs::write(&file, SMALL).expect("written");
    let output = brakecheck(&["campaign", "plan", &file, "--dry-run", "--json"]);
    let told = json(&output);
    assert_eq!((&told["units"], &told["starts"]), (&16.into(), &640.into()));
    assert!(told["measured"] == true && told["cpu_s"].as_f64().expect("seconds") > 0.0);
    assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 1);
    // Cut by a guess the plan is the same anywhere; another one is not written over it.
    let [one, two] = ["one", "two"].map(|name| plan(&dir, name, SMALL, "0.05"));
    let text = |plan: &str| fs::read_to_string(Path::new(plan).join("plan.json")).expect("a plan");
    assert_eq!(text(&one), text(&two));
    let again = brakecheck(&["campaign", "plan", &file, "-o", &one, "--piece-s", "0.05"]);
    assert_eq!(code(&again), 0, "{}", stderr(&again));
    let other = brakecheck(&["campaign", "plan", &file, "-o", &one, "--piece-s", "1"]);
    assert_eq!(code(&other), 2);
    assert!(
        stderr(&other).contains("holds another plan"),
        "{}",
        stderr(&other)
    );
    let flipped = text(&one).replacen("\"seed\": 9", "\"seed\": 8", 1);
    fs::write(Path::new(&one).join("plan.json"), flipped).expect("changed");
    let damaged = brakecheck(&["campaign", "run", &one]);
    assert_eq!(code(&damaged), 3);
    assert!(
        stderr(&damaged).contains("was changed since"),
        "{}",
        stderr(&damaged)
    );
}

#[test]
fn mistakes_in_a_campaign_file_are_named_with_place_and_cure() {
    let dir = scratch();
    let mut all = String::new();
    for (right, wrong) in [
        ("file: \"acc\"", "file: \"ac\""),
        ("file: \"acc\"", "fil: \"acc\""),
        ("Ego(\"wet road\")", "Ego(\"wet raod\")"),
        ("ego.time_gap_s=0.5", "ego.time_gp_s=0.5"),
        ("Constant(\"-3 m/s²\")", "Constant(\"-4 m/s²\")"),
        ("switches: 0", "switches: 0, budget: 3"),
        ("switches: 0", "method: \"mutate\""),
        ("Neutral, ", "Neutral, Neutral, "),
        ("count: 40", "count: 0"),
        (
            "Drawn(count: 40, seed: 9)",
            "Grid(axes: { \"ado.headway\": (10.0, 500.0, 3) })",
        ),
        (
            "Drawn(count: 40, seed: 9)",
            "Grid(axes: { \"ado.hedway\": (10.0, 20.0, 3) })",
        ),
        (
            "Drawn(count: 40, seed: 9)",
            "Grid(axes: { \"ado.headway\": (20.0, 10.0, 3) })",
        ),
        (
            "Drawn(count: 40, seed: 9)",
            "Grid(axes: { \"ado.headway\": (10.0, 20.0, 10000000000) })",
        ),
        ("baseline: \"nominal\"", "baseline: \"nomnal\""),
        (
            "gate: (baseline: \"nominal\")",
            "boundary: (name: \"b\", stl: \"hedway > 3\")",
        ),
        ("Held", "Training(seeds: 0)"),
        ("Held", "Family(members: 3)"),
        ("Held", "Trained(\"runs/none\")"),
        (
            "worlds: [(file: \"acc\", plant: Kinematic)],",
            "worlds: [(file: \"grid\")],",
        ),
        (
            "worlds: [(file: \"acc\", plant: Kinematic)],\n    egos: [Ego(\"nominal\"), Ego(\"wet road\"), Sweep(\"ego.time_gap_s=0.5..1.0:2\")],",
            "worlds: [(file: \"grid\")],\n    egos: [Ego(\"all\")],",
        ),
    ] {
        assert!(SMALL.contains(right), "{right}");
        let file = path(&dir, "wrong.ron");
        fs::write(&file, SMALL.replacen(right, wrong, 1)).expect("written");
        let output = brakecheck(&[
            "campaign",
            "plan",
            &file,
            "-o",
            &path(&dir, "p"),
            "--piece-s",
            "1",
        ]);
        assert_eq!(code(&output), 2, "{wrong}: {}", stderr(&output));
        let said = stderr(&output).replace(&dir.path().display().to_string(), "DIR");
        all.push_str(&format!("--- {wrong}\n{said}\n"));
        assert!(!dir.path().join("p").exists(), "{wrong}");
    }
    insta::assert_snapshot!(all);
}
