//! Programs whose commands depend on more than the episode, and programs that were rebuilt.

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use super::{brakecheck, code, json, path, root, scratch, small_run, stderr};
use serde_json::Value;

/// Python itself: a wrapper of the PATH would take most of the time of these tests.
fn python() -> &'static str {
    static FOUND: LazyLock<String> = LazyLock::new(|| {
        let mut asked = Command::new("python3");
        let output = asked
            .args(["-c", "import sys; print(sys.executable)"])
            .output()
            .expect("Python is there");
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    });
    &FOUND
}

fn follower() -> String {
    root().join("tests/data/follower.py").display().to_string()
}

/// Runs a verb against the follower of a kind.
fn against(verb: &[&str], kind: &[&str]) -> std::process::Output {
    let follower = follower();
    let program = ["--", python(), &follower];
    brakecheck(&[verb, &program, kind].concat())
}

/// Runs all on a few threads, because the programs mostly wait.
fn in_parallel<T: Sync>(all: &[T], work: impl Fn(&T) + Sync) {
    let work = &work;
    std::thread::scope(|scope| {
        for part in all.chunks(all.len().div_ceil(6)) {
            scope.spawn(move || part.iter().for_each(work));
        }
    });
}

/// Writes a world of short runs, because programs answer slowly.
fn short_world(dir: &tempfile::TempDir) -> String {
    let file = path(dir, "short.ron");
    let text = include_str!("../../worlds/acc.ron").replace("horizon_s: 15.0", "horizon_s: 1.0");
    std::fs::write(&file, text).expect("written");
    file
}

/// Kinds of the follower, with the finding about each.
const KINDS: [(&str, Option<&str>); 17] = [
    ("sound", None),
    ("cleared_latch", None),
    ("seeded", None),
    ("latch", Some("kept_state")),
    ("limps", Some("kept_state")),
    ("learns_gap", Some("kept_state")),
    ("mean", Some("kept_state")),
    ("tired", Some("kept_state")),
    ("counts_steps", Some("kept_state")),
    ("alternates", Some("kept_state")),
    ("cold", Some("kept_state")),
    ("one_generator", Some("kept_state")),
    ("old", Some("clock")),
    ("random", Some("random")),
    ("clock", Some("clock")),
    ("silence", Some("clock")),
    ("clock_rate", Some("clock")),
];

#[test]
fn check_names_what_the_commands_of_a_program_depend_on() {
    in_parallel(&KINDS, |(kind, finding)| {
        let output = against(&["check", "--json"], &[kind]);
        let said = json(&output);
        let found = said["unrepeatable"]["kind"].as_str();
        // Old programs and those that keep state may look like each other, and on a busy
        // machine a clock that is read finely is random.
        let alike = match *kind {
            "old" => found == Some("kept_state"),
            "clock" | "clock_rate" => found == Some("random"),
            _ => false,
        };
        assert!(found == *finding || alike, "{kind}: {said}");
        assert_eq!(said["deterministic"], finding.is_none(), "{kind}");
        let fails = found.is_some_and(|it| it != "random");
        assert_eq!(code(&output), if fails { 3 } else { 0 }, "{kind}: {said}");
    });
}

#[test]
fn a_random_program_is_marked_as_one() {
    let output = against(&["check"], &["random"]);
    let table = String::from_utf8_lossy(&output.stdout);
    let row = "random ┆ runs again with one seed";
    assert!(table.contains(row), "{table}");
}

#[test]
fn no_row_of_such_a_program_is_a_result() {
    // Whether the ego is old or its clock shows in a few episodes depends on the machine.
    let kinds: Vec<_> = KINDS
        .iter()
        .filter(|(kind, _)| !["old", "clock", "silence"].contains(kind))
        .collect();
    in_parallel(&kinds, |(kind, finding)| {
        let verb = ["search", "acc", "--plant", "kinematic", "--method", "hold"];
        let effort = ["--starts", "5", "--budget", "6", "--jobs", "1", "--json"];
        let output = against(&[&verb[..], &effort].concat(), &[kind]);
        let said = stderr(&output);
        assert_eq!(
            code(&output),
            if finding.is_some() { 3 } else { 0 },
            "{kind}: {said}"
        );
        let row = json(&output)["rows"][0].clone();
        assert_eq!(
            row["faults"][0]["kind"].as_str(),
            *finding,
            "{kind}: {said}"
        );
        // Such a row has no rate, and the verdict is none.
        assert_eq!(row["success_rate"].is_null(), finding.is_some(), "{kind}");
        if *finding == Some("kept_state") {
            assert!(said.contains("clear your state at `reset`"), "{said}");
            assert!(!said.contains("repeats"), "{said}");
        }
    });
}

#[test]
fn every_verb_finds_state_and_fresh_programs_keep_none() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let kept = path(&dir, "kept");
    let keep = format!("{kept},all,as-found");
    let search = ["search", "acc", "--plant", "kinematic", "--starts", "30"];
    let found = brakecheck(&[&search[..], &["--keep", &keep]].concat());
    assert_eq!(code(&found), 0, "{}", stderr(&found));
    let files = std::fs::read_dir(&kept).expect("kept").count();
    assert!(files > 10, "{files}");
    let hold = ["search", "acc", "--method", "hold", "--budget", "4"];
    let hold = [&hold[..], &["--starts", "6"]].concat();
    let verbs: [&[&str]; 4] = [
        &hold,
        &["eval", &run, "--starts", "20"],
        &["gate", &run, "--starts", "20", "--baseline-ego", "nominal"],
        &["replay", &kept],
    ];
    in_parallel(&verbs, |verb| {
        let verb = [*verb, &["--json"]].concat();
        let tired = against(&verb, &["tired"]);
        assert_eq!(code(&tired), 3, "{verb:?}: {}", stderr(&tired));
        let text = String::from_utf8_lossy(&tired.stdout).into_owned();
        assert!(text.contains("kept_state"), "{verb:?}: {text}");
        // Started anew, it never tires.
        let fresh = against(&[&verb[..], &["--fresh"]].concat(), &["tired"]);
        let sound = against(&verb, &["sound"]);
        assert!(code(&fresh) != 3, "{verb:?}: {}", stderr(&fresh));
        assert_eq!(code(&fresh), code(&sound), "{verb:?}");
        let solved = |output| -> Vec<Value> {
            let rows = json(output)["rows"]
                .as_array()
                .cloned()
                .unwrap_or_default()
                .into_iter();
            rows.map(|row| row["solved"].clone()).collect()
        };
        assert_eq!(solved(&fresh), solved(&sound), "{verb:?}");
    });
}

#[test]
fn a_risk_of_a_program_that_keeps_state_is_no_result() {
    let dir = scratch();
    let (world, traffic) = (short_world(&dir), root().join("examples/traffic/acc.ron"));
    let traffic = traffic.display().to_string();
    let asked = ["risk", &world, "--traffic", &traffic, "--budget", "1000"];
    let tired = against(&asked, &["tired"]);
    assert_eq!(code(&tired), 3, "{}", stderr(&tired));
    let said = stderr(&tired)
        .replace(['\n', '│'], "")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(said.contains("clear your state at `reset`"), "{said}");
}

#[test]
fn a_random_program_needs_repeats_and_a_fresh_one_is_written_in_a_file() {
    let dir = scratch();
    let world = |repeats: &str| {
        let text = std::fs::read_to_string(root().join("worlds/acc.ron")).expect("the world");
        let file = path(&dir, &format!("acc{}.ron", repeats.len()));
        let text = text.replacen("agents: [", &format!("{repeats}agents: ["), 1);
        std::fs::write(&file, text).expect("written");
        file
    };
    let search = |world: &str, ego: &[&str]| {
        let verb = ["search", world, "--plant", "kinematic", "--method", "hold"];
        let effort = ["--starts", "4", "--budget", "4"];
        brakecheck(&[&verb[..], &effort, ego].concat())
    };
    let follower = follower();
    let random = ["--", python(), &follower, "random"];
    assert_eq!(code(&search(&world(""), &random)), 3);
    let repeated = search(&world("repeats: 3,\n    "), &random);
    assert_eq!(code(&repeated), 0, "{}", stderr(&repeated));
    let ego = path(&dir, "fresh.ron");
    let change = |fresh: &str| {
        let text = format!(
            "Change(controller: Process(command: [\"python3\", {follower:?}, \"tired\"]{fresh}))"
        );
        std::fs::write(&ego, text).expect("written");
        search(&world(""), &["--ego", &ego, "--allow-programs"])
    };
    assert_eq!(code(&change("")), 3);
    let fresh = change(", fresh: true");
    assert_eq!(code(&fresh), 0, "{}", stderr(&fresh));
}

#[cfg(unix)]
#[test]
fn a_rebuilt_program_is_another_ego() {
    use std::os::unix::fs::PermissionsExt;

    let dir = scratch();
    let ego = path(&dir, "ego");
    let build = |accel: &str| {
        let script = format!(
            "#!/bin/sh\nwhile read -r l; do id=${{l#*'\"id\":'}}; id=${{id%%,*}}; case $l in \
             *'\"hello\"'*) echo '{{\"hello\":{{\"protocol\":1}}}}';; *'\"reset\"'*) \
             echo \"{{\\\"id\\\":$id,\\\"ready\\\":true}}\";; *'\"step\"'*) \
             echo \"{{\\\"id\\\":$id,\\\"accel_mps2\\\":{accel}}}\";; *) exit 0;; esac; done\n"
        );
        std::fs::write(&ego, script).expect("written");
        std::fs::set_permissions(&ego, std::fs::Permissions::from_mode(0o755)).expect("set");
    };
    let traffic = root().join("examples/traffic/acc.ron");
    let (traffic, stored) = (traffic.display().to_string(), path(&dir, "runs"));
    let world = short_world(&dir);
    let risk = || {
        let asked = [
            "risk",
            &world,
            "--traffic",
            &traffic,
            "--budget",
            "1000",
            "-o",
        ];
        brakecheck(&[&asked[..], &[&stored, "--", &ego]].concat())
    };
    let (file, plan) = (path(&dir, "campaign.ron"), path(&dir, "plan"));
    let text = format!(
        "Campaign(name: \"s\", worlds: [(file: \"acc\", plant: Kinematic)], egos: [Changed(name: \
         \"mine\", change: Change(controller: Process(command: [{ego:?}])))], ados: [Held], \
         starts: Drawn(count: 6, seed: 9))"
    );
    std::fs::write(&file, text).expect("written");
    let campaign =
        |step: &[&str]| brakecheck(&[&["campaign"], step, &["--allow-programs"]].concat());
    build("2.0");
    let first = risk();
    assert!(code(&first) != 2, "{}", stderr(&first));
    assert_eq!(code(&campaign(&["plan", &file, "-o", &plan])), 0);
    let ran = campaign(&["run", &plan]);
    assert_eq!(code(&ran), 0, "{}", stderr(&ran));
    assert_eq!(code(&campaign(&["merge", &plan])), 0);
    // The same program goes on.
    assert_eq!(code(&risk()), code(&first));
    assert_eq!(code(&campaign(&["run", &plan])), 0);
    let before: Value = serde_json::from_str(
        &std::fs::read_to_string(Path::new(&stored).join("programs.json")).expect("it"),
    )
    .expect("JSON");
    let programs = before["programs"].as_object().expect("programs");
    let (_, program) = programs.iter().next().expect("one");
    let was = program["sha256"].as_str().expect("a hash");
    build("-2.0");
    for refused in [risk(), campaign(&["run", &plan])] {
        assert_eq!(code(&refused), 2, "{}", stderr(&refused));
        let said = stderr(&refused).replace(['\n', ' ', '│'], "");
        assert!(said.contains(was), "{said}");
        assert!(said.contains("changed:"), "{said}");
    }
    build("2.0");
    assert_eq!(code(&risk()), code(&first));
    // Results without a content are nobody's.
    std::fs::remove_file(Path::new(&stored).join("programs.json")).expect("removed");
    assert_eq!(code(&risk()), 2);
}

#[cfg(target_os = "linux")]
#[test]
fn a_program_that_hangs_delays_no_end_and_one_without_its_guard_is_killed() {
    let mark = format!("brakecheck-hangs-{}", std::process::id());
    let follower = follower();
    let asked = [
        "search",
        "acc",
        "--starts",
        "4",
        "--",
        python(),
        &follower,
        "hangs",
        &mark,
    ];
    let mut program = Command::new(env!("CARGO_BIN_EXE_brakecheck"));
    let mut program = program
        .args(asked)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it runs");
    // It hangs from its sixth step on.
    let began = Instant::now();
    while alive(&mark) < 2 && began.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(500));
    let pid = program.id().to_string();
    let sent = Command::new("kill").args(["-INT", &pid]).status();
    assert!(sent.expect("kill").success());
    let asked = Instant::now();
    let status = program.wait().expect("it ends");
    assert_eq!(status.code(), Some(130));
    let took = asked.elapsed();
    assert!(
        took < Duration::from_secs(5),
        "{took:?} of a timeout of 10 s"
    );
    assert_eq!(alive(&mark), 0);

    let verb = ["search", "acc", "--starts", "2", "--json"];
    let output = against(&verb, &["unguarded", &mark]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(
        stderr(&output).contains("which guards it"),
        "{}",
        stderr(&output)
    );
    assert_eq!(alive(&mark), 0);
}

#[cfg(target_os = "linux")]
fn alive(mark: &str) -> usize {
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let lines = processes.filter_map(|p| std::fs::read_to_string(p.path().join("cmdline")).ok());
    lines.filter(|line| line.contains(mark)).count()
}

#[test]
fn a_program_that_loads_for_long_is_told_of_its_timeout() {
    let dir = scratch();
    let ego = path(&dir, "slow.ron");
    let follower = follower();
    let search = |load_s: &str| {
        let change = format!(
            "Change(controller: Process(command: [\"python3\", {follower:?}, \"loads\", \
             \"{load_s}\"], timeout_s: 1.0))"
        );
        std::fs::write(&ego, change).expect("written");
        let verb = ["search", "acc", "--plant", "kinematic", "--method", "hold"];
        let effort = [
            "--starts", "2", "--budget", "2", "--jobs", "1", "--ego", &ego,
        ];
        brakecheck(&[&verb[..], &effort, &["--allow-programs"]].concat())
    };
    let loaded = search("1.5");
    assert_eq!(code(&loaded), 0, "{}", stderr(&loaded));
    let began = Instant::now();
    let late = search("60");
    assert_eq!(code(&late), 3);
    assert!(stderr(&late).contains("raise `timeout_s`") || stderr(&late).contains("raise\n"));
    // It is waited for once, whatever the number of episodes.
    assert!(began.elapsed() < Duration::from_secs(7));
}
