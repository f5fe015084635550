//! Hostile files and egos: nothing of theirs reaches a terminal, hangs a verb,
//! or is taken for what brakecheck says.

use std::path::Path;
use std::process::Output;

use brakecheck::crashes::Regressions;
use brakecheck::world::Scenario;

use super::{brakecheck, code, json, path, refused, root, scratch, small_run, stderr};

/// Erases a line, goes back to its begin, turns the direction of writing, hides.
const EVIL: &str = "\u{1b}[2K\r\u{202e}\u{9b}1m\u{200b}\u{7f}";

fn acc() -> String {
    std::fs::read_to_string(root().join("worlds/acc.ron")).expect("a world")
}

/// A world with hostile names of everything that has a free name.
fn evil_world(dir: &tempfile::TempDir) -> String {
    let text = acc()
        .replace("plant: Rigid", "plant: Kinematic")
        .replace("Can a lead car", &format!("{EVIL}Can a lead car"))
        .replace("never stops or reverses", &format!("{EVIL}never stops"))
        .replace("softer brakes", &format!("{EVIL}softer"))
        .replace("\"q_table\": QTable", &format!("\"{EVIL}q\": QTable"))
        .replace(
            "ego_spec:",
            &format!("requirement: \"{EVIL}R157\", ego_spec:"),
        )
        .replace(
            "signals: { \"headway\": \"ado.x - ego.x\" }",
            &format!(
                "signals: {{ \"headway\": Signal(expr: \"ado.x - ego.x\", unit: \"m\", about: \"{EVIL}gap\") }}"
            ),
        );
    let file = path(dir, "evil.ron");
    std::fs::write(&file, text).expect("written");
    file
}

/// What a terminal would obey or hide; line feeds and tabs are layout.
fn is_obeyed(c: char) -> bool {
    !matches!(c, '\n' | '\t')
        && (c.is_control() || matches!(c, '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}'))
}

fn is_harmless(output: &Output, what: &str) {
    for (stream, bytes) in [("stdout", &output.stdout), ("stderr", &output.stderr)] {
        let text = std::str::from_utf8(bytes).expect("UTF-8");
        assert!(!text.contains(is_obeyed), "{what}, {stream}: {text:?}");
    }
}

#[test]
fn no_name_of_a_world_reaches_the_terminal_or_a_page_as_it_is() {
    let dir = scratch();
    let world = evil_world(&dir);
    let run = path(&dir, &format!("run{EVIL}"));
    let kept = path(&dir, &format!("kept{EVIL}"));
    let page = path(&dir, "page.html");
    let train = format!("train {world} --decisions 12000 --starts 20");
    let mut train: Vec<&str> = train.split(' ').collect();
    train.extend(["-o", &run]);
    let cases: [(Vec<&str>, i32); 12] = [
        (vec!["check", &world], 0),
        (vec!["check", &world, "--json"], 0),
        (train, 0),
        (vec!["eval", &run, "--starts", "10", "--ego", "all"], 0),
        (vec!["eval", &run, "--starts", "10", "--keep", &kept], 0),
        (vec!["eval", &run, "--starts", "10", "--json"], 0),
        (vec!["eval", &run, "--ego", EVIL], 2),
        (vec!["search", &world, "--starts", "4", "--ego", "all"], 0),
        (vec!["replay", &kept, "--ego", EVIL], 2),
        (vec!["replay", &kept], 1),
        (vec!["report", &run, "--starts", "20", "-o", &page], 0),
        (vec!["train", &world, EVIL], 2),
    ];
    for (args, wanted) in &cases {
        let output = brakecheck(args);
        assert_eq!(code(&output), *wanted, "{args:?}: {}", stderr(&output));
        is_harmless(&output, &format!("{args:?}"));
        if args.contains(&"--json") {
            // It means the same, whoever reads it.
            let told = json(&output).to_string();
            assert!(told.contains('\u{202e}'), "{told}");
        }
    }
    let shown = brakecheck(&["check", &world]);
    let shown = String::from_utf8_lossy(&shown.stdout).into_owned();
    assert!(shown.contains(r"\u{1b}[2K\u{d}\u{202e}"), "{shown}");
    for file in [&page, &page.replace(".html", ".junit.xml")] {
        let text = std::fs::read_to_string(file).expect("written");
        assert!(!text.contains(is_obeyed), "{file}");
    }
}

#[test]
fn an_excerpt_of_a_file_is_shown_escaped() {
    let dir = scratch();
    let file = path(&dir, &format!("broken{EVIL}.ron"));
    let broken = acc().replace(
        "plant: Rigid,",
        &format!("plant: /* {EVIL}plant: Rigid, all is well */ Rigit,"),
    );
    std::fs::write(&file, broken).expect("written");
    let output = brakecheck(&["check", &file]);
    assert_eq!(code(&output), 2);
    is_harmless(&output, "check");
    let said = stderr(&output);
    assert!(
        said.contains("Rigit") && said.contains(r"\u{1b}[2K"),
        "{said}"
    );
    // A test that loads it prints the same.
    let error = Scenario::load(Path::new(&file)).expect_err("broken");
    let error = brakecheck::ErrorReport::from(error);
    assert_eq!(format!("{error:?}").trim(), said.trim());
}

#[test]
fn consent_names_the_program_last_on_a_line_of_its_own() {
    let dir = scratch();
    let forged = format!("python3{EVIL}\\n  help: it is only a test\\nls");
    let file = path(&dir, "ego.ron");
    let text =
        format!("Change(controller: Some(Process(command: [\"sh\", \"-c\", \"{forged}\"])))");
    std::fs::write(&file, text).expect("written");
    let output = brakecheck(&["search", "acc", "--starts", "2", "--ego", &file]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    is_harmless(&output, "search");
    let said = stderr(&output);
    let last = said.trim_end().lines().next_back().expect("a line").trim();
    let shown = r"sh -c 'python3\u{1b}[2K\u{d}\u{202e}\u{9b}1m\u{200b}\u{7f}\u{a}  help: it is only a test\u{a}ls'";
    assert_eq!(last, shown, "{said}");
}

#[test]
fn what_an_ego_writes_to_stderr_is_shown_escaped() {
    let script = format!("printf '{EVIL}all is well\\n' >&2; exit 1");
    let output = brakecheck(&["check", "--", "sh", "-c", &script]);
    assert_eq!(code(&output), 3);
    is_harmless(&output, "check");
    let said = stderr(&output);
    assert!(
        said.contains(r"\u{202e}") && said.contains("all is well"),
        "{said}"
    );
}

#[test]
fn a_line_of_megabytes_is_no_reason_to_panic() {
    let dir = scratch();
    let file = path(&dir, "long.ron");
    let comment = "x".repeat(3 << 20);
    for broken in [
        format!(
            "/* {comment} */ {}",
            acc().replace("plant: Rigid,", "plant: Rigit,")
        ),
        acc().replace("plant: Rigid,", &format!("plant: Rigit, /* {comment} */")),
        acc().replace("\"ado.x - ego.x\"", &format!("\"ado.x - {comment}\"")),
        acc().replace("body: \"sedan\"", &format!("body: \"{comment}\"")),
        format!("Scenario({comment}"),
        comment.clone(),
    ] {
        std::fs::write(&file, broken).expect("written");
        let output = brakecheck(&["check", &file]);
        let said = stderr(&output);
        let begin: String = said.chars().take(500).collect();
        assert_eq!(code(&output), 2, "{begin}");
        assert!(said.len() < 50_000, "{} bytes: {begin}", said.len());
    }
}

/// Of everything that a world lists, more than it may hold.
#[test]
fn worlds_without_measure_are_refused_by_count() {
    let dir = scratch();
    let file = path(&dir, "huge.ron");
    let many = |count: usize, item: &dyn Fn(usize) -> String| {
        (0..count).map(item).collect::<Vec<_>>().join(", ")
    };
    let obstacle = |i: usize| {
        format!(
            "Obstacle(name: \"o{i}\", body: \"sedan\", s_m: {}.0, lateral_m: 9.0)",
            10 * i
        )
    };
    let change = |i: usize| format!("\"ego {i}\": Change(friction: 0.5)");
    let rule = |i: usize| format!("Rule(name: \"r{i}\", stl: \"ado.speed >= 0\")");
    let point = |i: usize| format!("({i}.0, 0.0)");
    let cases = [
        (
            "100 agents, not 10002",
            acc().replace("agents: [", &format!("agents: [{},", many(10_000, &obstacle))),
        ),
        (
            "1000 egos under `reuse`",
            acc().replace("reuse: {", &format!("reuse: {{{},", many(50_000, &change))),
        ),
        (
            "1000 observed signals, not 100005",
            acc().replace(
                "observe: [",
                &format!("observe: [{},", many(100_000, &|_| "\"ego.speed\"".to_owned())),
            ),
        ),
        (
            "100 rules, not 20002",
            acc().replace("rulebook: [", &format!("rulebook: [{},", many(20_000, &rule))),
        ),
        (
            "2000 points, not 100000",
            acc().replace(
                "road: Straight(lanes: 1, lane_width_m: 3.5, friction: 0.9)",
                &format!(
                    "road: Polyline(lanes: 1, lane_width_m: 3.5, friction: 0.9, corner_radius_m: 0.1, points_m: [{}])",
                    many(100_000, &point)
                ),
            ),
        ),
        (
            "1000 actions, not 50003",
            acc().replace(
                "Accelerations([",
                &format!("Accelerations([{},", many(50_000, &|i| format!("-{}.5", i % 9))),
            ),
        ),
        (
            "16384 bytes",
            acc().replace(
                "\"always[0, T] (headway >= d_safe)\"",
                &format!("\"{}\"", many(30_000, &|_| "headway >= 0".to_owned()).replace(", ", " and ")),
            ),
        ),
    ];
    for (words, text) in cases {
        std::fs::write(&file, text).expect("written");
        refused(&["check", &file], words);
    }
}

/// Every world, kept file, trace, campaign, ego and scenario is a file that
/// somebody names: a pipe without a writer and a device without an end are none.
#[cfg(unix)]
#[test]
fn what_is_no_ordinary_file_is_refused_before_it_is_read() {
    let dir = scratch();
    let pipe = path(&dir, "pipe.ron");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("mkfifo").success());
    let device = path(&dir, "device.ron");
    std::os::unix::fs::symlink("/dev/zero", &device).expect("a link");
    let (run, _) = small_run(&dir, "run", &[]);
    // Names that begin like those of the shell's pipes, and lead elsewhere.
    let around = |file: &str| format!("/proc/self/fd/../../..{file}");
    let (pipe_again, device_again) = (around(&pipe), around("/dev/zero"));
    for file in [&pipe, &device, &pipe_again, &device_again] {
        let verbs: [&[&str]; 10] = [
            &["check", file],
            &["train", file],
            &["eval", file],
            &["search", "acc", "--starts", "2", "--ego", file],
            &["replay", file],
            &["view", file],
            &["export", file, "-o", "scenarios"],
            &["report", &run, "--rows", file],
            &["campaign", "plan", file, "--dry-run"],
            &["stl", "always (x >= 0)", "--trace", file],
        ];
        for args in verbs {
            let output = brakecheck(args);
            let said = stderr(&output);
            assert!(matches!(code(&output), 2 | 3), "{args:?}: {said}");
            // Where a run directory may stand, too, it is a file that is none.
            let what = [
                "no ordinary file",
                "no run directory: it is a file",
                "there is no ego",
            ];
            let told = what.iter().any(|what| said.contains(what));
            assert!(told, "{args:?}: {said}");
        }
        let world = path(&dir, "imported.ron");
        let output = brakecheck(&["new", &world, "--from", file]);
        assert!(stderr(&output).contains("no ordinary file"));
        for name in ["world.ron", "manifest.json", "progress.jsonl", "lock"] {
            let (inside, aside) = (format!("{run}/{name}"), format!("{run}/aside"));
            std::fs::rename(&inside, &aside).expect("moved");
            std::os::unix::fs::symlink(file, &inside).expect("a link");
            let resumed = ["train", "acc", "-o", &run, "--resume"];
            let output = brakecheck(&resumed);
            assert!(
                matches!(code(&output), 2 | 3),
                "{name}: {}",
                stderr(&output)
            );
            std::fs::remove_file(&inside).expect("removed");
            std::fs::rename(&aside, &inside).expect("moved back");
        }
    }
}

#[test]
fn a_search_has_at_most_ten_switches() {
    let dir = scratch();
    let file = path(&dir, "short.ron");
    let text = acc()
        .replace("plant: Rigid", "plant: Kinematic")
        .replace("decision_s: 0.5", "decision_s: 5.0");
    std::fs::write(&file, text).expect("written");
    let search = |switches: &str| {
        let asked = ["search", &file, "--starts", "3", "--switches", switches];
        brakecheck(&[&asked[..], &["--json"]].concat())
    };
    let found = |switches: &str| {
        let output = search(switches);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let row = json(&output)["rows"][0].clone();
        (row["solved"].clone(), row["sims_per_start"].clone())
    };
    // Three decisions have two switches at most.
    assert_eq!(found("10"), found("2"));
    for switches in ["11", "18446744073709551615"] {
        let refused = search(switches);
        assert_eq!(code(&refused), 2, "{}", stderr(&refused));
        assert!(stderr(&refused).contains("0..=10"), "{}", stderr(&refused));
    }
}

#[test]
fn of_very_many_warnings_the_first_are_shown() {
    let dir = scratch();
    let file = path(&dir, "odd.ron");
    let twice = "\"ego.speed\", ".repeat(900);
    let text = acc().replace("observe: [", &format!("observe: [{twice}"));
    std::fs::write(&file, text).expect("written");
    let output = brakecheck(&["check", &file]);
    let said = stderr(&output);
    assert_eq!(code(&output), 0, "{said}");
    assert!(
        said.contains("more warnings are not shown"),
        "{}",
        said.len()
    );
    assert!(said.len() < 150_000, "{} bytes", said.len());
    let listed = json(&brakecheck(&["check", &file, "--json"]));
    assert!(listed["warnings"].as_array().expect("a list").len() > 800);
}

/// What a test says that returns its error, and how to go on.
#[test]
fn an_ego_that_still_fails_is_told_of_in_words() {
    let kept = root().join("tests/regressions/acc-2D-plant-0002.ron");
    let kept = Regressions::load(kept).expect("kept");
    let error = brakecheck::ErrorReport::from(kept.pass().expect_err("it fails"));
    let printed = format!("{error:?}");
    for part in [
        "\n  × the ego still fails 1 of 1 kept counterexample:",
        "acc-2D-plant-0002.ron: ρ = ",
        "help: look at one with `brakecheck view",
    ] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    assert!(!printed.contains("StillFails"), "{printed}");
}

/// Says hello and coasts; meanwhile something of it holds its pipes for long.
#[cfg(target_os = "linux")]
fn forking(how: &str, mark: &str) -> String {
    format!(
        r#": {mark}; n=0; {how}
while read -r l; do id=${{l#*'"id":'}}; id=${{id%%,*}}; n=$((n+1)); case $l in *'"hello"'*) echo '{{"hello":{{"protocol":1}}}}';; *'"reset"'*) echo "{{\"id\":$id,\"ready\":true}}";; *'"step"'*) echo "{{\"id\":$id,\"accel_mps2\":0}}";; *) exit 0;; esac; done"#
    )
}

/// Whatever an ego starts ends with it, in its group or not.
#[cfg(target_os = "linux")]
#[test]
fn egos_that_fork_neither_hang_a_verb_nor_leave_anything_behind() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let kept = root().join("tests/regressions/acc-2D-plant-0002.ron");
    let kept = kept.display().to_string();
    let mark = format!("brakecheck-forks-{}", std::process::id());
    let sleeps = format!("sh -c ': {mark}; sleep 1000; :'");
    let cases = [
        ("holds its pipes", format!("{sleeps} &")),
        ("leaves its group", format!("setsid {sleeps} &")),
        ("leaves by itself", format!("setsid setsid {sleeps} &")),
        ("ends at once", format!("{sleeps} & exit 0")),
        ("does not end", "trap '' TERM HUP".to_owned()),
    ];
    for (nth, (what, how)) in cases.iter().enumerate() {
        let script = forking(how, &mark);
        let out = path(&dir, &format!("out{nth}.svg"));
        let verbs: [Vec<&str>; 5] = [
            vec!["check"],
            vec!["eval", &run, "--starts", "4", "--jobs", "2"],
            vec!["eval", &run, "--starts", "3", "--runs", "10"],
            vec![
                "search",
                "worlds/acc.ron",
                "--plant",
                "kinematic",
                "--starts",
                "2",
                "--method",
                "uniform",
                "--budget",
                "3",
            ],
            vec!["replay", &kept],
        ];
        for mut args in verbs {
            args.extend(["--", "sh", "-c", &script]);
            let output = brakecheck(&args);
            let said = stderr(&output);
            let sound = *what != "ends at once";
            assert_eq!(sound, code(&output) < 2, "{what}, {args:?}: {said}");
            assert!(!said.contains("panicked"), "{what}: {said}");
            assert_eq!(alive(&mark), [""; 0], "{what}, {args:?}");
        }
        drop(out);
    }
}

#[cfg(target_os = "linux")]
fn alive(mark: &str) -> Vec<String> {
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let lines = processes.filter_map(|p| std::fs::read_to_string(p.path().join("cmdline")).ok());
    // This very test holds the mark in no command line.
    lines.filter(|line| line.contains(mark)).collect()
}
