//! The program as a user runs it: exit codes, rows, files, and what it says.

mod answers;
mod campaign;
mod commonroad;
mod cosim;
mod coverage;
mod export;
mod family;
mod faults;
mod first;
mod gate;
mod harden;
mod help;
mod hostile;
mod interrupted;
mod junit;
mod learned;
mod live;
mod log;
mod lsp;
mod memory;
mod mistakes;
mod natural;
mod partition;
mod picture;
mod points;
mod program;
mod programs;
mod reference;
mod replayed;
mod report;
#[cfg(feature = "rerun")]
mod rerun;
mod reuse;
mod risk;
mod rivals;
mod schema;
mod serve;
mod served;
mod settings;
mod several_ados;
mod stdin;
mod stl;
mod traffic;
mod watching;

use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::OnceLock;

use brakecheck::run_dir::Counterexample;
use brakecheck::trace::Trace;
use brakecheck_experiment::run_dir::counterexample::csv_of;
use program::{code, json, path, run_in, scratch, stderr};
use serde_json::Value;
use sha2::{Digest, Sha256};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn brakecheck(args: &[&str]) -> Output {
    brakecheck_in(root(), args)
}

fn brakecheck_in(dir: &Path, args: &[&str]) -> Output {
    run_in(dir, "brakecheck", args)
}

/// Expects exit code 2 with these words, and returns all messages.
#[track_caller]
fn refusal(output: &Output, says: &str) -> String {
    let said = stderr(output);
    assert_eq!(code(output), 2, "`{says}`: {said}");
    assert!(said.contains(says), "`{says}`: {said}");
    said
}

#[track_caller]
fn refused(args: &[&str], says: &str) -> String {
    refusal(&brakecheck(args), says)
}

/// Trains a small run on the kinematic plant; without further options it is
/// trained once for all tests.
fn small_run(dir: &tempfile::TempDir, name: &str, more: &[&str]) -> (String, Output) {
    static SHARED: OnceLock<(tempfile::TempDir, Output)> = OnceLock::new();
    let run = path(dir, name);
    if !more.is_empty() || Path::new(&run).exists() {
        return (run.clone(), train_small(&run, more));
    }
    let (shared, output) = SHARED.get_or_init(|| {
        let dir = scratch();
        let output = train_small(&path(&dir, "run"), &[]);
        (dir, output)
    });
    copy(&shared.path().join("run"), Path::new(&run));
    (run, output.clone())
}

fn train_small(run: &str, more: &[&str]) -> Output {
    let mut args = vec!["train", "worlds/acc.ron", "-o", run, "--plant", "kinematic"];
    args.extend(["--decisions", "12000", "--starts", "60", "--json"]);
    args.extend(more);
    brakecheck(&args)
}

/// A directory with all that is in it.
fn copy(from: &Path, to: &Path) {
    std::fs::create_dir(to).expect("a new directory");
    for entry in std::fs::read_dir(from).expect("a directory").flatten() {
        let (path, to) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy(&path, &to)
        } else {
            std::fs::copy(&path, &to).expect("copied");
        }
    }
}

#[test]
fn check_lists_signals_with_units_and_everything_else() {
    let listing = json(&brakecheck(&["check", "worlds/acc.ron", "--json"]));
    assert_eq!(listing["ok"], true);
    let signals = listing["signals"].as_array().expect("signals");
    let headway = signals
        .iter()
        .find(|signal| signal["name"] == "headway")
        .expect("the derived signal");
    assert_eq!(headway["unit"], "m");
    for signal in signals {
        assert!(!signal["about"].as_str().expect("a meaning").is_empty());
    }
    assert_eq!(listing["actions"].as_array().expect("actions").len(), 3);
    assert_eq!(listing["rules"].as_array().expect("rules").len(), 2);
    assert_eq!(listing["egos"][0], "nominal");
}

#[test]
fn a_broken_world_exits_with_2_and_shows_the_place() {
    let dir = scratch();
    let file = path(&dir, "broken.ron");
    let text = std::fs::read_to_string(root().join("worlds/acc.ron")).expect("a world");
    std::fs::write(
        &file,
        text.replace("ado.speed <= v_lim", "ado.speed <= v_limit"),
    )
    .expect("w");
    let said = refused(&["check", &file], "broken.ron:36:92");
    assert!(said.contains("did you mean `v_lim`"), "{said}");
    let output = brakecheck(&["check", &file, "--json"]);
    assert_eq!(code(&output), 2);
    assert_eq!(json(&output)["problems"][0]["line"], 36);
    assert_eq!(json(&output)["complete"], true);
    assert!(!said.contains("others may follow"), "{said}");
    // A missing comma hides what follows.
    let text = text.replace("plant: Rigid,", "plant: Rigid");
    std::fs::write(&file, text).expect("w");
    let said = refused(&["check", &file], "a comma is missing");
    assert!(said.contains("others may follow"), "{said}");
    let output = brakecheck(&["check", &file, "--json"]);
    assert_eq!(json(&output)["complete"], false);
}

#[test]
fn wrong_words_and_missing_files_exit_with_2_and_a_cure() {
    let dir = scratch();
    let run = path(&dir, "none");
    let cases: [(&[&str], &str); 12] = [
        (&["check", "worlds/none.ron"], "worlds/none.ron"),
        (&["eval", &run], "brakecheck train"),
        (&["replay", &run], "kept counterexample"),
        (
            &[
                "search",
                "worlds/acc.ron",
                "--ego",
                "nobody",
                "--starts",
                "1",
            ],
            "softer brakes",
        ),
        (
            &["search", "worlds/acc.ron", "--method", "magic"],
            "possible values",
        ),
        (
            &["search", "worlds/acc.ron", "--budget", "9"],
            "--switches M",
        ),
        (
            &[
                "search",
                "worlds/acc.ron",
                "--method",
                "cem",
                "--switches",
                "1",
            ],
            "--budget SIMS",
        ),
        (&["search", "worlds/acc.ron", "--bank", "src"], "mutate"),
        (
            &["search", "worlds/acc.ron", "--method", "mutate"],
            "--bank RUN",
        ),
        (&["frobnicate"], "usage: "),
        (&["train", "worlds/acc.ron", "--decisions", "0"], "0"),
        (&["check", "src"], "src"),
    ];
    for (args, says) in cases {
        let said = refused(args, says);
        assert!(!said.contains("panicked"), "{args:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_policy_and_rows_for_any_number_of_jobs() {
    let dir = scratch();
    let (a, first) = small_run(&dir, "a", &["--jobs", "1"]);
    let (b, second) = small_run(&dir, "b", &["--jobs", "2"]);
    assert_eq!(code(&first), 0, "{}", stderr(&first));
    let policy = |run: &str| std::fs::read(Path::new(run).join("policy.safetensors")).expect("p");
    assert_eq!(policy(&a), policy(&b));
    let rows = |output: &Output| {
        let mut rows = json(output)["rows"].clone();
        for row in rows.as_array_mut().expect("rows") {
            row["cpu_s"] = Value::Null;
        }
        rows
    };
    assert_eq!(rows(&first), rows(&second));
    let keys = [
        "world",
        "plant",
        "judge",
        "ego",
        "ado",
        "method",
        "start_seed",
        "starts",
        "trivial",
        "successes",
        "success_rate",
        "ci95",
        "foul_rate",
        "foul_before_contact_rate",
        "contact_rate",
        "invalid",
        "sims_per_start",
        "physics_steps",
        "cpu_s",
        "solved",
    ];
    for row in json(&first)["rows"].as_array().expect("rows") {
        for key in keys {
            assert!(row.get(key).is_some(), "{key} is missing in {row}");
        }
    }
    let (_, other) = small_run(&dir, "c", &["--seed", "1"]);
    assert_ne!(
        json(&other)["rows"][0]["solved"],
        json(&first)["rows"][0]["solved"]
    );
}

#[test]
fn a_run_is_evaluated_kept_replayed_and_watched() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let kept = path(&dir, "kept");
    let output = brakecheck(&[
        "eval",
        &run,
        "--starts",
        "80",
        "--ado",
        "trained",
        "--ado",
        "hold",
        "--search",
        "1",
        "--keep",
        &format!("{kept},most=2"),
        "--plant",
        "rigid",
        "--fail-on-counterexample",
        "--json",
    ]);
    assert_eq!(code(&output), 1, "{}", stderr(&output));
    let rows = json(&output);
    let ados: Vec<&str> = rows["rows"]
        .as_array()
        .expect("rows")
        .iter()
        .map(|row| row["ado"].as_str().expect("a word"))
        .collect();
    assert_eq!(ados, ["trained", "hold", "search"]);
    assert!(rows["rows"][0]["recall"].is_number());

    // The recorded ego still fails: 1. Reproducing the record was asked for: 0.
    assert_eq!(code(&brakecheck(&["replay", &kept])), 1);
    let output = brakecheck(&["replay", &kept, "--expect", "recorded", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let rows = json(&output)["rows"].clone();
    for row in rows.as_array().expect("rows") {
        assert_eq!(row["identical"], true);
        assert_eq!(row["rules_until_contact"]["kept"], true, "{row}");
        assert!(row["contact_s"].is_number());
    }
    assert_eq!(rows.as_array().expect("rows").len(), 2);
    let summary = |more: &[&str]| {
        let output = brakecheck(&[&["replay", &kept], more].concat());
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        text.lines().next().unwrap_or_default().to_owned()
    };
    assert_eq!(summary(&[]), "2 of 2 still fail, 0 fixed");
    let recorded = summary(&["--expect", "recorded"]);
    assert_eq!(recorded, "2 of 2 as recorded, 0 differ");

    // Another ego is no replay of bits; whether it fails decides.
    let gentle = path(&dir, "gentle.ron");
    std::fs::write(
        &gentle,
        // In the worst crashes the ego brakes as hard as it can from the start: what
        // differs there is how hard that is.
        "Change(ego: (time_gap_s: 3.0, standstill_headway_m: 12.0, max_brake_mps2: 5.0))",
    )
    .expect("w");
    let output = brakecheck(&["replay", &kept, "--ego", &gentle, "--json"]);
    let rows = json(&output);
    let rows = rows["rows"].as_array().expect("rows");
    let fails = rows.iter().any(|row| row["verdict"] == "counterexample");
    assert_eq!(code(&output), i32::from(fails), "{rows:?}");
    assert!(rows.iter().any(|row| row["identical"] == false));
    let output = brakecheck(&["replay", &kept, "--ego", &gentle, "--expect", "recorded"]);
    assert_eq!(code(&output), 4);

    // A bit that flips is named: sample and signal.
    let csv = std::fs::read_dir(&kept).expect("kept");
    let csv = csv.map(|e| e.expect("an entry").path());
    let csv = csv
        .into_iter()
        .find(|p| p.extension().is_some_and(|e| e == "csv"))
        .expect("a csv");
    tamper(&csv);
    let page = path(&dir, "kept.html");
    let output = brakecheck(&["report", &kept, "-o", &page]);
    assert_eq!(code(&output), 4, "{}", stderr(&output));
    assert!(Path::new(&page).is_file());
    let file = csv.with_extension("ron").display().to_string();
    let output = brakecheck(&["replay", &file]);
    assert_eq!(
        code(&output),
        4,
        "{}",
        String::from_utf8_lossy(&output.stdout)
    );
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("sample 3, `time_left`"), "{said}");
    assert!(said.contains("differ from "), "{said}");

    let table = brakecheck(&["eval", &run, "--starts", "10", "--explain"]);
    let table = String::from_utf8_lossy(&table.stdout).into_owned();
    assert!(table.contains("\nrest, hit"), "{table}");
}

#[test]
fn theorems_are_checked_on_a_run() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let output = brakecheck(&["eval", &run, "--starts", "60", "--theorems", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let carried = json(&output)["theorems"]["carry_over"].clone();
    let rows = carried["rows"].as_array().expect("rows");
    // Every changed ego, the ado in closed loop and its actions replayed; but
    // where there is noise, success is a probability: refused with the reason.
    let listing = json(&brakecheck(&["check", "worlds/acc.ron", "--json"]));
    let changed = listing["egos"].as_array().expect("egos").len() - 1;
    let refused = carried["refused"].as_array().expect("refused");
    assert!(refused.iter().any(|ego| ego["ego"] == "noisy sensors"));
    assert_eq!(rows.len(), 2 * (changed - refused.len()));
    for row in rows {
        assert_eq!(row["pairs"], carried["counterexamples"]);
        assert_eq!(
            (&row["misses"], &row["sharper"]["misses"]),
            (&0.into(), &0.into())
        );
        assert!(row["forecast"]["coverage"].is_number());
    }
}

#[test]
fn an_untrained_ado_passes_no_theorem_of_a_grid() {
    let dir = scratch();
    let run = path(&dir, "run");
    let world = "worlds/grid_hard.ron";
    let trained = brakecheck(&["train", world, "-o", &run, "--decisions", "50", "--json"]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let output = brakecheck(&["eval", &run, "--theorems", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let checked = json(&output)["theorems"]["grid"].clone();
    let first = checked["theorem_1"]["rows"].as_array().expect("rows");
    let first = first.iter().map(|row| &row["outcome_of_learned"]["is"]);
    let third = checked["theorem_3"].as_array().expect("rows");
    let third = third.iter().map(|row| &row["outcome"]["is"]);
    let second = &checked["theorem_2_learned"]["outcome"]["is"];
    for outcome in first.chain([second]).chain(third) {
        assert_eq!(outcome, "premise_not_met", "{checked:#}");
    }
    // Value iteration does not depend on the ado.
    assert_eq!(checked["theorem_2"]["outcome"]["is"], "holds");
}

#[test]
fn a_grid_that_has_no_exact_solution_is_refused_before_anything_is_played() {
    let dir = scratch();
    let (world, run) = (path(&dir, "nested.ron"), path(&dir, "run"));
    let rule = "always[0, T] (speed_inf <= 1.5)";
    let text = std::fs::read_to_string("worlds/grid_jump.ron").expect("shipped");
    assert!(text.contains(rule));
    let nested = text.replace(rule, "always[0, T] (eventually[0, 2] (ado.x >= 0))");
    std::fs::write(&world, nested).expect("written");
    let trained = brakecheck(&["train", &world, "-o", &run, "--decisions", "50", "--json"]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    for request in [
        &["--ado", "trained", "--ado", "optimal"][..],
        &["--theorems"],
    ] {
        let output = brakecheck(&[&["eval", &run, "--json"], request].concat());
        assert_eq!(code(&output), 2, "{request:?}: {}", stderr(&output));
        assert!(output.stdout.is_empty(), "{request:?}");
        let said = stderr(&output).replace("\n  │ ", " ");
        let names = "the rule `moves one cell at a time` cannot be judged from a state";
        assert!(said.contains(names), "{said}");
    }
}

/// Changes one value of sample 3 in the samples and the digest that goes with it.
fn tamper(csv: &Path) {
    let ron = csv.with_extension("ron");
    let mut kept = Counterexample::load(&ron).expect("a counterexample");
    let stored = kept.samples(&ron).expect("samples").expect("samples");
    let mut trace = Trace::new(stored.schema().clone());
    let mut row = vec![0.0; stored.schema().len()];
    for sample in 0..stored.len() {
        stored.read_row(sample, &mut row);
        if sample == 3 {
            let time_left = row.iter_mut().find(|value| **value == 14.85);
            *time_left.expect("the time left") = 14.86;
        }
        trace.push(&row).expect("finite");
    }
    let digest = Sha256::digest(csv_of(&trace).as_bytes());
    let digits = digest.iter().map(|byte| format!("{byte:02x}"));
    kept.samples_sha256 = Some(digits.collect());
    let digit = match &kept.digests[24..25] {
        "0" => "1",
        _ => "0",
    };
    kept.digests.replace_range(24..25, digit);
    kept.save(&ron, &trace).expect("written");
}

#[test]
fn damaged_run_directories_are_named_and_nothing_panics() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let run = PathBuf::from(run);
    let whole = std::fs::read(run.join("policy.safetensors")).expect("a policy");
    let name = run.display().to_string();
    type Damage<'a> = (&'a str, &'a dyn Fn(), i32, &'a str);
    let policy = run.join("policy.safetensors");
    let manifest = run.join("manifest.json");
    let good_manifest = std::fs::read(&manifest).expect("a manifest");
    let damages: [Damage; 5] = [
        (
            "truncated policy",
            &|| write(&policy, &whole[..whole.len() / 2]),
            3,
            "SHA-256",
        ),
        (
            "missing policy",
            &|| std::fs::remove_file(&policy).expect("r"),
            3,
            "policy.safetensors",
        ),
        (
            "another world",
            &|| {
                write(&policy, &whole);
                write(&run.join("world.ron"), b"Scenario()");
            },
            3,
            "world.ron",
        ),
        (
            "truncated manifest",
            &|| write(&manifest, &good_manifest[..40]),
            3,
            "manifest.json",
        ),
        (
            "no manifest",
            &|| std::fs::remove_file(&manifest).expect("r"),
            2,
            "manifest.json",
        ),
    ];
    for (what, damage, expect, says) in damages {
        damage();
        let output = brakecheck(&["eval", &name, "--starts", "5"]);
        assert_eq!(code(&output), expect, "{what}: {}", stderr(&output));
        assert!(
            stderr(&output).contains(says),
            "{what}: {}",
            stderr(&output)
        );
        assert!(!stderr(&output).contains("panicked"), "{what}");
    }
}

fn write(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).expect("written");
}

#[test]
fn an_unwritable_output_is_refused_before_training() {
    let output = brakecheck(&["train", "worlds/acc.ron", "-o", "/proc/none/run"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("/proc/none/run"));
    let dir = scratch();
    let file = path(&dir, "file");
    std::fs::write(&file, "x").expect("written");
    // A file in the way is a mistake of the command line.
    let output = brakecheck(&["train", "worlds/acc.ron", "-o", &file]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
}

#[test]
fn a_used_run_directory_is_not_overwritten() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let (_, again) = small_run(&dir, "run", &[]);
    assert_eq!(code(&again), 2);
    assert!(stderr(&again).contains("--resume"), "{}", stderr(&again));
    // Resuming a finished run trains nothing and evaluates again.
    let read = |name: &str| std::fs::read(Path::new(&run).join(name)).expect("a file");
    let before = ["manifest.json", "policy.safetensors", "progress.jsonl"].map(read);
    std::fs::remove_file(Path::new(&run).join("report.json")).expect("removed");
    let (_, resumed) = small_run(&dir, "run", &["--resume"]);
    assert_eq!(code(&resumed), 0, "{}", stderr(&resumed));
    let after = ["manifest.json", "policy.safetensors", "progress.jsonl"].map(read);
    assert_eq!(before, after);
    assert!(Path::new(&run).join("report.json").is_file());
    // Another length is another training.
    let longer = brakecheck(&[
        "train",
        "worlds/acc.ron",
        "-o",
        &run,
        "--resume",
        "--decisions",
        "13000",
    ]);
    assert_eq!(code(&longer), 2, "{}", stderr(&longer));
    assert!(stderr(&longer).contains("--from"));
}

#[cfg(unix)]
#[test]
fn ctrl_c_saves_and_resuming_ends_in_the_same_bytes() {
    use std::io::Read;
    use std::process::{Command as Process, Stdio};
    let dir = scratch();
    // Long enough to be interrupted behind the first checkpoint.
    let long = [
        "--decisions",
        "65000",
        "--starts",
        "5",
        "--plant",
        "kinematic",
    ];
    let train = |run: &str, more: &[&str]| {
        let head = ["train", "worlds/acc.ron", "-o", run];
        brakecheck(&[&head[..], &long, more].concat())
    };
    let (whole, cut) = (path(&dir, "whole"), path(&dir, "cut"));
    assert_eq!(code(&train(&whole, &[])), 0);
    let program = assert_cmd::cargo::cargo_bin("brakecheck");
    let mut child = Process::new(program)
        .current_dir(root())
        .args(["train", "worlds/acc.ron", "-o", &cut])
        .args(long)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    // Wait for the first checkpoint, then interrupt.
    let checkpointed = || {
        let manifest = std::fs::read_to_string(Path::new(&cut).join("manifest.json"));
        manifest.is_ok_and(|text| text.contains("checkpoint-"))
    };
    while !checkpointed() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let pid = child.id().to_string();
    let killed = Process::new("kill")
        .args(["-INT", &pid])
        .status()
        .expect("kill");
    assert!(killed.success());
    let status = child.wait().expect("it ends");
    let mut said = String::new();
    child
        .stderr
        .take()
        .expect("piped")
        .read_to_string(&mut said)
        .expect("text");
    assert_eq!(status.code(), Some(130), "{said}");
    // A damaged checkpoint is refused, not trained on.
    let checkpoint = std::fs::read_dir(&cut)
        .expect("a run")
        .map(|e| e.expect("an entry").path());
    let checkpoint = checkpoint
        .into_iter()
        .find(|p| {
            p.file_name()
                .is_some_and(|n| n.to_string_lossy().starts_with("checkpoint-"))
        })
        .expect("a checkpoint");
    let good = std::fs::read(&checkpoint).expect("read");
    let mut bad = good.clone();
    bad[good.len() / 2] ^= 1;
    write(&checkpoint, &bad);
    let refused = train(&cut, &["--resume"]);
    assert_eq!(code(&refused), 3, "{}", stderr(&refused));
    assert!(stderr(&refused).contains("checkpoint-"));
    write(&checkpoint, &good);
    let resumed = train(&cut, &["--resume"]);
    assert_eq!(code(&resumed), 0, "{}", stderr(&resumed));
    for name in ["policy.safetensors", "counterexamples.jsonl"] {
        let kept = |run: &str| std::fs::read(Path::new(run).join(name)).expect("a file");
        assert!(kept(&whole) == kept(&cut), "{name}");
    }
}

#[test]
fn help_is_what_it_was() {
    let mut text = String::new();
    for verb in [
        "", "check", "train", "eval", "gate", "sweep", "search", "replay", "stl",
    ] {
        let args: Vec<&str> = [verb, "--help"]
            .into_iter()
            .filter(|a| !a.is_empty())
            .collect();
        let output = brakecheck(&args);
        assert_eq!(code(&output), 0);
        text.push_str(&format!(
            "=== {verb}\n{}\n",
            String::from_utf8_lossy(&output.stdout)
        ));
    }
    insta::assert_snapshot!("help", text);
}
